"""Which range of controls is forbidden? The inference of regions, asked of what is applied.

The tabular agent keeps out of a range if it takes none of the actions in it. What is left of the
model without these actions has the partition function Z_i, so that the probability of keeping out
is alpha_i = Z_i / Z, as for the moves that cross a region. Evidence, ranking and posterior are
equations (4) to (6), as in `mlci.evidence`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mlci.control_ranges import ControlRanges
from mlci.demonstrations import Demonstration, Task
from mlci.evidence import DEFAULT_MODEL_ERROR, Ranking, Rates, rank_constraints
from mlci.maxent import TrajectoryDistribution
from mlci.single_moves import SingleMoves
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class ControlInference:
    """What N demonstrations say about C ranges of controls.

    Attributes:
        ranges: the C ranges.
        names: (N,) of the demonstrations.
        avoidance: (N, C) alpha, probability that the unconstrained agent applies nothing in a
            range; 1 where the tabular model cannot do the task.
        applied: (N, C) which ranges a demonstration applies controls of.
        prior_none: prior probability that no range is forbidden.
        rates: model error and rule breaking.
    """

    ranges: ControlRanges
    names: tuple[str, ...]
    avoidance: Floats
    applied: Bools
    prior_none: float
    rates: Rates

    @cached_property
    def ranking(self) -> Ranking:
        """Gain, rank and posterior of each range."""
        return rank_constraints(self.avoidance, self.applied, self.prior_none, rates=self.rates)

    def to_frame(self) -> pd.DataFrame:
        """A row a range, the most likely first: `range`, its name; `rank`; `gain` [nat];
        `posterior`; and `applied_by`, the number of demonstrations."""
        import pandas as pd

        columns = {
            "range": np.array(self.ranges.names),
            "rank": self.ranking.rank,
            "gain": self.ranking.gain,
            "posterior": self.ranking.posterior,
            "applied_by": np.sum(self.applied, axis=0),
        }
        return pd.DataFrame(columns).iloc[self.ranking.order].reset_index(drop=True)


def infer_controls(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    ranges: ControlRanges,
    *,
    tolerance: Floats | float = 0.0,
    prior_none: float = 0.5,
    rates: Rates | None = None,
    exact_ends: bool = True,
    round_horizon: bool = False,
) -> ControlInference:
    """Rank ranges of controls by demonstrations, equations (4) to (6).

    Args:
        model: the tabular model, whose actions should lie on both sides of each range's ends.
        demonstrations: N demonstrations, each with a task of its own.
        ranges: the C ranges.
        tolerance: (m,) how far into a range a control must be to count as applied, as a mean over
            the model's time step; see `ControlRanges.applied_by`.
        prior_none: prior probability that no range is forbidden.
        rates: as of `mlci.preparation.infer`.
        exact_ends: likewise.
        round_horizon: likewise.

    Raises:
        ValueError: a range that holds no action, so that the model cannot tell, or ranges of
            another number of controls.
    """
    if ranges.lower.shape[1] != model.actions.shape[1]:
        raise ValueError(
            f"ranges of {ranges.lower.shape[1]} controls do not fit actions of "
            f"{model.actions.shape[1]}"
        )
    held = ranges.holds(model.actions)
    for i in np.flatnonzero(~np.any(held, axis=0)):
        raise ValueError(
            f"range {ranges.names[i]} holds none of the model's {len(model.actions)} actions, so "
            "that the model cannot tell: take more actions"
        )
    avoidance = control_avoidance(
        model,
        [each.task for each in demonstrations],
        held,
        exact_ends=exact_ends,
        round_horizon=round_horizon,
    )
    applied = [
        ranges.applied_by(model.system, each, min(model.dt, each.task.horizon), tolerance)
        for each in demonstrations
    ]
    return ControlInference(
        ranges,
        tuple(each.name or str(number) for number, each in enumerate(demonstrations)),
        avoidance,
        np.array(applied, dtype=bool).reshape(len(demonstrations), len(ranges)),
        prior_none,
        Rates(DEFAULT_MODEL_ERROR) if rates is None else rates,
    )


def control_avoidance(
    model: TabularModel,
    tasks: Sequence[Task],
    held: Bools,
    *,
    exact_ends: bool = True,
    round_horizon: bool = False,
) -> Floats:
    """alpha (N, C): probability of taking none of some actions; 1 where a task cannot be done.

    Args:
        model: the tabular model.
        tasks: the N tasks.
        held: (A, C) which actions each range holds.
        exact_ends: as of `infer_controls`.
        round_horizon: likewise.
    """

    def log_z(of: TabularModel) -> Floats:
        """(N,) log Z of the tasks."""
        ways = [
            TrajectoryDistribution.of_task(
                of, task, round_horizon=round_horizon, exact_ends=exact_ends
            )
            for task in tasks
        ]
        return np.array([way.log_z[0, way.start] for way in ways])

    nominal, alpha = log_z(model), np.ones((len(tasks), held.shape[1]))
    can = nominal > -np.inf
    for i, actions in enumerate(held.T):
        if np.all(actions):
            alpha[can, i] = 0.0
        elif np.any(actions):
            alpha[can, i] = np.exp(
                np.minimum(log_z(without(model, actions))[can] - nominal[can], 0)
            )
    return alpha


def without(model: TabularModel, actions: Bools) -> TabularModel:
    """The model without some actions, a mask (A,); the others move as before."""
    kept = model.kept
    if kept is not None:
        moves: Ints = np.flatnonzero(~actions[model.action])
        rows = (np.arange(model.states)[:, None] * model.moves + moves).ravel()
        kept = SingleMoves(kept.successor[:, moves], kept.reward[:, moves], kept.crosses[rows])
    smaller = replace(model, actions=model.actions[~actions], kept=kept)
    vars(smaller)["substeps"] = model.substeps
    return smaller
