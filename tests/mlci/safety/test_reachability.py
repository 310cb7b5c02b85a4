import itertools
from dataclasses import dataclass

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import SafeSet, solve_safe_set
from mlci.simulate import rk4_step
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, Pendulum, System

PENDULUM = Pendulum()
WEAK_PENDULUM = Pendulum(control_limit=0.5)
FREE = np.inf
BOTTOM = ((np.pi, 0.0), (1.2 * np.pi, 1.2))
SIDE = ((1.6 * np.pi, 0.0), (1.8 * np.pi, 1.2))
WALL = ((np.pi, -FREE), (1.2 * np.pi, FREE))


@dataclass(frozen=True, eq=False)
class Drift(System):
    """x' = -1 + u_1, y' = u_2, z' = 0: three states, two controls, the third state an angle."""

    control_limit: float = 0.0

    space = StateSpace(
        Box(np.array([-2.0, -1.0, 0.0]), np.array([2.0, 1.0, 6.0])),
        np.array([False, False, True]),
        ("x", "y", "z"),
    )

    @property
    def control_box(self):
        limit = np.array([self.control_limit, 1.0])
        return Box(-limit, limit)

    def dynamics(self, states, controls):
        zero = 0.0 * states[..., 0]
        return np.stack([zero - 1 + controls[..., 0], zero + controls[..., 1], zero], axis=-1)

    def jacobians(self, states, controls):
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Line(System):
    """x' = -(1 + bend x^2 / 4), without a control, on a line or on a circle."""

    bend: float
    periodic: bool

    @property
    def space(self):
        return StateSpace(Box(np.array([-3.0]), np.array([3.0])), np.array([self.periodic]), ("x",))

    @property
    def control_box(self):
        return Box.point([0.0])

    def dynamics(self, states, controls):
        return -(1 + self.bend * states**2 / 4) + 0 * controls

    def jacobians(self, states, controls):
        raise NotImplementedError


def region(system, corners):
    return Regions(system.space, [corners[0]], [corners[1]])


def orders(errors, counts):
    """Slope of log error against log cell width between neighbouring grids."""
    return np.diff(np.log(errors)) / -np.diff(np.log(counts))


@pytest.mark.parametrize("control_limit", [0.0, 0.25])
def test_a_drift_that_control_cannot_hold_moves_the_border_against_it(control_limit):
    system, horizon = Drift(control_limit), 0.7
    grid = Grid(system.space, (40, 3, 4))
    keep_out = region(system, ((-2.0, -FREE, -FREE), (0.0, FREE, FREE)))
    safe_set = solve_safe_set(system, grid, keep_out, horizon=horizon)
    # Left of -1 the distance to K is measured to its other side.
    expected = grid.centers[:, 0] - (1 - control_limit) * horizon
    clear = expected > -0.5
    np.testing.assert_allclose(safe_set.values[clear], expected[clear], atol=1e-3)
    if control_limit:
        best = safe_set.safe_control(system, grid.centers[clear])
        np.testing.assert_array_equal(best[:, 0], control_limit)


def test_the_border_wraps_round_a_circle():
    system = Line(bend=0.0, periodic=True)
    keep_out = region(system, ([2.5], [3.5]))
    x = np.linspace(-3, 3, 101)[:, None]
    late = np.linspace(0, 1.5, 301)
    expected = np.min(keep_out.signed_distance(x[:, None] - late[:, None]), axis=1)
    values = solve_safe_set(system, Grid(system.space, (240,)), keep_out, horizon=1.5).value(x)
    np.testing.assert_allclose(values, expected, atol=0.06)


def test_smooth_parts_converge_at_second_order():
    system, horizon, counts = Line(bend=1.0, periodic=False), 0.5, [60, 120, 240]
    errors = []
    for count in counts:
        grid = Grid(system.space, (count,))
        values = solve_safe_set(
            system, grid, region(system, ([-3.0], [-1.0])), horizon=horizon
        ).values
        x = grid.centers[:, 0]
        exact = 2 * np.tan(np.arctan(x / 2) - horizon / 2) + 1
        errors.append(np.abs(values - exact)[exact > -0.5].mean())
    assert np.all(orders(errors, counts) > 1.9)


