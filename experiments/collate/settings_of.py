"""The settings of a point, read back from its config."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from experiments.config.schema import Problems, parse
from experiments.config.settings import Settings

if TYPE_CHECKING:
    from experiments.tracking.points import Point


@cache
def settings_of(point: Point) -> Settings:
    """The settings of a point, read back from its config."""
    settings: Settings = parse(Settings, point.config, "", Problems())
    return settings
