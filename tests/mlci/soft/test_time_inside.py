"""Times inside regions, by dense sampling of the same motion and by hand."""

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.shapes.balls import Ball
from mlci.simulate import rollout
from mlci.soft.time_inside import move_times, path_times, time_inside
from mlci.spaces import Box
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize

POINTS = 60  # of each chord


def pendulum(samples: int = 1) -> TabularModel:
    """A pendulum with a box, a box across the seam of the angle, and a ball."""
    system = Pendulum()
    boxes = [Box([3.0, -1.0], [4.0, 2.0]), Box([5.8, -2.0], [6.8, 1.0])]
    ball = Ball([1.5, 0.5], [1.0, 1.5])
    regions = Regions.from_shapes(system.space, [*boxes, ball])
    actions = action_grid(system, 3)
    return discretize(system, Grid(system.space, (8, 9)), actions, 0.5, regions, samples)


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("region", [0, 1, 2])
def test_moves_are_inside_as_long_as_dense_points_of_their_chords_are(
    samples: int, region: int
) -> None:
    model = pendulum(samples)
    times = move_times(model, region)
    inside = model.grid.points_inside(samples)
    for move in range(model.moves):
        origin = inside[:, move % inside.shape[1]]
        action = model.actions[model.action[move]]
        path = rollout(model.system, origin, action[None, None], model.dt, model.substeps)
        share = (np.arange(POINTS) + 0.5)[:, None] / POINTS
        chords = path[:, :-1, None] + share * np.diff(path, axis=1)[:, :, None]
        middle = chords.reshape(len(path), -1, 2)
        inside_share = np.mean(
            model.regions.select(np.arange(3) == region).signed_distance(middle) < 0, 1
        )
        # Both ends of an interval are known to half a distance of points.
        atol = 1.001 * model.dt / middle.shape[1]
        np.testing.assert_allclose(times[:, move], model.dt * inside_share, atol=atol)
    assert np.any((times > 0) & (times < model.dt))
    assert np.any(times == model.dt)


def test_a_move_is_inside_for_some_time_exactly_if_it_crosses() -> None:
    model = pendulum()
    crosses = model.kept.crosses.toarray().reshape(model.states, model.moves, -1)
    stays = model.kept.successor >= 0
    for region in range(3):
        times = move_times(model, region)
        np.testing.assert_array_equal((times > 0)[stays], crosses[..., region][stays])


def test_a_recorded_path_by_hand() -> None:
    """Uneven samples: half of a fast step is inside, all of a slow one, and a rest of 2 s."""
    model = pendulum()
    path = [[2.5, 0.0], [3.5, 0.0], [3.6, 0.0], [3.6, 0.0], [4.4, 0.0]]
    times = [0.0, 1.0, 4.0, 6.0, 6.8]
    np.testing.assert_allclose(time_inside(model.regions, path, times), [0.5 + 3 + 2 + 0.4, 0, 0])
    even = path_times(
        model.regions, 0, np.array(path) + np.array([[[0.0, 0.0]], [[0.0, 5.0]]]), 8.0
    )
    np.testing.assert_allclose(even, [2.0 * (0.5 + 1 + 1 + 0.5), 0.0])


def test_a_path_that_went_round_is_inside_as_the_same_path_elsewhere() -> None:
    """Half of it is in the box across the seam, however many turns it has behind it."""
    path, turns = np.array([[5.3, 0.0], [6.3, 0.0]]), 2 * np.pi * np.arange(-2, 3)
    paths = path + np.stack([turns, np.zeros(5)], axis=1)[:, None]
    np.testing.assert_allclose(path_times(pendulum().regions, 1, paths, 3.0), np.full(5, 1.5))