def braking_value(states):
    """V of the unit mass on a line, |u| <= 1, for the keep-out positions [-0.5, 0.5].

    Coming from the left, braking stops it at x + v^2 / 2; V is the depth of that point in K, or of
    the middle of K if it comes as far.
    """
    position, speed = np.where(states[:, 1:] < 0, -states, states).T
    stop = np.minimum(position + speed**2 / 2, 0.0)
    return np.where(position >= 0, position - 0.5, -0.5 - stop)


def test_the_double_integrator_has_its_braking_parabola():
    system, counts = DoubleIntegrator(), [31, 61, 121]
    keep_out = region(system, ((-0.5, -FREE), (0.5, FREE)))
    errors = []
    for count in counts:
        grid = Grid(system.space, (count, count))
        safe_set = solve_safe_set(system, grid, keep_out)
        exact = braking_value(grid.centers)
        errors.append(np.abs(safe_set.values - exact)[np.abs(exact) < 0.1].mean())
        states = np.random.default_rng(0).uniform(-2.9, 2.9, (20_000, 2))
        exact = braking_value(states)
        wrong = safe_set.contains(states) != (exact >= 0)
        assert np.all(np.abs(exact[wrong]) < grid.widths.max())
    assert np.all(orders(errors, counts) > 0.85)


def test_the_value_never_grows_with_the_horizon():
    grid, keep_out = Grid(PENDULUM.space, (41, 41)), region(PENDULUM, BOTTOM)
    start = keep_out.signed_distance(grid.centers)
    values = [
        solve_safe_set(PENDULUM, grid, keep_out, horizon=tau).values for tau in (0, 0.3, 1, 3)
    ]
    np.testing.assert_allclose(values[0], start, rtol=1e-14)  # there and back through W
    for sooner, later in itertools.pairwise(values):
        assert np.all(later <= sooner + 1e-9)
        assert np.any(later < sooner - 0.01)


def test_a_fixed_point_stands_still():
    grid, keep_out = Grid(PENDULUM.space, (41, 41)), region(PENDULUM, BOTTOM)
    settled = solve_safe_set(PENDULUM, grid, keep_out).values
    late = solve_safe_set(PENDULUM, grid, keep_out, horizon=30.0).values
    near = np.abs(settled) < 0.3
    np.testing.assert_allclose(settled[near], late[near], atol=0.002)


