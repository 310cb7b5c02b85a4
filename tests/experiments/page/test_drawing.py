"""Where the plane of a map lies on the paper."""

from __future__ import annotations

import numpy as np
from page_answers import CIRCLE

from experiments.page.drawing import Frame
from mlci.planes import Plane


def test_more_is_to_the_right_and_up() -> None:
    """The paper counts downwards, the axes upwards; the ends of the axes are those of the space."""
    ends = np.array([CIRCLE.bounds.lower, CIRCLE.bounds.upper])
    (left, bottom), (right, top) = Frame(Plane(CIRCLE, 0, 1)).place(ends)
    assert left < right
    assert top < bottom
    assert f"M{left:g} {top:g}V{bottom:g}H{right:g}V{top:g}Z" in Frame(Plane(CIRCLE, 0, 1)).axes()
