"""Inference online: demonstrations of tasks that were known before anybody moved.

All that takes time depends on the tasks alone: the starts, the goals and the number of steps. So
it can be done beforehand, as section IV-C says, and what is left when the demonstrations arrive
is to see which hypotheses they violate, and to rank the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mlci.inference import Ranking, rank_constraints
from mlci.maxent import expected_violations
from mlci.regions import ConstraintSet
from mlci.spaces import Bools, Floats
from mlci.tabular import Progress, TabularMDP


@dataclass(frozen=True, eq=False)
class PreparedInference:
    """What the ranking needs of N known tasks; made by `prepare`.

    Attributes:
        hypotheses: the C hypotheses.
        phi: (N, C) violation probabilities of each task without a constraint; 0 for one that the
            tabular MDP cannot do, whose demonstrations refute hypotheses, and support none.
        reachable: (N,) whether it can.

    Raises:
        ValueError: shapes that disagree.
    """

    hypotheses: ConstraintSet
    phi: Floats
    reachable: Bools

    def __post_init__(self) -> None:
        tasks, regions = len(self.reachable), len(self.hypotheses)
        if self.phi.shape != (tasks, regions):
            raise ValueError(
                f"phi {self.phi.shape} does not fit {tasks} tasks and {regions} hypotheses"
            )

    def rank(
        self,
        paths: Sequence[ArrayLike],
        tasks: Sequence[int] | None = None,
        prior_none: float = 0.5,
    ) -> Ranking:
        """Rank the hypotheses by the demonstrations that have arrived, equations (4) to (6).

        Args:
            paths: recorded states (K+1, n) of each demonstration.
            tasks: the task of each, any number of demonstrations a task; by default each task
                has been shown once, in order.
            prior_none: prior probability that there is no constraint.

        Raises:
            ValueError: a task that is not known, or not one task for each path.
        """
        shown = np.arange(len(self.phi)) if tasks is None else np.asarray(tasks, dtype=np.int64)
        if shown.shape != (len(paths),):
            raise ValueError(f"{len(paths)} paths need as many tasks, not {shown.tolist()}")
        if np.any((shown < 0) | (shown >= len(self.phi))):
            raise ValueError(f"tasks are numbered 0 to {len(self.phi) - 1}, not {shown.tolist()}")
        violated = np.zeros((len(paths), len(self.hypotheses)), dtype=bool)
        if len({np.shape(path) for path in paths}) == 1:  # all at once is quicker
            violated[:] = self.hypotheses.violated_by(np.stack(paths))
        else:
            for row, path in zip(violated, paths, strict=True):
                row[:] = self.hypotheses.violated_by(path)
        return rank_constraints(self.phi[shown], violated, prior_none)


def prepare(
    mdp: TabularMDP,
    hypotheses: ConstraintSet,
    starts: Sequence[int],
    goals: Sequence[ArrayLike],
    steps: Sequence[int],
    progress: Progress | None = None,
) -> PreparedInference:
    """Do beforehand whatever of the inference depends on the tasks alone.

    Args:
        mdp: made with these hypotheses.
        hypotheses: the regions.
        starts: N start cells.
        goals: N goals, each a cell or several.
        steps: N numbers of transitions.
        progress: is told how many tasks are done, and of how many.

    Raises:
        ValueError: an MDP that was made with another number of regions.
    """
    if mdp.crosses.shape[1] != len(hypotheses):
        raise ValueError(
            f"the MDP was made with {mdp.crosses.shape[1]} regions, not these {len(hypotheses)}"
        )
    return PreparedInference(hypotheses, *expected_violations(mdp, starts, goals, steps, progress))
