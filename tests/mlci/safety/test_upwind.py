"""The compiled time step against the scheme node by node."""

import itertools

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.safety.upwind import euler_step, mean_derivatives, neighbour_rows
from mlci.spaces import Box, StateSpace

SHAPE = (4, 3, 5)
# Two controls move the first and the last dimension, each for itself; nothing the second.
OF_CONTROL = np.array([[0, 2, 3], [0, 2, 4], [1, 2, 3], [1, 2, 4]])
ALONG = np.array([0, 0, 1, 2, 2])


def limited(near, beyond):
    """Koren's correction of a one-sided difference, from two second differences."""
    if near * beyond <= 0:
        return 0.0
    return np.sign(near) * min(abs(near), abs(beyond), abs(2 * near + beyond) / 6)


def one_sided(values, place, d, wraps):
    """Left and right derivative of values (*shape) along d at a place, in cells."""

    def at(ahead):
        moved = list(place)
        end = values.shape[d] - 1
        moved[d] = (place[d] + ahead) % (end + 1) if wraps else np.clip(place[d] + ahead, 0, end)
        return values[tuple(moved)]

    second = [at(k - 1) - 2 * at(k) + at(k + 1) for k in (-1, 0, 1)]
    left = at(0) - at(-1) + limited(second[1], second[0])
    return left, at(1) - at(0) - limited(second[1], second[2])


@pytest.mark.parametrize("periodic", [(True, False, False), (False, False, True)])
def test_a_step_is_the_scheme_at_every_node(periodic):
    rng = np.random.default_rng(0)
    space = StateSpace(Box(np.zeros(3), np.ones(3)), periodic, ("x", "y", "z"))
    grid = Grid(space, SHAPE)
    values, rates = rng.normal(size=SHAPE), rng.normal(size=(len(ALONG), *SHAPE))
    expected, means = np.empty(SHAPE), np.empty((3, *SHAPE))
    for place in itertools.product(*map(range, SHAPE)):
        sides = [one_sided(values, place, d, periodic[d]) for d in range(3)]
        means[(slice(None), *place)] = np.mean(sides, axis=1)
        here = rates[(slice(None), *place)]
        changes = [sum(here[r] * sides[ALONG[r]][int(here[r] > 0)] for r in u) for u in OF_CONTROL]
        expected[place] = values[place] + 0.1 * min(max(changes), 0.0)
    flat, beside = values.reshape(-1, SHAPE[-1]), neighbour_rows(grid)
    stepped, derivatives = np.empty_like(flat), np.empty((3, *flat.shape))
    by_rows = rates.reshape(len(ALONG), *flat.shape)
    euler_step(flat, 0.1, by_rows, ALONG, OF_CONTROL, beside, periodic[-1], stepped)
    mean_derivatives(flat, beside, periodic[-1], derivatives)
    assert np.mean(expected < values) > 0.1
    np.testing.assert_allclose(stepped.reshape(SHAPE), expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(derivatives.reshape(means.shape), means, rtol=1e-13, atol=1e-14)