def switching_sequences(limit, steps):
    """Controls (sequences, steps) that start at an extreme and switch up to three times."""
    ticks = np.arange(0, steps, steps // 16)
    cuts = [np.array(cut) for k in range(4) for cut in itertools.combinations(ticks[1:], k)]
    flips = np.array([(np.arange(steps)[:, None] >= cut).sum(axis=1) for cut in cuts])
    first = np.where(flips % 2, -limit, limit)
    return np.concatenate([first, -first, np.zeros((1, steps))])


def survivors(system, keep_out, states, seconds, dt=0.025):
    """Whether some switching sequence keeps each of states (B, n) out of K for so long."""
    sequences = switching_sequences(system.control_limit, round(seconds / dt))
    alive = np.argwhere(np.ones((len(states), len(sequences)), dtype=bool))
    now = states[alive[:, 0]]
    for k in range(sequences.shape[1]):
        now = rk4_step(system, now, sequences[alive[:, 1], k][:, None], dt)
        out = keep_out.signed_distance(now) > 0
        alive, now = alive[out], now[out]
    return np.isin(np.arange(len(states)), alive[:, 0])


def near_border(safe_set, count, cells=(2, 4)):
    """States two to four cells from the border on its safe and its doomed side."""
    grid = safe_set.grid
    directions = np.array(list(itertools.product((-1, 0, 1), repeat=len(grid.shape))))
    states = np.random.default_rng(0).uniform(
        grid.space.bounds.lower, grid.space.bounds.upper, (40_000, len(grid.shape))
    )
    near, far = (safe_set.contains(states[:, None] + k * directions * grid.widths) for k in cells)
    border = ~(far.all(axis=1) | (~far).all(axis=1))
    return states[border & near.all(axis=1)][:count], states[border & ~near.any(axis=1)][:count]


@pytest.mark.parametrize("corners", [BOTTOM, SIDE, WALL])
@pytest.mark.parametrize("system", [PENDULUM, WEAK_PENDULUM])
@pytest.mark.long
def test_brute_force_agrees_on_both_sides_of_the_border(system, corners):
    keep_out = region(system, corners)
    safe_set = solve_safe_set(system, Grid(system.space, (101, 101)), keep_out)
    inside, doomed = near_border(safe_set, 20)
    assert len(inside) == len(doomed) == 20
    assert np.all(survivors(system, keep_out, inside, 6.0))
    assert not np.any(survivors(system, keep_out, doomed, 6.0))


def constant_control_bound(system, keep_out, states, seconds=6.0, dt=0.01):
    """The best constant extreme control's least distance to K: V is at least as large."""
    best = np.full(len(states), -np.inf)
    for control in system.control_box.vertices():
        now, least = states, keep_out.signed_distance(states)
        for _ in range(round(seconds / dt)):
            now = rk4_step(system, now, control, dt)
            least = np.minimum(least, keep_out.signed_distance(now))
        best = np.maximum(best, least)
    return best


@pytest.mark.parametrize("corners", [BOTTOM, SIDE])
def test_the_border_is_that_of_the_best_constant_control(corners):
    keep_out, counts = region(PENDULUM, corners), [51, 101, 201]
    middle, half = np.mean(corners, axis=0), np.array([1.0, 1.4])
    states = np.random.default_rng(0).uniform(middle - half, middle + half, (2000, 2))
    exact = constant_control_bound(PENDULUM, keep_out, states)
    near = np.abs(exact) < 0.1
    errors = []
    for count in counts:
        safe_set = solve_safe_set(PENDULUM, Grid(PENDULUM.space, (count, count)), keep_out)
        errors.append(np.abs(safe_set.value(states[near]) - exact[near]).mean())
    assert errors[1] < 0.003
    assert np.all(orders(errors, counts) > 1.0)


def test_impossible_problems_are_refused():
    grid, keep_out = Grid(PENDULUM.space, (11, 11)), region(PENDULUM, BOTTOM)
    with pytest.raises(ValueError, match="horizon must be at least 0 s, not -1"):
        solve_safe_set(PENDULUM, grid, keep_out, horizon=-1)
    with pytest.raises(ValueError, match="tolerance must be positive, not 0"):
        solve_safe_set(PENDULUM, grid, keep_out, tolerance=0)
    needle = region(PENDULUM, ((3.0, 0.0), (3.01, 0.01)))
    with pytest.raises(ValueError, match=r"region 1 must hold .* a \[11, 11\] grid"):
        solve_safe_set(PENDULUM, grid, keep_out.joined(needle))
    everything = region(PENDULUM, ((-FREE, -FREE), (FREE, FREE)))
    with pytest.raises(ValueError, match="not the whole space"):
        solve_safe_set(PENDULUM, grid, everything)
    slow = Drift(control_limit=0.999)
    drifting = region(slow, ((-2.0, -FREE, -FREE), (0.0, FREE, FREE)))
    with pytest.raises(RuntimeError, match=r"falls by 0\.001 per second after 100 s"):
        solve_safe_set(slow, Grid(slow.space, (40, 3, 4)), drifting, tolerance=1e-4)


def test_a_safe_set_checks_its_arrays():
    grid = Grid(PENDULUM.space, (4, 5))
    with pytest.raises(ValueError, match=r"values \(20,\) and gradients \(20, 2\), not \(4, 5\)"):
        SafeSet(grid, np.zeros((4, 5)), np.zeros((20, 2)))
    with pytest.raises(ValueError, match="finite"):
        SafeSet(grid, np.full(20, np.nan), np.zeros((20, 2)))


def is_doomed(states):
    """Whether the pendulum cannot stay out of BOTTOM, in closed form.

    The box is left alone by who stands below it (u = -2 pushes down, for sin(angle) < 2), above it
    (u = 2) or behind it. It can be forced in only through its left side, angle = pi, at a velocity
    between 0 and 1.2. Under a held u, d/dt (w^2 / 2 + cos(angle) - u angle) = 0. So who comes from
    the left escapes in two ways: u = -2 stops it before the side if it is below the arc through the
    lower corner (pi, 0), and u = 2 lifts it over the box if it is above the arc through the upper
    corner (pi, 1.2). Between the arcs it is doomed, as inside the box.
    """
    angle, velocity = states.T
    energy = velocity**2 / 2 + np.cos(angle)
    cannot_stop = energy + 2 * angle > -1 + 2 * np.pi
    cannot_rise = energy - 2 * angle < 1.2**2 / 2 - 1 - 2 * np.pi
    before = (angle <= np.pi) & (velocity > 0) & cannot_stop & cannot_rise
    return before | (region(PENDULUM, BOTTOM).signed_distance(states) < 0)


@pytest.mark.parametrize("count", [51, 101, 201])
def test_the_pendulums_border_has_its_closed_form_within_half_a_cell(count):
    grid = Grid(PENDULUM.space, (count, count))
    safe_set = solve_safe_set(PENDULUM, grid, region(PENDULUM, BOTTOM))
    states = np.random.default_rng(0).uniform([np.pi - 0.5, -0.5], [1.3 * np.pi, 1.7], (40_000, 2))
    turns = np.arange(32) / 32 * 2 * np.pi
    ring = grid.widths / 2 * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    doomed = is_doomed(states)
    around = np.array([is_doomed(states + shift) for shift in ring])
    clear = np.all(around == doomed, axis=0)
    assert 0.05 < np.mean(doomed[clear]) < 0.5
    np.testing.assert_array_equal(safe_set.contains(states[clear]), ~doomed[clear])


def cannot_stop(states, left, right):
    """Whether the pendulum, |u| <= 2, cannot stay out of the angles from left to right.

    Nobody passes the wall, so who comes to it has to stop: under the held u that brakes,
    w^2 / 2 + cos(angle) - u angle stands still, and w is 0 where the energy is all spent.
    """
    angle, velocity = states.T
    above = left + (angle - left) % (2 * np.pi)
    below = above - 2 * np.pi
    falls = velocity**2 / 2 + np.cos(above) - 2 * above > np.cos(right) - 2 * right
    rises = velocity**2 / 2 + np.cos(below) + 2 * below > np.cos(left) + 2 * left
    return (above < right) | ((velocity < 0) & falls) | ((velocity > 0) & rises)


@pytest.mark.parametrize("count", [51, 101])
@pytest.mark.parametrize("corners", [WALL, ((1.6 * np.pi, -FREE), (1.8 * np.pi, FREE))])
@pytest.mark.long
def test_the_border_round_a_wall_errs_by_at_most_half_a_cell_to_either_side(corners, count):
    grid = Grid(PENDULUM.space, (count, count))
    safe_set = solve_safe_set(PENDULUM, grid, region(PENDULUM, corners))
    states = np.random.default_rng(0).uniform([0, -5.5], [2 * np.pi, 5.5], (40_000, 2))
    turns = np.arange(32) / 32 * 2 * np.pi
    ring = grid.widths / 2 * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    sides = corners[0][0], corners[1][0]
    doomed = cannot_stop(states, *sides)
    around = np.array([cannot_stop(states + shift, *sides) for shift in ring])
    clear = np.all(around == doomed, axis=0)
    assert 0.2 < np.mean(doomed[clear]) < 0.8
    wrong = safe_set.contains(states[clear]) == doomed[clear]
    assert not np.any(wrong & doomed[clear])
    assert np.sum(wrong) < 0.001 * len(wrong)


def test_steepness_bounds_the_rise_between_any_two_states_across_the_seam_as_well() -> None:
    system = Pendulum()
    grid = Grid(system.space, (20, 9))
    safe = SafeSet.from_values(grid, grid.centers[:, 0])  # rises by a cell, falls back at the seam
    width = grid.widths[0]
    np.testing.assert_allclose(safe.steepness, 19.0, rtol=1e-12)
    for angle, slope in ((0.0, 19.0), (3.0, 1.0)):
        states = np.array([[angle - width / 4, 0.0], [angle + width / 4, 0.0]])
        before, after = safe.value(states)
        np.testing.assert_allclose(abs(after - before), slope * width / 2, rtol=1e-9)
