"""Several constraints of a table, one after the other: the greedy selection of Scobee and Sastry.

The more a set of constraints explains, the closer its distribution is to that of the N paths:

    KL = -H(paths) - mean reward + mean log Z(start),

where H is the entropy of the paths as they were counted, and Z that under the constraints. Each
step adds the hypothesis that no path uses and that lowers KL most, given those added before; it
stops where the best of the rest would lower KL by no more than a threshold.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mlci.first_exit import FirstExit
from mlci.fixed_horizon import FixedHorizon
from mlci.spaces import Bools, Floats, Ints
from mlci.tables import Table, TablePath

if TYPE_CHECKING:
    import pandas as pd

_TIE = 1e-9  # nat: decreases closer than this are equal, and the first hypothesis is taken


@dataclass(frozen=True, eq=False)
class Selection:
    """Constraints in the order in which they were added.

    Attributes:
        names: (C,) names of the hypotheses.
        added: (K,) those added, in order.
        kl: (K+1,) divergence of the paths from the distribution: without constraints, and after
            each [nat].
        next_decrease: by how much the best of the rest would have lowered it, where nothing more
            was added [nat]; 0 where none was left.
    """

    names: tuple[str, ...]
    added: Ints
    kl: Floats
    next_decrease: float

    @property
    def mask(self) -> Bools:
        """(C,) the hypotheses that were added, as `under` takes them."""
        return np.isin(np.arange(len(self.names)), self.added)

    def to_frame(self) -> pd.DataFrame:
        """A row for each constraint in order: `hypothesis`, `decrease` of KL, and `kl` after it."""
        import pandas as pd

        return pd.DataFrame(
            {
                "hypothesis": [self.names[i] for i in self.added],
                "decrease": -np.diff(self.kl),
                "kl": self.kl[1:],
            }
        )


def select_constraints(
    table: Table,
    paths: Iterable[TablePath],
    least: float = 0.1,
    *,
    most: int | None = None,
    steps: int | None = None,
    prune: bool = False,
) -> Selection:
    """Add one hypothesis of a table after the other, as long as each explains enough.

    Args:
        table: a world whose moves are certain, with hypotheses.
        paths: what demonstrators did, from a start to a goal.
        least: d_KL; a hypothesis that lowers KL by no more is not added [nat].
        most: how many to add at most; by default as many as there are.
        steps: the horizon of `mlci.fixed_horizon`; None takes trajectories of any length, those of
            `mlci.first_exit`. A horizon is faster where there are many hypotheses.
        prune: drop in the end those without which KL would rise by no more than `least`, given all
            others: what was added early may be explained by what came later.

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
        if steps is not None:
            distribution = FixedHorizon(table.under(mask), steps)
            alpha = [distribution.avoidance_probabilities(start) for start in starts.tolist()]
            return np.asarray(-np.mean(np.log(np.array(alpha)[:, candidates]), axis=0))
        now, each = mean_log_z(mask), np.eye(len(mask), dtype=bool)[candidates]
        return np.array([now - mean_log_z(mask | one) for one in each])

    added, decrease, following = greedy(decreases, feasible, least, most)
    if prune:
        added, decrease = without_needless(decreases, added, len(feasible), least)
    kl = _divergence(table, paths) + mean_log_z(np.zeros(len(feasible), dtype=bool))
    return Selection(
        tuple(table.regions), added, kl - np.cumsum(np.append(0.0, decrease)), following
    )


def greedy(
    decreases: Callable[[Bools, Ints], Floats], feasible: Bools, least: float, most: int | None
) -> tuple[Ints, Floats, float]:
    """Add the hypothesis with the largest decrease, again and again.

    Args:
        decreases: by how much (L,) each of some candidates (L,) lowers what is to be lowered, given
            a mask (C,) of those added.
        feasible: (C,) the hypotheses that may be added.
        least: the decrease below or at which it stops.
        most: how many to add at most; None adds as many as there are.

    Returns:
        Those added (K,) in order, their decreases (K,), and the decrease of the next.
    """
    mask = np.zeros(len(feasible), dtype=bool)
    added: list[int] = []
    steps: list[float] = []
    while len(candidates := np.flatnonzero(feasible & ~mask)):
        decrease = decreases(mask, candidates)
        best = int(np.argmax(decrease > np.max(decrease) - _TIE))
        if decrease[best] <= least or len(added) == most:
            return np.array(added, dtype=np.int64), np.array(steps), float(decrease[best])
        mask[candidates[best]] = True
        added.append(int(candidates[best]))
        steps.append(float(decrease[best]))
    return np.array(added, dtype=np.int64), np.array(steps), 0.0


def without_needless(
    decreases: Callable[[Bools, Ints], Floats], added: Ints, hypotheses: int, least: float
) -> tuple[Ints, Floats]:
    """Drop one after the other of what was added, as long as it costs no more than `least`.

    Args:
        decreases: as of `greedy`.
        added: (K,) numbers of hypotheses.
        hypotheses: C.
        least: the rise above which a hypothesis is kept.

    Returns:
        Those kept (K',) in their order, and the decrease (K',) that each brings after those before.
    """

    def decrease(others: list[int], candidate: int) -> float:
        mask = np.isin(np.arange(hypotheses), others)
        return float(decreases(mask, np.array([candidate]))[0])

    kept = added.tolist()
    while kept:
        rises = [decrease([other for other in kept if other != i], i) for i in kept]
        if min(rises) > least:
            break
        del kept[int(np.argmin(rises))]
    steps = [decrease(kept[:k], kept[k]) for k in range(len(kept))]
    return np.array(kept, dtype=np.int64), np.array(steps)


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
