"""Who is reached, fixed points and spectral radii, against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from mlci.worlds.flows import fixed_point, reached, spectral_radius


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


def ring(states: int, rate: float) -> sparse.csr_matrix:
    """A flow from each state to the next."""
    ahead = np.roll(np.arange(states), 1)
    return sparse.csr_matrix((np.full(states, rate), (np.arange(states), ahead)))


def test_a_large_system_that_diverges_is_not_taken_for_its_first_terms() -> None:
    found = fixed_point(ring(1100, 1.2), np.ones(1100))
    assert not np.all(found > 0)


@pytest.mark.parametrize("kind", ["random", "ring", "slow"])
def test_large_systems_against_dense_algebra(kind: str) -> None:
    """Where the series converges, also in turns of many states, and where it does so too late."""
    states, rng = 1100, np.random.default_rng(0)
    if kind == "random":
        cell = rng.integers(0, states, size=(2, 4 * states))
        flow = sparse.csr_matrix((rng.random(4 * states) / 12, cell), shape=(states, states))
    else:
        flow = ring(states, 0.5 if kind == "ring" else 0.9999)
    source = np.where(np.arange(states) % 50 < 5, rng.random(states), 0.0)
    expected = np.linalg.solve(np.eye(states) - flow.toarray(), source)
    found = fixed_point(flow, source)
    at = np.flatnonzero(np.abs(expected) > 1e-200)
    np.testing.assert_allclose(found[at], expected[at], rtol=1e-10)
