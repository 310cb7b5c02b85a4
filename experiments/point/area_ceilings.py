"""What an area could reach: with the truth as far as it was shown, and if all assumptions held."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mlci.areas.evidence import ShapeEvidence
from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Bools

_PAIRS = 300  # that are drawn, of which one is the truth of an ideal world
_IN_THE_WAY = 0.5  # of trajectories: a task counts as crossing what fewer of them avoid


def shown_truth(truth: Regions, demonstrations: Sequence[Demonstration], raster: Grid) -> Bools:
    """(P,) the regions of a truth that the straight way of some demonstration's task would enter.

    No method knows more that does not guess what nobody had reason to avoid.
    """
    shown = np.zeros(len(truth), dtype=bool)
    for each in demonstrations:
        shown |= truth.violated_by(each.states[[0, -1]])
    return np.asarray(truth.select(shown).signed_distance(raster.centers) < 0)


def ideal_world(
    evidence: ShapeEvidence,
    rng: np.random.Generator,
    together: Bools | None = None,
    *,
    spare: bool = False,
) -> tuple[ShapeEvidence, Bools] | None:
    """Evidence for the same tasks in a world in which all that inference assumes is right.

    Two of the shapes are forbidden, as the prior would have it but that they lie in the way of as
    many of the tasks as they can, and each demonstration is drawn from the tabular model under
    them.

    Args:
        evidence: of the tasks.
        rng: of the truth and the demonstrations.
        together: (C, C) which pairs may be forbidden together; all by default.
        spare: whether some tasks may be impossible in that world, as there are others; they tell
            nothing. Else the truth leaves them all possible.

    Returns:
        The evidence, and the truth (P,); None where the model cannot do a task.
    """
    tasks = [each for each in evidence.avoided if each is not None]
    count = evidence.inside.shape[1]
    if len(tasks) < len(evidence.avoided) or count < 2:
        return None
    first = rng.integers(0, count, _PAIRS)
    pairs = np.stack([first, (first + rng.integers(1, count, _PAIRS)) % count], axis=1)
    if together is not None:
        pairs = pairs[together[pairs[:, 0], pairs[:, 1]]]
    if not len(pairs):
        return None
    # (N, at most _PAIRS, S) whether a trajectory avoids both shapes of a pair.
    keeps_out = np.array([np.all(each[:, pairs], axis=2).T for each in tasks])
    share = np.mean(keeps_out, axis=2)
    crossed = np.sum((share > 0) & (share < _IN_THE_WAY), axis=0)
    if not spare:
        crossed[np.any(share == 0, axis=0)] = -1  # the model could not show it
    pair = int(np.argmax(crossed))
    if crossed[pair] < 0:
        return None
    violated, avoided = np.zeros_like(evidence.violated), list[Bools | None](tasks)
    for number, (each, of_task) in enumerate(zip(tasks, keeps_out, strict=True)):
        shown = np.flatnonzero(of_task[pair])
        if len(shown):
            violated[number] = ~each[rng.choice(shown)]
        else:
            avoided[number] = None
    truth = np.any(evidence.inside[:, pairs[pair]], axis=1)
    return replace(evidence, violated=violated, avoided=tuple(avoided)), truth
