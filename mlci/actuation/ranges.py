"""Ranges of controls: what somebody may be unable, or unwilling, to apply, such as u > 1.

A range is an open box of controls, infinite at the ends that do not count: a control on its border
is not in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mlci.actuation.hypotheses import ControlHypotheses
from mlci.spaces import Bools, Box, Floats
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class ControlRanges(ControlHypotheses):
    """C ranges of m controls; they may overlap.

    Attributes:
        lower: (C, m) lower ends, -inf where there is none.
        upper: (C, m) upper ends, +inf where there is none.
        names: (C,) name of each, all different; by default its ends in words, such as "control 1
            above 0.5"; they count from 1, as the columns of recordings do.

    Raises:
        ValueError: ends of the wrong shape, an empty range, one that is everything, or names that
            are too few, too many or not different.
    """

    lower: Floats
    upper: Floats
    names: tuple[str, ...] = ()
    uses_states: ClassVar[bool] = False

    def __post_init__(self) -> None:
        lower, upper = np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)
        if lower.ndim != 2 or lower.shape != upper.shape:
            raise ValueError(
                f"control ranges need ends of one shape (C, m), not {lower.shape} and {upper.shape}"
            )
        bad = ~np.all(lower < upper, axis=1) | np.all(np.isinf(lower) & np.isinf(upper), axis=1)
        if bad.any():
            first = int(np.argmax(bad))
            raise ValueError(
                f"control range {first} needs lower < upper and a finite end: "
                f"{lower[first].tolist()} to {upper[first].tolist()}"
            )
        names = tuple(self.names) or tuple(map(_described, lower, upper))
        if len(names) != len(lower) or len(set(names)) < len(names):
            raise ValueError(f"{len(lower)} ranges need as many different names, not {list(names)}")
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)
        object.__setattr__(self, "names", names)

    @classmethod
    def beyond(cls, system: System, shares: Sequence[float]) -> ControlRanges:
        """For each control, all above and all below each share of its range, in this order.

        Args:
            system: gives names of dimensions, and the control box.
            shares: in (0, 1): of the way from the middle of a control's range to its end.

        Raises:
            ValueError: a share outside (0, 1).
        """
        if not all(0 < share < 1 for share in shares):
            raise ValueError(f"shares of a control's range lie in (0, 1), not {list(shares)}")
        box, lower, upper = system.control_box, [], []
        middle, half = (box.lower + box.upper) / 2, box.widths / 2
        for k in range(box.dimension):
            for sign in (1.0, -1.0):
                for share in shares:
                    end = middle[k] + sign * share * half[k]
                    free = np.full((2, box.dimension), [[-np.inf], [np.inf]])
                    free[0 if sign > 0 else 1, k] = end
                    lower.append(free[0])
                    upper.append(free[1])
        m = box.dimension
        return cls(np.reshape(lower, (-1, m)), np.reshape(upper, (-1, m)))

    def check(self, system: System) -> None:
        """See `ControlHypotheses.check`: they are ranges of as many controls as it has."""
        controls = system.control_box.dimension
        if self.lower.shape[1] != controls:
            raise ValueError(
                f"ranges of {self.lower.shape[1]} controls do not fit actions of {controls}"
            )

    def holds(self, states: Floats, controls: Floats) -> Bools:
        """See `ControlHypotheses.holds`; states do not matter."""
        inside = (controls[..., None, :] > self.lower) & (controls[..., None, :] < self.upper)
        return np.asarray(np.all(inside, axis=-1))

    def left_by_all(self, box: Box) -> Box:
        """What the ranges together leave of a control box.

        Raises:
            ValueError: as of `left_of`.
        """
        for index in range(len(self)):
            apart = (self.upper[index] <= box.lower) | (self.lower[index] >= box.upper)
            if not np.any(apart):  # else an earlier one has cut off more
                box = self.left_of(box, index)
        return box

    def left_of(self, box: Box, index: int) -> Box:
        """What range `index` leaves of a control box: the limit of who keeps out of it.

        Raises:
            ValueError: what it leaves is no box, or nothing.
        """
        first = np.maximum(self.lower[index], box.lower)
        last = np.minimum(self.upper[index], box.upper)
        cut = np.flatnonzero((first > box.lower) | (last < box.upper))
        at_end = (first == box.lower) | (last == box.upper)
        if len(cut) == 1 and at_end[cut[0]] and np.all(first < last):
            return Box(
                np.where((first == box.lower) & (last < box.upper), last, box.lower),
                np.where(first > box.lower, first, box.upper),
            )
        raise ValueError(
            f"{self.names[index]} leaves no interval of each control, from {box.lower.tolist()} to "
            f"{box.upper.tolist()}: it must cut off one end of one control"
        )


def _described(lower: Floats, upper: Floats) -> str:
    """The ends of a range (m,) in words."""
    words = {
        (True, True): "from {low:.6g} to {high:.6g}",
        (True, False): "above {low:.6g}",
        (False, True): "below {high:.6g}",
    }
    ends = enumerate(zip(lower.tolist(), upper.tolist(), strict=True))
    return ", ".join(
        f"control {k + 1} " + words[finite].format(low=low, high=high)
        for k, (low, high) in ends
        if any(finite := (low > -np.inf, high < np.inf))
    )
