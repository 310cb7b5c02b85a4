"""The settings of a point, read back from its config."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from experiments.config.problems import checked
from experiments.config.settings import Settings

if TYPE_CHECKING:
    from experiments.tracking.points import Point


@cache
def settings_of(point: Point) -> Settings:
    """The settings of a point, read back from its config."""
    system = point.config["system"]
    return checked(
        Settings,
        {**point.config, "system": {"_target_": system["target"], **system["arguments"]}},
    )
