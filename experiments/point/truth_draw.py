"""Random truths for a study of many systems: hypotheses that its tasks' optimal paths enter."""

from __future__ import annotations

import numpy as np

from experiments.config.settings import Settings
from experiments.point.dynamics_tables import unconstrained_paths
from experiments.tracking.store import Store

_LEAST = 0.1  # share of the tasks that a truth must touch: else hardly a demonstration tells of it


def drawn_truths(settings: Settings, store: Store, count: int, seed: int = 0) -> list[int]:
    """Numbers of hypotheses, in order, drawn at random from the tasks' crossing region.

    That is all hypotheses which the optimal paths of at least a tenth of the tasks enter, of the
    `dynamics.tasks` that are drawn where nothing is forbidden.

    Args:
        settings: a point with the system, its tasks and hypotheses; its truth plays no part.
        store: where the tasks' optimal paths are kept.
        count: how many are drawn, at most all.
        seed: of the draw.
    """
    paths = unconstrained_paths(settings, store)
    entered = np.array([settings.candidates.violated_by(path.states) for path in paths])
    crossed = np.flatnonzero(entered.mean(axis=0) >= _LEAST)
    drawn = np.random.default_rng(seed).choice(crossed, min(count, len(crossed)), replace=False)
    return sorted(drawn.tolist())
