"""Distributions under a truth that blocks the straight ways of a passage."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from linear_bridge import WIDE, Bridge

from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.sampled import distribution as module
from mlci.sampled.detours import Softened
from mlci.sampled.model import SampledModel
from mlci.sampled.passage import Passage
from mlci.shapes.balls import Ball
from mlci.shapes.predicates import Predicate
from mlci.simulate import rollout
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum
from mlci.tabular import action_grid, discretize
from mlci.zoo.planar_point import PlanarPoint

PLANE = PlanarPoint(position_limit=50.0)
GOAL = Box([1.4, -0.1], [1.6, 0.1])
DISC = Regions.from_shapes(PLANE.space, [Ball([0.0, 0.0], 0.6), Ball([0.0, 1.0], 0.3)])
ACROSS = Task(np.array([-1.5, 0.0]), GOAL, 3.0)
MODEL = SampledModel(PLANE, DISC, 0.25, 0.3)
PENDULUM = Pendulum()


def plane_bridge(count: int, rng: np.random.Generator) -> tuple[float, Floats]:
    """log Z without a truth and paths (B, K+1, 2) of MODEL's task ACROSS, both exact."""
    passage = MODEL.passage(ACROSS)
    steps, dt, variance = passage.steps, passage.dt, passage.temperature / (2 * passage.dt)
    spread = np.sqrt(steps * variance) * dt
    low, high = (
        scipy.special.ndtr((side - passage.start) / spread) for side in (GOAL.lower, GOAL.upper)
    )
    ends = passage.start + spread * scipy.special.ndtri(rng.uniform(low, high, (count, 2)))
    free = rng.normal(0, np.sqrt(variance), (count, steps, 2))
    apart = (ends - passage.start) / (steps * dt) - np.mean(free, axis=1)
    paths = rollout(PLANE, passage.start, free + apart[:, None], dt, passage.substeps)
    return float(np.sum(np.log(high - low)) + steps * np.log(2 * np.pi * variance)), paths


def log_share(paths: Floats, truth: Regions) -> tuple[float, float]:
    """Log of the share of paths that keep out of a truth, and its standard error."""
    kept = ~np.any(truth.violated_by(paths), axis=1)
    return float(np.log(np.mean(kept))), float(np.sqrt((1 - np.mean(kept)) / np.sum(kept)))


def test_a_disc_in_the_way_leaves_the_bridges_log_z_and_half_the_paths_on_each_side():
    log_z, paths = plane_bridge(60_000, np.random.default_rng(0))
    log_alpha, exact_error = log_share(paths, DISC.select([True, False]))
    under = MODEL.under([True, False]).distribution(ACROSS)
    few = MODEL.distribution(ACROSS).under([True, False])
    assert log_alpha < np.log(0.05)
    error = np.hypot(under.log_z_error, exact_error)
    assert abs(under.log_z - (log_z + log_alpha)) < 3 * error
    assert error < 0.08  # or three errors would tell nothing
    np.testing.assert_array_equal(under.truth, [True, False])
    assert under.violation_probabilities()[0] == 0
    assert under.diagnosis.effective > 5 * few.diagnosis.effective
    crossing = np.argmax(under.paths[:, :, 0] > 0, axis=1)
    upper = under.paths[np.arange(len(crossing)), crossing, 1] > 0
    half = np.sqrt(0.25 / under.diagnosis.effective)
    assert abs(np.sum(under.weight[upper]) - 0.5) < 3 * half
    # The other disc is entered as often as by exact paths that keep out of the first.
    entered = DISC.violated_by(paths)
    others = entered[~entered[:, 0], 1]
    exact, error = np.mean(others), np.std(others) / np.sqrt(len(others))
    assert exact > 0.1
    error = np.hypot(error, under.avoidance_errors()[1])
    assert abs(under.violation_probabilities()[1] - exact) < 3 * error


@pytest.mark.long
def test_an_integrator_goes_round_as_its_bridge_does():
    passage = Passage(
        *(WIDE, np.array([-1.5, 1.0]), Box([1.4, 0.9], [1.6, 1.1]), 12, 0.25, 0.3), substeps=4
    )
    bridge, task = Bridge(passage), Task(passage.start, passage.goal, 3.0)
    truth = Regions.from_shapes(WIDE.space, [Ball([0.0, 1.0], [0.4, 0.3])])
    paths = np.concatenate([bridge.paths(20_000, np.random.default_rng(i)) for i in range(3)])
    log_alpha, exact_error = log_share(paths, truth)
    under = SampledModel(WIDE, truth, 0.25, 0.3).under([True]).distribution(task)
    error = np.hypot(under.log_z_error, exact_error)
    assert abs(under.log_z - (bridge.log_z + log_alpha)) < 3 * error
    assert error < 0.08


