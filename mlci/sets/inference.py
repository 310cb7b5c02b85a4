"""Belief over sets of a model's regions, exact where they are few enough, else from a sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.inference import Inference
from mlci.models import Model
from mlci.sets.evidence import SetEvidence
from mlci.sets.posterior import SetPosterior, SetPrior, can_enumerate, enumerate_sets
from mlci.sets.sampling import sample_sets
from mlci.spaces import Bools

PAIRS = SetPrior()  # none, one region, or two


def infer_sets(
    model: Model,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    prior: SetPrior = PAIRS,
    *,
    rng: np.random.Generator | None = None,
    chains: int = 4,
    steps: int = 1000,
    hypotheses: Bools | None = None,
    exact_ends: bool = True,
) -> SetPosterior:
    """Belief over sets of regions, from an inference about each alone.

    It is exact where all sets of up to 12 regions, all pairs of 4000, or something between are
    possible by prior and demonstrations, and is sampled otherwise.

    Args:
        model: the model.
        demonstrations: N demonstrations.
        inference: what `infer` says of them, with its rates and without a calibration.
        prior: of sets; by default of none, some one region, and some pair.
        rng: for a sample; None is seed 0.
        chains: as of `sample_sets`.
        steps: likewise.
        hypotheses: as of `infer`.
        exact_ends: likewise.

    Raises:
        ValueError: as of `SetEvidence.of` and `sample_sets`.
    """
    evidence = SetEvidence.of(
        model, demonstrations, inference, hypotheses=hypotheses, exact_ends=exact_ends
    )
    shape = (inference.avoidance.shape[1],) * 2
    if prior.neighbours is not None and prior.neighbours.shape != shape:
        raise ValueError(f"neighbours {prior.neighbours.shape} of a prior must be {shape}")
    if can_enumerate(evidence, prior):
        return enumerate_sets(evidence, prior)
    return sample_sets(evidence, prior, rng or np.random.default_rng(0), chains=chains, steps=steps)
