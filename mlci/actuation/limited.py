"""A system whose controls are limited: what its own safe set and filter must know of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.spaces import Box
from mlci.wrapped import Wrapped


@dataclass(frozen=True, eq=False)
class Limited(Wrapped):
    """A system that moves as another does, with a control range no wider than a limit.

    Attributes:
        system: the other one.
        limit: of the controls; infinite where there is none.

    Raises:
        ValueError: a limit that leaves nothing of the control range.
    """

    limit: Box

    def __post_init__(self) -> None:
        box, limit = self.system.control_box, self.limit
        if limit.dimension != box.dimension or np.any(
            np.maximum(limit.lower, box.lower) > np.minimum(limit.upper, box.upper)
        ):
            raise ValueError(
                f"a limit from {limit.lower.tolist()} to {limit.upper.tolist()} leaves nothing of "
                f"the controls from {box.lower.tolist()} to {box.upper.tolist()}"
            )

    @property
    def control_box(self) -> Box:
        box = self.system.control_box
        return Box(np.maximum(box.lower, self.limit.lower), np.minimum(box.upper, self.limit.upper))
