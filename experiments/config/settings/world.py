"""Inference in a finite world that is given as files: the world's own file, and the command."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from experiments.config.settings.kinds import (
    LIST,
    ONE,
    STRICT,
    Count,
    NotNegative,
    Number,
    PathWord,
    Positive,
    Probability,
    Share,
    Word,
    about,
    one_or_list,
    read_number,
)
from experiments.config.settings.study import RESULTS


def _name(value: Any) -> Any:
    """A name of a state, an action or a hypothesis, as text; a whole number is one too."""
    text = str(value) if type(value) is int else value
    if not isinstance(text, str) or not text.strip() or not text.isprintable():
        words = f"{value!r:.60} is no name; write a word or a whole number"
        raise PydanticCustomError("problem", "{words}", {"words": words})
    return text


Name = Annotated[str, BeforeValidator(_name)]
Names = tuple[Name, ...]
Discount = Annotated[float, Field(gt=0, le=1), BeforeValidator(read_number)]
Start = Annotated[
    Annotated[Name, Tag(ONE)] | Annotated[dict[Name, NotNegative], Tag(LIST)],
    Discriminator(lambda value: LIST if isinstance(value, Mapping) else ONE),
]


@dataclass(frozen=True, config=STRICT)
class ForbiddenSettings:
    """What a named hypothesis forbids: the moves that any of the three names."""

    states: Names = ()
    actions: Names = ()
    moves: tuple[Annotated[Names, Field(min_length=2, max_length=2)], ...] = ()


@dataclass(frozen=True, config=STRICT)
class WorldHypothesesSettings:
    """Hypotheses about a finite world: each of its parts, then named ones."""

    each: tuple[Literal["states", "actions", "moves"], ...] = ("states", "actions")
    sets: dict[Name, ForbiddenSettings] = Field(default_factory=dict)


@dataclass(frozen=True, config=STRICT)
class WorldSettings:
    """The file of a world."""

    moves: Annotated[PathWord, Field(min_length=1)]
    start: Start
    goals: one_or_list(Name, Names) = ()  # type: ignore[valid-type]
    states: one_or_list(Count, Names) = ()  # type: ignore[valid-type]
    actions: one_or_list(Count, Names) = ()  # type: ignore[valid-type]
    reward: Number | None = None
    temperature: Positive = 1.0
    horizon: Count | None = None
    discount: Discount = 1.0
    hypotheses: WorldHypothesesSettings = Field(default_factory=WorldHypothesesSettings)

    @property
    def goal_names(self) -> tuple[str, ...]:
        """The goals as a list."""
        return (self.goals,) if isinstance(self.goals, str) else tuple(self.goals)


@dataclass(frozen=True, config=STRICT)
class TableRatesSettings:
    """What is believed before any path, and how much each of them says."""

    prior: Annotated[Probability, about("probability that there is no constraint at all")]
    model_error: Annotated[
        Share, about("share of demonstrations that say nothing by what they avoid")
    ]
    rule_breaking: Annotated[Share, about("share of demonstrations that ignore the constraint")]


@dataclass(frozen=True, config=STRICT)
class TableSettings:
    """What experiments/infer.py takes with a world that is given as files."""

    table: Annotated[
        PathWord, about("file of a finite world: its moves, start, goals and hypotheses, in YAML")
    ]
    demonstrations: Annotated[
        one_or_list(PathWord, tuple[PathWord, ...]),  # type: ignore[valid-type]
        about("a folder, a glob pattern or a file, or a list of them"),
    ]
    least: Annotated[
        NotNegative,
        about(
            "several constraints are added until the next would lower the KL divergence of the "
            "paths by no more than this",
            "nat",
        ),
    ]
    inference: TableRatesSettings
    top: Annotated[Count, about("hypotheses that are printed")]
    results: Annotated[Word | None, RESULTS]


def names_of(value: Any) -> tuple[str, ...]:
    """Names of states or actions; a count numbers them from 0."""
    return tuple(map(str, range(value))) if isinstance(value, int) else tuple(value)
