"""Safe sets and demonstrators before truths that are no boxes, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from mlci.demonstrator import demonstrate, sample_trials
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.closest_approach import KeepOut
from mlci.safety.constant_controls import escape_value, tabulate_escapes
from mlci.safety.reachability import solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.shapes.balls import Ball
from mlci.shapes.half_spaces import HalfSpace
from mlci.shapes.predicates import Predicate
from mlci.simulate import rk4_step
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum

PLANE = StateSpace(Box([-3, -2], [3, 2]), [False, False], ("x", "y"))
WALKER = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), PLANE, Box([-1, -1], [1, 1]))
CURRENT = FunctionSystem(lambda x, u: (2 + u[..., 0], 0 * u[..., 0]), PLANE, Box([-1], [1]))
ELLIPSES = Ball([-0.8, 0.3], [0.7, 0.4]), Ball([1.0, -0.4], [0.5, 0.8])
TWO = Regions.from_shapes(PLANE, ELLIPSES)


def test_who_can_go_anywhere_is_safe_outside_two_ellipses():
    grid = Grid(PLANE, (61, 41))
    safe = solve_safe_set(WALKER, grid, TWO)
    # The scheme rounds corners off between the shapes: a fifth of a cell.
    expected = TWO.signed_distance(grid.centers)
    outside = expected > 0.02
    assert np.all(safe.values[outside] > 0)
    assert np.all(safe.values[expected < -0.02] < 0)


def test_who_drifts_towards_an_ellipse_is_doomed_before_it():
    grid = Grid(PLANE, (90, 60))
    safe = solve_safe_set(CURRENT, grid, TWO, horizon=8.0)
    x, y = grid.centers.T
    doomed = np.zeros(len(x), dtype=bool)
    for ball in ELLIPSES:
        (middle, height), (half, tall) = ball.center, ball.radii
        chord = half * np.sqrt(np.maximum(1 - ((y - height) / tall) ** 2, 0))
        doomed |= (np.abs(y - height) < tall) & (x < middle + chord)
    wrong = (safe.values < 0) != doomed
    # Only within a cell of a border, of which there are so many cells.
    levels = np.abs(TWO.signed_distance(grid.centers))
    edges = [np.abs(np.abs(y - b.center[1]) - b.radii[1]) < 2 * grid.widths[1] for b in ELLIPSES]
    near = np.any(edges, axis=0) | (levels < np.max(grid.widths))
    assert not np.any(wrong & ~near)
    assert np.mean(wrong) < 0.02


def test_a_mass_brakes_before_a_half_space():
    system = DoubleIntegrator()
    wall = Regions.from_shapes(system.space, [HalfSpace([1.0, 0.0], 0.5)])
    limit = float(system.control_box.upper[0])
    states = np.random.default_rng(0).uniform([-1, -1], [0.4, 1], (2000, 2))
    position, speed = states.T
    exact = 0.5 - (position + np.maximum(speed, 0) ** 2 / (2 * limit))
    errors = []
    for step in (0.05, 0.025):
        value = escape_value(system, wall, states, 3.0, step)
        assert np.all(value < exact + 1e-9)
        errors.append(np.max(exact - value))
    assert errors[1] < 0.6 * errors[0] < 0.03


def test_constant_controls_achieve_what_is_claimed_before_a_ball():
    system = Pendulum()
    ball = Regions.from_shapes(system.space, [Ball([3.5, 0.5], [0.4, 0.8])])
    states = np.random.default_rng(1).uniform([2.0, -2.0], [5.0, 2.0], (400, 2))
    claimed = escape_value(system, ball, states, 3.0, 0.025)
    achieved = np.full(len(states), -np.inf)
    for control in system.control_box.vertices():
        now, least = states, ball.signed_distance(states)
        for _ in range(1200):
            now = rk4_step(system, now, control, 0.0025)
            now = np.clip(
                now,
                [-np.inf, *system.space.bounds.lower[1:]],
                [np.inf, *system.space.bounds.upper[1:]],
            )
            least = np.minimum(least, ball.signed_distance(now))
        achieved = np.maximum(achieved, least)
    assert np.all(claimed <= achieved + 1e-3)
    # Ten times longer steps lose more, and claim no more: levels between samples are bounded.
    assert np.all(escape_value(system, ball, states, 3.0, 0.25) <= achieved + 1e-3)
    assert np.mean(achieved - claimed) < 0.01
    grid = Grid(system.space, (31, 31))
    table = tabulate_escapes(system, grid, ball, horizon=3.0)
    np.testing.assert_array_equal(table.values[ball.signed_distance(grid.centers) < 0] < 0, True)


def test_bound_between_two_samples_is_below_the_least_level_on_the_way():
    ball = Regions.from_shapes(PLANE, [Ball([0.0, 0.0], 0.3)])
    ends = np.asfortranarray([[-1.0, 0.0]]), np.asfortranarray([[1.0, 0.0]])
    rates = np.asfortranarray([[2.0, 0.0]])
    distance, least = ball.signed_distance(ends[0]), np.array([np.inf])
    KeepOut.of(ball).approach(ends, (rates, rates), 1.0, distance, least)
    assert least[0] <= -0.3  # in the middle
    assert least[0] > -0.3 - 2 / 8
    np.testing.assert_array_equal(distance, ball.signed_distance(ends[1]))


def test_a_demonstrator_goes_round_two_ellipses():
    safe = solve_safe_set(WALKER, Grid(PLANE, (61, 41)), TWO)
    margin = border_margin(WALKER, safe, 0.05)
    starts = Box([-2.5, -1.5], [2.5, 1.5])
    options = {"horizon": 6.0, "dt": 0.05, "restarts": 2}
    trials = sample_trials(WALKER, safe, starts, trials=10, seed=0, margin=margin, **options)
    keep_out = SafetyFilter(WALKER, safe, 0.05, margin)
    attempts = demonstrate(WALKER, trials, TWO, keep_out, dt=0.05, limit=WALKER.control_box)
    outcomes = [attempt.outcome for attempt in attempts]
    assert outcomes.count("truth_entered") == 0
    assert outcomes.count("kept") >= 5
    for attempt in attempts:
        assert np.all(TWO.signed_distance(attempt.demonstration.states) > 0)


def test_a_truth_without_distance_has_no_safe_set():
    half = Regions.from_shapes(PLANE, [Predicate(lambda x: x[..., 0] > 0)])
    with pytest.raises(ValueError, match="give its `steepness`"):
        solve_safe_set(WALKER, Grid(PLANE, (11, 11)), half)
    with pytest.raises(ValueError, match="give its `steepness`"):
        tabulate_escapes(WALKER, Grid(PLANE, (11, 11)), half, horizon=1.0)
