"""Random streams of a point, beside those of its trials.

A trial's stream has the key (trial,), see `mlci.demonstrator.sample_trials`; these have two entries
or more, the first of which is the purpose.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a stream is for."""

    ROLLOUTS = 0
    SUBSETS = 1
    MODEL_DEMONSTRATIONS = 2
    RULE_BREAKING = 3
    SENSOR_NOISE = 4
    EVIDENCE = 5
    NEXT_TASK = 6
    SETS = 7
    BASELINES = 8
    AREAS = 9
    SOFT = 10
    TRANSFER = 11
    CONTROLS = 12
    TRUTH = 13


def stream(seed: int, purpose: Purpose, *index: int) -> np.random.Generator:
    """A generator of its own for one purpose and one trial, set or world."""
    key = (int(purpose), *map(int, index))
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
