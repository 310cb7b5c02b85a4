"""What worlds and methods are: the two things that a contest is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlci.rivals.problem import Problem
from mlci.spaces import Bools, Floats


class EntryError(ValueError):
    """A world or a method that is not as it must be; the message says which, and in what."""


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


def check_answer(answer: object, regions: int) -> None:
    """Whether an answer says of each hypothesis what it must.

    Raises:
        EntryError: something else, arrays of other shapes, or NaN.
    """
    if not isinstance(answer, Answer):
        raise EntryError(f"it must return an Answer, not a {type(answer).__name__}")
    for name in ("scores", "chosen", "probability"):
        found = getattr(answer, name)
        if found is None and name != "scores":
            continue
        array = np.asarray(found)
        kinds, meant = ("b", "truth values") if name == "chosen" else ("bif", "numbers")
        if array.shape != (regions,) or array.dtype.kind not in kinds:
            raise EntryError(
                f"its {name} must be {meant}, one of each of {regions} hypotheses, not "
                f"{array.dtype} of shape {array.shape}"
            )
        if np.isnan(array).any():
            raise EntryError(f"its {name} are NaN for hypothesis {int(np.argmax(np.isnan(array)))}")
    outside = answer.probability is not None and not np.all(
        (np.asarray(answer.probability) >= -1e-9) & (np.asarray(answer.probability) <= 1 + 1e-9)
    )
    if outside or not 0 <= (0 if answer.claimed is None else answer.claimed) <= 1 + 1e-9:
        raise EntryError("its probabilities must lie between 0 and 1")
