"""Soft constraints against lists of all trajectories, and between their two limits."""

from dataclasses import replace

import numpy as np
import pytest
from soft_worlds import enumerated, toy_world

from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.soft.distribution import SoftModel, soften
from mlci.soft.time_inside import move_times
from mlci.spaces import Box
from mlci.systems import Pendulum
from mlci.tabular import TabularModel, action_grid, discretize

TOLERANCE = 1e-12  # sums of up to 3^5 terms of order 1
WEIGHTS = [0.0, 0.3, 2.0, 40.0, np.inf]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("weight", WEIGHTS)
def test_z_and_phi_are_those_of_all_trajectories(seed: int, weight: float) -> None:
    soft, goals, steps = toy_world(seed), [0, 2, 3], 5
    reward, time, crossed = enumerated(soft, steps, goals)
    with np.errstate(invalid="ignore"):
        each = np.exp(reward - np.where(time > 0, weight * time, 0.0))
    distribution = TrajectoryDistribution(soft.model, 0, goals, steps)
    task = soft.task(distribution)
    assert task.log_z(weight) == pytest.approx(np.log(np.sum(each)), abs=TOLERANCE)
    mean = np.sum(each) / np.sum(np.exp(reward))
    assert task.log_share(weight) == pytest.approx(np.log(mean), abs=TOLERANCE)
    under = replace(distribution, model=soft.under(weight))
    phi = np.array([np.sum(each * (time > 0)), np.sum(each * crossed)]) / np.sum(each)
    np.testing.assert_allclose(under.violation_probabilities(), phi, atol=TOLERANCE)


def test_the_toy_worlds_are_inside_for_several_times_and_not_always() -> None:
    several = [len(np.unique(enumerated(toy_world(seed), 5, [0, 2, 3])[1])) for seed in range(5)]
    assert min(several) > 3


@pytest.mark.parametrize("ends", [False, True])
@pytest.mark.parametrize("steps", [1, 8])
def test_an_infinite_weight_is_the_wall_and_none_is_no_constraint(steps: int, ends: bool) -> None:
    model = _pendulum((24, 24))
    task = Task(np.array([2.8, 1.1]), Box([2.9, -4.0], [4.4, 4.0]), 0.25 * steps)
    free = TrajectoryDistribution.of_task(model, task, exact_ends=ends)
    walled = replace(free, model=model.under([True, False]))
    softened = soften(model, 0)
    of_task = softened.task(free)
    none, wall = (each.log_z[0, free.start] for each in (free, walled))
    assert -np.inf < wall < none - 0.01  # the region matters
    assert of_task.log_z(0.0) == pytest.approx(none, abs=TOLERANCE)
    log_z = np.array([of_task.log_z(weight) for weight in (1.0, 10.0, 100.0, 1e6, np.inf)])
    assert np.all(np.diff(log_z) <= TOLERANCE)
    # Chords that cut a corner are inside for 1e-4 s: the last two weights settle them too.
    np.testing.assert_allclose(log_z[-2:], wall, atol=TOLERANCE)
    if not ends:
        expected = walled.violation_probabilities()
        for weight in (1e6, np.inf):
            phi = replace(free, model=softened.under(weight)).violation_probabilities()
            np.testing.assert_allclose(phi, expected, atol=1e-10)


@pytest.mark.parametrize("weight", [0.5, 8.0])
def test_merged_moves_weigh_as_single_ones_do(weight: float) -> None:
    """Two routes: all moves with lowered rewards, and those that agree in successor and time."""
    softened = soften(_pendulum(samples=2), 0)
    free = TrajectoryDistribution(softened.model, 70, [90, 91, 92, 93, 94], 6)
    single = replace(free, model=softened.under(weight)).log_z[0, free.start]
    assert softened.task(free).log_z(weight) == pytest.approx(single, abs=TOLERANCE)
    merged, moves = len(softened.moves.times), softened.times.size
    assert merged < 0.8 * moves
    assert len(softened.model.merged.successor) < merged  # fewer if times did not count


def test_the_truth_stays_forbidden() -> None:
    """Also between cells that ways round the truth lead to."""
    model, start = _pendulum((24, 24)), 135
    everywhere = TrajectoryDistribution(model, start, np.arange(240, 400), 9)
    free = replace(everywhere, model=model.under([False, True]))
    of_task = soften(free.model, 0).task(free)
    assert of_task.log_z(0.0) == pytest.approx(free.log_z[0, start], abs=TOLERANCE)
    without = soften(model, 0).task(free)  # the same cells, and moves that cross the truth
    assert without.log_z(0.0) > free.log_z[0, start] + 0.1


def test_paths_from_and_to_states_are_inside_the_region_of_the_model() -> None:
    model = _pendulum((24, 24))
    task = Task(np.array([3.5, 1.5]), Box([3.7, -4.0], [4.4, 4.0]), 1.0)
    free = TrajectoryDistribution.of_task(model, task, exact_ends=True)
    walled = replace(free, model=model.under([False, True]))
    softened = soften(model, 1)
    np.testing.assert_array_equal(softened.times, move_times(model, 1))
    log_z = softened.task(free).log_z(np.inf)
    assert log_z == pytest.approx(walled.log_z[0, free.start], abs=TOLERANCE)
    other = replace(free, model=model.under([True, False]))
    assert abs(log_z - other.log_z[0, free.start]) > 0.01


def test_what_cannot_be_softened_is_refused() -> None:
    model = _pendulum()
    with pytest.raises(ValueError, match="144 cells of 5 moves are too many to keep: take fewer"):
        soften(replace(model, kept=None), 0)
    with pytest.raises(ValueError, match=r"times inside need \(144, 5\) numbers of at least 0 s"):
        SoftModel(model, 0, np.full((144, 5), -1.0))
    lost = TrajectoryDistribution(model, 0, np.zeros(0, dtype=int), 2)
    with pytest.raises(ValueError, match="no trajectory reaches a goal"):
        soften(model, 0).task(lost).log_share(1.0)


def _pendulum(shape: tuple[int, ...] = (12, 12), samples: int = 1) -> TabularModel:
    system = Pendulum()
    boxes = [Box([3.0, -1.0], [3.5, 1.0]), Box([3.6, 1.0], [4.4, 3.0])]
    regions = Regions.from_boxes(system.space, boxes)
    grid, actions = Grid(system.space, shape), action_grid(system, 5)
    return discretize(system, grid, actions, 0.25, regions, samples)
