"""Functions of states and controls of one's own, as hypotheses about what is applied."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, Word, about
from experiments.config.settings.targets import FunctionSettings, read_function
from mlci.actuation.predicates import PairFunction


@dataclass(frozen=True, config=STRICT)
class PredicateSettings(FunctionSettings):
    """A function of states and controls: what a function of one's own makes of its arguments."""

    target: Annotated[Word, about("dotted name of what returns a function of states and controls")]

    @property
    def name(self) -> str:
        """The last part of the dotted name, with the arguments."""
        words = ", ".join(f"{key}={value}" for key, value in self.arguments.items())
        return self.target.rpartition(".")[2] + (f" ({words})" if words else "")

    def function(self) -> PairFunction:
        """The function itself."""
        made: PairFunction = self.made()
        return made


def read_predicate(tree: Any) -> PredicateSettings:
    """A predicate from `_target_` and the arguments beside it; errors as of `read_function`."""
    return read_function(
        PredicateSettings,
        tree,
        "a function that returns one of states and controls, such as your_module.hard_push",
        Callable,  # type: ignore[arg-type]
        "a function of states (..., n) and controls (..., m)",
    )
