"""Who is reached, fixed points and spectral radii, against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from mlci.flows import fixed_point, reached, spectral_radius


def test_reached_follows_edges_in_their_direction() -> None:
    begin, end = np.array([0, 1, 3, 4]), np.array([1, 2, 0, 3])
    assert np.flatnonzero(reached(np.array([0]), begin, end, 5)).tolist() == [0, 1, 2]
    assert np.flatnonzero(reached(np.array([4]), begin, end, 5)).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("seed", range(10))
def test_each_number_of_a_fixed_point_keeps_its_digits(seed: int) -> None:
    """In other units the numbers lie up to 1e120 apart, and are the same but for the units."""
    rng = np.random.default_rng(seed)
    flow, source = rng.random((6, 6)) / 8, rng.random(6)
    units = 10.0 ** rng.integers(-60, 60, size=6)
    x = fixed_point(sparse.csr_matrix(flow * units[:, None] / units), source * units)
    np.testing.assert_allclose(x / units, np.linalg.solve(np.eye(6) - flow, source), rtol=1e-12)


def test_a_singular_system_has_no_fixed_point() -> None:
    assert np.isnan(fixed_point(sparse.csr_matrix([[1.0]]), np.ones(1))).all()
    assert fixed_point(sparse.csr_matrix((0, 0)), np.empty(0)).shape == (0,)


@pytest.mark.parametrize("flow", [[[0.5, 0.2], [0.1, 0.9]], [[0.0, 2.0], [1.0, 0.0]]])
def test_spectral_radius_is_that_of_dense_algebra(flow: list[list[float]]) -> None:
    expected = np.max(np.abs(np.linalg.eigvals(flow)))
    assert spectral_radius(sparse.csr_matrix(flow)) == pytest.approx(expected, rel=1e-6)
