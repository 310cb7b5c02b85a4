"""Several constraints of a table, one after the other: the greedy selection of Scobee and Sastry.

The more a set of constraints explains, the closer its distribution is to that of the N paths:

    KL = -H(paths) - mean reward + mean log Z(start),

where H is the entropy of the paths as they were counted, and Z that under the constraints. Each
step adds the hypothesis that no path uses and that lowers KL most, given those added before; it
stops where the best of the rest would lower KL by no more than a threshold.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from mlci.sets.evidence import SetEvidence
from mlci.sets.posterior import SetPrior
from mlci.sets.search import Selection, search, without_needless
from mlci.spaces import Bools, Floats, Ints
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table, TablePath


def select_constraints(
    table: Table,
    paths: Iterable[TablePath],
    least: float = 0.1,
    *,
    most: int | None = None,
    steps: int | None = None,
    prune: bool = False,
    width: int = 1,
) -> Selection:
    """Add one hypothesis of a table after the other, as long as each explains enough.

    Args:
        table: a world whose moves are certain, with hypotheses.
        paths: what demonstrators did, from a start to a goal.
        least: d_KL; a hypothesis that lowers KL by no more is not added [nat].
        most: how many to add at most; by default as many as there are.
        steps: the horizon of `mlci.worlds.fixed_horizon`; None takes trajectories of any length,
            those of `mlci.worlds.first_exit`. A horizon is faster where there are many hypotheses.
        prune: drop in the end those without which KL would rise by no more than `least`, given all
            others: what was added early may be explained by what came later.
        width: how many sets of each size a beam keeps; 1 is greedy.

    Raises:
        ValueError: no paths, a path that does not run from a start to its first goal by moves of
            the table, or within the horizon; or a sum over trajectories that diverges.
    """
    paths = list(paths)
    starts = _starts(table, paths, steps)
    feasible = ~np.any([table.crossed_by(path) for path in paths], axis=0)

    def mean_log_z(mask: Bools) -> float:
        constrained = table.under(mask)
        if steps is not None:
            return float(np.mean(FixedHorizon(constrained, steps).log_z[0, starts]))
        return float(np.mean(FirstExit(constrained).log_z[starts]))

    def decreases(mask: Bools, candidates: Ints) -> Floats:
        different, places = np.unique(starts, return_inverse=True)
        if steps is None:
            log_alpha = FirstExit(table.under(mask)).log_avoidance(different, candidates)
        else:
            distribution = FixedHorizon(table.under(mask), steps)
            alpha = [distribution.avoidance_probabilities(start) for start in different.tolist()]
            log_alpha = np.log(np.array(alpha)[:, candidates])
        return np.asarray(-np.mean(log_alpha[places], axis=0))

    added, decrease, following = search(decreases, feasible, least, most, width)
    if prune:
        added, decrease = without_needless(decreases, added, len(feasible), least)
    kl = _divergence(table, paths) + mean_log_z(np.zeros(len(feasible), dtype=bool))
    return Selection(tuple(table.regions), added, decrease, following, kl)


def select_regions(
    evidence: SetEvidence,
    names: Sequence[str],
    least: float = 0.1,
    *,
    prior: SetPrior | None = None,
    most: int | None = None,
    prune: bool = False,
    width: int = 1,
) -> Selection:
    """Add one region of a tabular model after the other, as long as each explains enough.

    Args:
        evidence: of the demonstrations, for sets of the regions.
        names: (C,) of the regions.
        least: as of `select_constraints`.
        prior: adds to what a region explains the log odds of the set with it against that without
            it, a share of each demonstration; so that `least=0` stops where the posterior of the
            set would fall. None adds nothing.
        most: as of `select_constraints`.
        prune: likewise.
        width: likewise.

    Raises:
        ValueError: no demonstrations.
    """
    count = len(evidence.avoidance)
    if not count:
        raise ValueError("regions are selected by demonstrations, and there are none")
    if len(names) != evidence.violated.shape[1]:
        raise ValueError(f"{len(names)} names do not fit {evidence.violated.shape[1]} regions")

    def decreases(mask: Bools, candidates: Ints) -> Floats:
        gain = evidence.beside(mask)[candidates]
        now = evidence.gain(mask)
        if prior is not None:
            gain, now = gain + prior.log_beside(mask)[candidates], now + prior.log(mask)
        with np.errstate(invalid="ignore"):  # what is certain already is not made more so
            return np.where(gain == now, 0.0, gain - now) / count

    added, decrease, following = search(decreases, evidence.feasible, least, most, width)
    if prune:
        added, decrease = without_needless(decreases, added, evidence.regions, least)
    return Selection(tuple(names), added, decrease, following)


def _starts(table: Table, paths: Sequence[TablePath], steps: int | None) -> Ints:
    """(N,) the first states of some paths, all of which do what a table's trajectories do."""
    if not paths:
        raise ValueError("constraints are selected by paths, and there are none")
    for path in paths:
        table.moves_of(path)
        if not table.start[path.states[0]] > 0:
            raise ValueError(f"{path.title} starts in {path.states[0]}, where the table does not")
        moves = len(path.actions)
        if steps is not None and (moves > steps or (moves < steps and not len(table.goals))):
            raise ValueError(f"{path.title} has {moves} moves, the horizon {steps}")
        if path.states[-1] not in table.goals and (steps is None or len(table.goals)):
            raise ValueError(
                f"{path.title} ends in {path.states[-1]}, which is none of the goals "
                f"{table.goals.tolist()}"
            )
    return np.array([path.states[0] for path in paths])


def _divergence(table: Table, paths: Sequence[TablePath]) -> float:
    """-H(paths) - mean reward [nat]: what of KL no constraint changes."""
    counts = Counter((path.states[0], *path.actions) for path in paths)
    share = np.array(list(counts.values())) / len(paths)
    rewards = [np.sum(table.reward.ravel()[table.moves_of(path)]) for path in paths]
    return float(np.sum(share * np.log(share)) - np.mean(rewards))
