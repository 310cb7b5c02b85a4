"""How real demonstrators differ from what inference takes them for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import ValidationError, ValidationInfo
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError

from experiments.config.settings.kinds import STRICT, Count, NotNegative, about
from experiments.config.settings.system import SystemSettings, read_system


@dataclass(frozen=True, config=STRICT)
class RealitySettings:
    """Real demonstrators; the tabular model and all inference know nothing of it."""

    system: Annotated[
        Mapping[str, Any] | None,
        about("arguments of the system that are others in reality, as {length: 1.2}; null is none"),
    ]
    effort: Annotated[
        tuple[NotNegative, ...] | None,
        about(
            "price of the square of each state and each control, beside the running reward; null "
            "is none",
            "reward per squared unit",
        ),
    ]
    iterations: Annotated[
        Count | None,
        about(
            "iterations of iLQR, few for half-optimal paths; null is `demonstrations.iterations`"
        ),
    ]
    integrator: Annotated[
        Literal["euler", "rk4"] | None, about("null is `demonstrations.integrator`")
    ]
    control_noise: Annotated[
        tuple[NotNegative, ...] | None,
        about(
            "white noise on each control, which the demonstrator's feedback corrects; its standard "
            "deviation in a sample is this by the root of demonstrations.dt",
            "of the control √s",
        ),
    ]
    sensor_noise: Annotated[
        tuple[NotNegative, ...] | None,
        about("standard deviation of the noise on each recorded state", "of the state"),
    ]

    def changed(self, system: SystemSettings) -> SystemSettings:
        """A system with the arguments that it has in reality."""
        return SystemSettings(system.target, {**system.arguments, **(self.system or {})})


def read_reality(tree: Any, info: ValidationInfo) -> Any:
    """A tree whose arguments of the system are checked; those that change nothing are left out.

    Raises:
        ValidationError: an argument that the system does not take, or takes otherwise.
    """
    system = info.data.get("system")
    changes = tree.get("system") if isinstance(tree, Mapping) else None
    if not isinstance(system, SystemSettings) or not isinstance(changes, Mapping):
        return tree
    if "_target_" in changes:
        raise _at_system([(PydanticCustomError("extra_forbidden", ""), ("_target_",), changes)])
    try:
        real = read_system({"_target_": system.target, **system.arguments, **changes})
    except PydanticCustomError as error:
        raise _at_system([(error, (), dict(changes))]) from None
    except ValidationError as errors:
        raise _at_system(
            [
                (PydanticCustomError(each["type"], "", each.get("ctx")), each["loc"], each["input"])
                for each in errors.errors(include_url=False)
            ]
        ) from None
    given = {name: real.arguments[name] for name in changes}
    others = {name: value for name, value in given.items() if value != system.arguments[name]}
    return {**tree, "system": others or None}


def _at_system(errors: list[tuple[PydanticCustomError, tuple[int | str, ...], Any]]) -> Exception:
    """Errors at places below `reality.system`, each with the value at fault."""
    details = [
        InitErrorDetails(type=error, loc=("system", *place), input=value)
        for error, place, value in errors
    ]
    return ValidationError.from_exception_data("reality", details)
