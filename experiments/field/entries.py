"""What worlds and methods are: the two things that a contest is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlci.rivals.problem import Problem
from mlci.spaces import Bools, Floats


@dataclass(frozen=True, eq=False)
class Case:
    """A world with demonstrations, and what is true in it.

    Attributes:
        problem: what methods see.
        cover: (C,) share of each hypothesis that lies inside the truth.
        forbidden: (S * A,) moves of the table that enter the truth.
        dropped: demonstrations that were made and are not shown, since they failed.
    """

    problem: Problem
    cover: Floats
    forbidden: Bools
    dropped: int = 0

    @property
    def truth(self) -> Bools:
        """(C,) hypotheses that are true: those of which most is inside the truth."""
        return self.cover > 0.5


@dataclass(frozen=True)
class World:
    """A world of the benchmark.

    Attributes:
        make: from a seed and a number of demonstrations, a case.
        demonstrations: how many are shown by default.
        source: where it was described.
        setting: horizon, temperature, discount, and what a hard constraint means.
        differs: what differs from the published setting.
    """

    make: Callable[[int, int], Case]
    demonstrations: int
    source: str
    setting: str
    differs: str


@dataclass(frozen=True, eq=False)
class Answer:
    """What a method says of C hypotheses.

    Attributes:
        scores: (C,) the larger, the sooner a hypothesis is forbidden; -inf for what is excluded.
        chosen: (C,) mask of those that it takes to be forbidden; None where it only scores, so that
            the first ones are taken, as many as are true.
        probability: (C,) that each is forbidden; None where it has none.
        claimed: probability that its first hypothesis is forbidden; None takes it from the others.
    """

    scores: Floats
    chosen: Bools | None = None
    probability: Floats | None = None
    claimed: float | None = None


@dataclass(frozen=True)
class Method:
    """A method of the benchmark.

    Attributes:
        answer: from a problem and a generator of random numbers, an answer.
        source: where it was described.
        differs: what differs from what was published.
    """

    answer: Callable[[Problem, np.random.Generator], Answer]
    source: str
    differs: str = "nothing"
