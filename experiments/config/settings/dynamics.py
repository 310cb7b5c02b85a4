"""Which numbers that are known before inference go with its success: what is asked of a point."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import STRICT, CountOrNone, about


@dataclass(frozen=True, config=STRICT)
class DynamicsSettings:
    """What is known before anybody demonstrates, beside what came of inference."""

    tasks: Annotated[
        CountOrNone,
        about(
            "tasks, drawn apart from the demonstrations', whose optimal paths tell what is known "
            "before inference; 0 asks nothing"
        ),
    ]
