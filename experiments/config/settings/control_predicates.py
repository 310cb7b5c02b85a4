"""Functions of states and controls of one's own, as hypotheses about what is applied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, Word, about
from experiments.config.settings.targets import (
    arguments_of,
    named,
    problem,
    target_error,
    target_of,
)
from mlci.actuation.predicates import PairFunction


@dataclass(frozen=True, config=STRICT)
class PredicateSettings:
    """A function of states and controls: what a function of one's own makes of its arguments."""

    target: Annotated[Word, about("dotted name of what returns a function of states and controls")]
    arguments: Annotated[Mapping[str, Any], about("what it takes")]

    @property
    def name(self) -> str:
        """The last part of the dotted name, with the arguments."""
        words = ", ".join(f"{key}={value}" for key, value in self.arguments.items())
        return self.target.rpartition(".")[2] + (f" ({words})" if words else "")

    def function(self) -> PairFunction:
        """The function itself."""
        made: PairFunction = named(self.target)(**self.arguments)
        return made


def read_predicate(tree: Any) -> PredicateSettings:
    """A predicate from `_target_` and the arguments beside it.

    Raises:
        ValidationError: an argument that it does not take, lacks, or takes otherwise.
        PydanticCustomError: nothing that makes a function.
    """
    if isinstance(tree, PredicateSettings):
        return tree
    example = "a function that returns one of states and controls, such as your_module.hard_push"
    target = target_of(tree, example)
    try:
        maker = named(target)
    except ValueError as error:
        raise target_error(target, str(error)) from None
    if not callable(maker):
        raise target_error(target, f"{target!r} is no function")
    settings = PredicateSettings(target, arguments_of(maker, target, tree))
    try:
        function = settings.function()
    except Exception as error:  # it may be anybody's function
        raise problem(f"{target} fails: {type(error).__name__}: {error}") from None
    if not callable(function):
        raise problem(
            f"{target} must return a function of states (..., n) and controls (..., m), not "
            f"{type(function).__name__}"
        )
    return settings
