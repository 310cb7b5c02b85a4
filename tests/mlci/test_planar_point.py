"""The point in a plane moves as it is told."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.planar_point import PlanarPoint
from mlci.simulate import rollout
from mlci.system_check import check_affine, check_system


def test_it_keeps_the_promises_of_a_system() -> None:
    system = PlanarPoint()
    check_system(system)
    check_affine(system)


def test_it_goes_straight_at_the_speed_it_is_told() -> None:
    path = rollout(PlanarPoint(), [1.0, -2.0], [[0.5, 1.5]] * 20, 0.1)
    np.testing.assert_allclose(path[-1], [2.0, 1.0], atol=1e-12)


def test_a_bound_that_is_not_positive_is_refused() -> None:
    with pytest.raises(ValueError, match=r"PlanarPoint.speed_limit must be positive, not 0"):
        PlanarPoint(speed_limit=0)
