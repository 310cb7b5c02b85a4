"""What to record next to learn an area: the task after which it is expected to overlap best.

A demonstration is simulated under each plausible truth h, a set of shapes that is drawn from the
posterior: trajectories that are drawn once serve all truths, as one that avoids h weighs 1 / a_h
under h and others nothing (`mlci.task_outcomes`). After trajectory s the belief is p'(h), and the
truth g that is named for it is expected to overlap by

    U_s = max_g sum_h p'(h) IoU(g, h),

so that a task is worth the mean of U_s over truths and trajectories. Naming one of the drawn truths
in place of the best area (`mlci.areas.overlap`) makes that a lower bound, and cheap.
"""

from __future__ import annotations

import numpy as np

from mlci.areas.belief import SIZES, sets_of_shapes
from mlci.areas.evidence import ShapeEvidence
from mlci.spaces import Bools, Floats, Ints
from mlci.task_outcomes import under_truths

DRAWS = 300  # truths


def expected_overlaps(
    evidence: ShapeEvidence,
    recorded: Ints,
    rng: np.random.Generator,
    sizes: tuple[float, float, float] = SIZES,
    draws: int = DRAWS,
    together: Bools | None = None,
) -> Floats:
    """(N,) overlap that is expected after a demonstration of each task beside those recorded.

    It is over what is forbidden, if anything is. NaN where the model cannot do a task, and of all
    tasks where demonstrations exclude every shape.

    Args:
        evidence: of N demonstrations; those that are not recorded tell their tasks alone.
        recorded: numbers of the recorded ones.
        rng: of the truths.
        sizes: as of `mlci.areas.belief.infer_area`, as is `together`.
        draws: truths that are drawn from the posterior.
        together: see `sizes`.
    """
    worth = np.full(len(evidence.avoided), np.nan)
    sets = sets_of_shapes(evidence.of_some(recorded), sizes, together)
    if not len(sets.members):
        return worth
    met, share = sets.draw(draws, rng)
    truths = sets.members[met]
    overlaps = pairwise_overlaps(evidence.of_sets(truths))
    for number, avoided in enumerate(evidence.avoided):
        if avoided is not None:
            keeps_out = avoided[:, truths[:, 0]] & avoided[:, truths[:, 1]]
            once = np.ones(len(keeps_out), dtype=np.int64)
            joint = under_truths(keeps_out, once, evidence.rates.model_error) * share
            worth[number] = float(np.sum(np.max(joint @ overlaps, axis=1)))
    return worth


def choose_tasks(
    evidence: ShapeEvidence,
    count: int,
    rng: np.random.Generator,
    sizes: tuple[float, float, float] = SIZES,
    draws: int = DRAWS,
    together: Bools | None = None,
) -> Ints:
    """Numbers of the tasks that are recorded one after the other, each chosen after those before.

    Args:
        evidence: of N demonstrations; that of a task is looked at once the task is chosen.
        count: of tasks; fewer where no more can be told apart.
        rng: as of `expected_overlaps`, as are the others.
        sizes: likewise.
        draws: likewise.
        together: likewise.
    """
    chosen: list[int] = []
    while len(chosen) < count:
        worth = expected_overlaps(
            evidence, np.array(chosen, dtype=np.int64), rng, sizes, draws, together
        )
        worth[chosen] = np.nan
        if np.all(np.isnan(worth)):
            break
        chosen.append(int(np.nanargmax(worth)))
    return np.array(chosen, dtype=np.int64)


def pairwise_overlaps(masks: Bools) -> Floats:
    """(B, B) intersection over union of areas (B, P), none of them empty."""
    points = masks.astype(np.float32)
    shared, size = (points @ points.T).astype(float), np.sum(masks, axis=1)
    return np.asarray(shared / (size[:, None] + size - shared))
