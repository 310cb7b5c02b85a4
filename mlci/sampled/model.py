"""What sampled distributions of tasks are made of, in the place of a tabular model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import REACHED, Task
from mlci.regions import Regions, as_mask
from mlci.sampled.distribution import SEARCH, SampledDistribution, sample_passage, under_truth
from mlci.sampled.model_check import check_model
from mlci.sampled.modes import Modes, find_modes_of
from mlci.sampled.passage import Passage
from mlci.simulate import step_count
from mlci.spaces import Bools, Box
from mlci.systems import System

ROUNDED_TIMES = 1e-3  # of a time step: how far a horizon may be off, as recorded times are rounded
_AT_ONCE = 64  # tasks whose modes are looked for together


@dataclass(frozen=True, eq=False)
class SampledModel:
    """What distributions of tasks are made of: it takes the place of a `TabularModel`.

    Attributes:
        system: dynamics, running reward, state space.
        regions: the C regions.
        dt: for which a control is held [s].
        temperature: divides the reward.
        samples: paths of a task.
        seed: a task's samples depend on it and on the task only.
        substeps: Runge-Kutta steps a hold, whose chords are tested for crossings.
        restarts: first guesses of the optimiser for each winding.
        tolerance: half width of the goal in the dimensions in which it is a point.
        limit: range of the controls, such as the system's control box; None for none.
        replicates: of probabilities, from which errors of a ranking are told.
        truth: (C,) mask of the regions that no path may enter, see `under`; none by default.

    Raises:
        ValueError: a number that is not positive, or not whole where it counts something; regions
            or a limit of another dimension, a limit without width, or a truth of other regions.
    """

    system: System
    regions: Regions
    dt: float
    temperature: float = 1.0
    samples: int = 4000
    seed: int = 0
    substeps: int = 4
    restarts: int = 6
    tolerance: float = REACHED
    limit: Box | None = None
    replicates: int = 200
    truth: Bools = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def __post_init__(self) -> None:
        if not np.any(self.truth):  # of these regions, or of others that they replace
            object.__setattr__(self, "truth", np.zeros(len(self.regions), dtype=bool))
        as_mask(self.truth, len(self.regions))
        check_model(self)

    def under(self, truth: ArrayLike) -> SampledModel:
        """The model under constraints, equation (3): paths that enter the truth weigh 0.

        Where few paths of a task keep out, ways round the truth are looked for, and paths drawn
        round these; but of a truth that knows no distance, such as a predicate without a steepness,
        paths that keep out are all that is left.

        Args:
            truth: (C,) mask over the regions, such as `model.regions.mask(["c1"])`.
        """
        mask = as_mask(truth, len(self.regions))
        return replace(self, truth=self.truth | mask)

    def passage(self, task: Task, *, round_horizon: bool = False) -> Passage:
        """The random motion of a task.

        Args:
            task: the task.
            round_horizon: take the nearest number of holds where dt does not divide the horizon.

        Raises:
            ValueError: a start outside the state space, or a horizon that dt does not divide.
        """
        steps = max(1, round(task.horizon / self.dt))
        if not round_horizon:
            steps = step_count(task.horizon, self.dt, ROUNDED_TIMES)
        point = task.goal.widths == 0
        goal = Box(
            np.where(point, task.goal.lower - self.tolerance, task.goal.lower),
            np.where(point, task.goal.upper + self.tolerance, task.goal.upper),
        )
        return Passage(
            *(self.system, task.start, goal, steps, self.dt),
            *(self.temperature, self.substeps, self.limit),
        )

    def distribution(self, task: Task, *, round_horizon: bool = False) -> SampledDistribution:
        """The distribution of a task; arguments as of `passage`."""
        return next(self.distributions([task], round_horizon=round_horizon))

    def distributions(
        self, tasks: Sequence[Task], *, round_horizon: bool = False
    ) -> Iterator[SampledDistribution]:
        """The distribution of each task, in order; modes of many tasks are looked for at once.

        Args:
            tasks: the tasks.
            round_horizon: as of `passage`, as are errors.
        """
        passages = [self.passage(task, round_horizon=round_horizon) for task in tasks]
        for first in range(0, len(tasks), _AT_ONCE):
            block = passages[first : first + _AT_ONCE]
            keys = [
                self._key(passage, task)
                for passage, task in zip(block, tasks[first : first + _AT_ONCE], strict=True)
            ]
            ways = self._modes(block, keys)
            for passage, key, modes in zip(block, keys, ways, strict=True):
                found = sample_passage(passage, self.regions, modes, self.samples, key)
                if self.truth.any():
                    found = under_truth(found, self.truth, self.samples, self.restarts)
                yield found

    def _key(self, passage: Passage, task: Task) -> tuple[int, ...]:
        """What seeds the generators of a task."""
        ends = np.concatenate([task.start, passage.goal.lower, passage.goal.upper])
        return self.seed, *np.append(ends, task.horizon).view(np.uint32).tolist()

    def _modes(self, passages: Sequence[Passage], keys: Sequence[tuple[int, ...]]) -> list[Modes]:
        """The modes of each passage; those of passages that are alike at once."""
        found, alike = dict[int, Modes](), dict[tuple[int, bytes], list[int]]()
        for i, passage in enumerate(passages):
            alike.setdefault((passage.steps, passage.half.tobytes()), []).append(i)
        for numbers in alike.values():
            rngs = [np.random.default_rng([*keys[i], SEARCH]) for i in numbers]
            modes = find_modes_of([passages[i] for i in numbers], self.restarts, rngs)
            found.update(zip(numbers, modes, strict=True))
        return [found[i] for i in range(len(passages))]
