"""From a tabular model and demonstrations to ranked hypotheses, in one step or in two.

All that takes time depends on the tasks alone: starts, goals and durations. So `prepare` can do it
before anybody moves, as section IV-C says; what is left when demonstrations arrive is to see which
hypotheses they violate, and to rank the others. `infer` does both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration, Task
from mlci.evidence import Ranking, rank_constraints
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions, as_mask
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import Progress, TabularModel

_ROWS_OF_REPR, _ROWS_OF_SUMMARY = 5, 10


@dataclass(frozen=True, eq=False)
class Inference:
    """What N demonstrations say about C hypotheses.

    Attributes:
        hypotheses: the C regions.
        names: (N,) names of the demonstrations.
        phi: (N, C) probability that the task's unconstrained agent violates a hypothesis; 0 for a
            task that the tabular model cannot do, whose demonstration refutes hypotheses and
            supports none.
        violated: (N, C) which hypotheses a demonstration violates.
        reachable: (N,) whether the tabular model can do the task.
        prior_none: prior probability that there is no constraint.

    Raises:
        ValueError: shapes that disagree.
    """

    hypotheses: Regions
    names: tuple[str, ...]
    phi: Floats
    violated: Bools
    reachable: Bools
    prior_none: float = 0.5

    def __post_init__(self) -> None:
        shape = len(self.names), len(self.hypotheses)
        if not (
            self.phi.shape == self.violated.shape == shape == (*self.reachable.shape, shape[1])
        ):
            raise ValueError(
                f"{shape[0]} demonstrations and {shape[1]} hypotheses do not fit phi "
                f"{self.phi.shape}, violated {self.violated.shape}, reachable "
                f"{self.reachable.shape}"
            )

    @cached_property
    def ranking(self) -> Ranking:
        """Gain, rank and posterior of each hypothesis, equations (4) to (6)."""
        return rank_constraints(self.phi[self.reachable], self.violated, self.prior_none)

    @property
    def gain(self) -> Floats:
        """(C,) log likelihood gain [nat]; -inf for a hypothesis that a demonstration violates."""
        return self.ranking.gain

    @property
    def order(self) -> Ints:
        """(C,) hypotheses from the most likely to the least."""
        return self.ranking.order

    @property
    def posterior(self) -> Floats:
        """(C,) probability of each being the one constraint."""
        return self.ranking.posterior

    @property
    def posterior_none(self) -> float:
        """Probability that there is no constraint."""
        return self.ranking.posterior_none

    def of(self, demonstrations: ArrayLike | slice) -> Inference:
        """The inference from some of the demonstrations, by their numbers."""
        part = demonstrations if isinstance(demonstrations, slice) else np.asarray(demonstrations)
        return replace(
            self,
            names=tuple(np.array(self.names, dtype=object)[part]),
            phi=self.phi[part],
            violated=self.violated[part],
            reachable=self.reachable[part],
        )

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before believing the ranking."""
        found = []
        if lost := [name for name, can in zip(self.names, self.reachable, strict=True) if not can]:
            found.append(
                f"the tabular model cannot reach the goal of {', '.join(lost)}: evidence against "
                "what they violate, and for nothing"
            )
        if unavoidable := np.flatnonzero(self.gain == np.inf).tolist():
            names = ", ".join(self.hypotheses.names[i] for i in unavoidable)
            found.append(f"some tabular agent cannot avoid {names}: their gain is infinite")
        return found

    def to_frame(self) -> pd.DataFrame:
        """A row a hypothesis, the most likely first: its bounds with units, and what is inferred.

        Returns:
            `hypothesis`, its name; for each dimension that some hypothesis bounds, `<name> from
            [unit]` and `<name> to [unit]`; `rank`, `gain` [nat], `posterior`, and `violated_by`,
            the number of demonstrations.
        """
        space, columns = self.hypotheses.space, {"hypothesis": np.array(self.hypotheses.names)}
        for d, (name, unit) in enumerate(zip(space.names, space.units, strict=True)):
            lower, upper = self.hypotheses.lower[:, d], self.hypotheses.upper[:, d]
            if np.any(np.isfinite(lower)):
                in_unit = f" [{unit}]" if unit else ""
                columns |= {f"{name} from{in_unit}": lower, f"{name} to{in_unit}": upper}
        columns |= {
            "rank": self.ranking.rank,
            "gain": self.gain,
            "posterior": self.posterior,
            "violated_by": np.sum(self.violated, axis=0),
        }
        return pd.DataFrame(columns).iloc[self.order].reset_index(drop=True)

    def summary(self, rows: int = _ROWS_OF_SUMMARY) -> str:
        """What was inferred, in a few lines: the most likely hypotheses, and warnings."""
        table = self.to_frame().head(rows).to_string(index=False, float_format="{:.3g}".format)
        return "\n".join(
            [
                f"{len(self.names)} demonstrations, {len(self.hypotheses)} hypotheses; probability "
                f"of no constraint {self.posterior_none:.3g}",
                table,
                *(f"warning: {warning}" for warning in self.warnings),
            ]
        )

    def __repr__(self) -> str:
        return self.summary(_ROWS_OF_REPR)


