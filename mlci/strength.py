"""A system with stronger or weaker controls."""

from __future__ import annotations

from dataclasses import dataclass

from mlci.spaces import Box
from mlci.wrapped import Wrapped


@dataclass(frozen=True, eq=False)
class WithStrength(Wrapped):
    """A system that moves as another does, and whose control ranges are so many times as wide.

    Attributes:
        system: the other one.
        factor: by which the ends of its control ranges are multiplied.

    Raises:
        ValueError: a factor that is not positive.
    """

    factor: float

    def __post_init__(self) -> None:
        if not self.factor > 0:
            raise ValueError(f"a strength must be positive, not {self.factor}")

    @property
    def control_box(self) -> Box:
        box = self.system.control_box
        return Box(self.factor * box.lower, self.factor * box.upper)