def pendulum_shares(cells: int) -> tuple[float, SampledModel, Task]:
    """Log alpha of the paper's C1 on a grid, and the sampled model and the task."""
    truth = Regions.from_boxes(PENDULUM.space, [Box([np.pi, 0.0], [1.2 * np.pi, 1.2])])
    actions, apart = action_grid(PENDULUM, 25, Box([-6.0], [6.0])), 0.5
    tabular = discretize(PENDULUM, Grid(PENDULUM.space, (cells, cells)), actions, 0.25, truth)
    coarse = Grid(PENDULUM.space, (60, 60))
    lower, upper = (corners[coarse.index(np.array([4.1, 0.3]))] for corners in coarse.corners)
    task = Task(np.array([2.8, 0.3]), Box(lower + 1e-9, upper - 1e-9), 2.5)
    free, kept = (
        TrajectoryDistribution.of_task(model, task, exact_ends=True)
        for model in (tabular, tabular.under([True]))
    )
    log_alpha = kept.log_z[0, kept.start] - free.log_z[0, free.start]
    wide = Box([-6.0 - apart / 2], [6.0 + apart / 2])
    return log_alpha, SampledModel(PENDULUM, truth, 0.25, limit=wide), task


@pytest.mark.long
def test_a_pendulum_goes_round_c1_as_on_a_grid():
    log_alpha, model, task = pendulum_shares(cells=120)
    free, under = model.distribution(task), model.under([True]).distribution(task)
    # 90 cells a side differ from 120 by 0.18, and 0.05 is the standard error of the samples.
    assert under.log_z - free.log_z == pytest.approx(log_alpha, abs=0.25)
    assert under.diagnosis.trusted
    assert under.diagnosis.effective > 5 * free.under([True]).diagnosis.effective


@pytest.mark.parametrize("middle", [[0.0, 20.0], [0.0, 0.9]])
def test_where_little_is_in_the_way_log_z_is_that_of_the_plain_distribution(middle, monkeypatch):
    truth = Regions.from_shapes(PLANE.space, [Ball(middle, 0.5)])
    model = replace(MODEL, regions=truth, samples=1500)
    plain = model.distribution(ACROSS).under([True])
    assert plain.log_z - model.distribution(ACROSS).log_z > np.log(0.5)
    assert model.under([True]).distribution(ACROSS).log_z == plain.log_z
    monkeypatch.setattr(module, "_BLOCKED", 2.0)  # draw anew all the same
    anew = model.under([True]).distribution(ACROSS)
    assert anew.log_z != plain.log_z
    assert abs(anew.log_z - plain.log_z) < 3 * np.hypot(anew.log_z_error, plain.log_z_error)


def test_the_same_task_under_the_same_truth_gives_the_same_paths_that_count():
    model = replace(MODEL, samples=400, restarts=2)
    first, again = (model.under([True, False]).distribution(ACROSS) for _ in range(2))
    np.testing.assert_array_equal(first.paths, again.paths)
    assert not DISC.violated_by(first.paths)[:, 0].any()
    in_turn = model.under([True, False]).under([False, True]).distribution(ACROSS)
    np.testing.assert_array_equal(in_turn.truth, [True, True])
    assert not DISC.violated_by(in_turn.paths).any()


def test_a_start_inside_the_truth_is_impossible():
    model = replace(MODEL, samples=200, restarts=2).under([True, False])
    inside = model.distribution(replace(ACROSS, start=np.array([-0.1, 0.2])))
    assert not inside.is_possible
    assert inside.log_z == -np.inf


def test_a_goal_inside_the_truth_is_impossible():
    model = replace(MODEL, samples=200, restarts=2).under([True, False])
    inside = model.distribution(replace(ACROSS, goal=Box([-0.1, -0.1], [0.1, 0.1])))
    assert not inside.is_possible
    assert inside.log_z == -np.inf


def test_of_a_truth_that_knows_no_distance_paths_that_keep_out_are_left():
    shape = Predicate(lambda states: states[..., 0] ** 2 + states[..., 1] ** 2 < 1)
    regions = Regions.from_shapes(PLANE.space, [shape], ["round"])
    model = replace(MODEL, regions=regions, samples=500, restarts=2)
    under, dropped = (
        model.under([True]).distribution(ACROSS),
        model.distribution(ACROSS).under([True]),
    )
    assert len(dropped.weight) < 250
    np.testing.assert_array_equal(under.paths, dropped.paths)
    np.testing.assert_array_equal(under.weight, dropped.weight)
    assert under.log_z == dropped.log_z


def test_a_reward_falls_inside_and_near_a_truth_alone():
    rng, truth = np.random.default_rng(0), DISC.select([True, False])
    soft = Softened(PLANE, truth, price=3.0, margin=0.2)
    states, controls = rng.uniform(-1.5, 1.5, (50, 2)), rng.uniform(-1, 1, (50, 2))
    near = np.linalg.norm(states, axis=-1) < 0.8
    lost = PLANE.running_reward(states, controls) - soft.running_reward(states, controls)
    depth = 0.8 - np.linalg.norm(states[near], axis=-1)
    np.testing.assert_allclose(lost[near], 3 * np.square(depth))
    np.testing.assert_array_equal(lost[~near], 0)
    gradient, hessian = soft.reward_derivatives(states, controls)
    outward = states[near] / np.linalg.norm(states[near], axis=-1, keepdims=True)
    np.testing.assert_allclose(gradient[near, :2], 6 * depth[:, None] * outward, atol=1e-6)
    assert np.all(np.linalg.eigvalsh(hessian) < 1e-9)