@dataclass(frozen=True, eq=False)
class PreparedInference:
    """What the ranking needs of N tasks that are known before anybody moves; made by `prepare`.

    Attributes:
        tasks: the N tasks.
        hypotheses: the C hypotheses.
        phi: (N, C) violation probabilities without a constraint; 0 where not reachable.
        reachable: (N,) whether the tabular model can do the task.

    Raises:
        ValueError: shapes that disagree.
    """

    tasks: tuple[Task, ...]
    hypotheses: Regions
    phi: Floats
    reachable: Bools

    def __post_init__(self) -> None:
        shape = len(self.tasks), len(self.hypotheses)
        if self.phi.shape != shape or self.reachable.shape != shape[:1]:
            raise ValueError(
                f"phi {self.phi.shape} and reachable {self.reachable.shape} do not fit {shape[0]} "
                f"tasks and {shape[1]} hypotheses"
            )

    def infer(
        self,
        paths: Sequence[ArrayLike],
        tasks: Sequence[int] | None = None,
        *,
        names: Sequence[str] = (),
        prior_none: float = 0.5,
    ) -> Inference:
        """Rank the hypotheses by the demonstrations that have arrived, equations (4) to (6).

        Args:
            paths: states (K+1, n) of each demonstration.
            tasks: the number of each demonstration's task, in any order and as often as it was
                done; by default each task was done once, in order.
            names: of the demonstrations; their numbers by default.
            prior_none: prior probability that there is no constraint.

        Raises:
            ValueError: a task that is not known, or not one task and name for each path.
        """
        numbers = np.arange(len(self.tasks)) if tasks is None else np.asarray(tasks, dtype=np.int64)
        labels = tuple(names) or tuple(map(str, range(len(paths))))
        if numbers.shape != (len(paths),) or len(labels) != len(paths):
            raise ValueError(
                f"{len(paths)} paths need as many tasks and names, not {numbers.tolist()} and "
                f"{list(labels)}"
            )
        if np.any((numbers < 0) | (numbers >= len(self.tasks))):
            raise ValueError(
                f"tasks are numbered 0 to {len(self.tasks) - 1}, not {numbers.tolist()}"
            )
        return Inference(
            self.hypotheses,
            labels,
            self.phi[numbers],
            _violations(self.hypotheses, paths),
            self.reachable[numbers],
            prior_none,
        )


def infer(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    *,
    hypotheses: ArrayLike | None = None,
    prior_none: float = 0.5,
    round_horizon: bool = False,
    n_jobs: int = 1,
    progress: Progress | None = None,
) -> Inference:
    """Rank hypotheses by demonstrations, equations (4) to (6).

    Args:
        model: the tabular model.
        demonstrations: N demonstrations, each with a task of its own.
        hypotheses: (C,) mask over the model's regions; None takes all.
        prior_none: prior probability that there is no constraint.
        round_horizon: take the nearest number of time steps where dt does not divide a duration.
        n_jobs: tasks that are worked on at once; -1 is one a core. The result is the same.
        progress: called with how many tasks are done, and of how many.

    Raises:
        ValueError: a start outside the state space, a duration that dt does not divide, or a mask
            of the wrong shape.
    """
    prepared = prepare(
        model,
        [demonstration.task for demonstration in demonstrations],
        hypotheses=hypotheses,
        round_horizon=round_horizon,
        n_jobs=n_jobs,
        progress=progress,
    )
    paths = [demonstration.states for demonstration in demonstrations]
    names = [
        demonstration.name or str(number) for number, demonstration in enumerate(demonstrations)
    ]
    return prepared.infer(paths, names=names, prior_none=prior_none)


def prepare(
    model: TabularModel,
    tasks: Sequence[Task],
    *,
    hypotheses: ArrayLike | None = None,
    round_horizon: bool = False,
    n_jobs: int = 1,
    progress: Progress | None = None,
) -> PreparedInference:
    """Do beforehand whatever of the inference depends on the tasks alone; arguments as of `infer`.

    Raises:
        ValueError: as of `infer`.
    """
    count = len(model.regions)
    mask = np.ones(count, dtype=bool) if hypotheses is None else as_mask(hypotheses, count)
    distributions = [
        TrajectoryDistribution.of_task(model, task, round_horizon=round_horizon) for task in tasks
    ]
    phi, reachable = np.zeros((len(tasks), count)), np.zeros(len(tasks), dtype=bool)
    if tasks:
        _ = model.merged  # once for all tasks and processes
    work = Parallel(n_jobs=n_jobs, return_as="generator")(
        delayed(_violation_probabilities)(distribution) for distribution in distributions
    )
    for j, (is_possible, probabilities) in enumerate(work):
        reachable[j], phi[j] = is_possible, probabilities
        if progress is not None:
            progress(j + 1, len(tasks))
    return PreparedInference(tuple(tasks), model.regions.select(mask), phi[:, mask], reachable)


def _violation_probabilities(distribution: TrajectoryDistribution) -> tuple[bool, Floats]:
    """Whether a task can be done, and Phi (C,) of it, 0 if it cannot."""
    if distribution.is_possible:
        return True, distribution.violation_probabilities()
    return False, np.zeros(len(distribution.model.regions))


def _violations(hypotheses: Regions, paths: Sequence[ArrayLike]) -> Bools:
    """D (N, C): which hypotheses each path violates."""
    violated = np.zeros((len(paths), len(hypotheses)), dtype=bool)
    if len({np.shape(path) for path in paths}) == 1:  # all at once is quicker
        violated[:] = hypotheses.violated_by(np.stack(paths))
    else:
        for row, path in zip(violated, paths, strict=True):
            row[:] = hypotheses.violated_by(path)
    return violated
