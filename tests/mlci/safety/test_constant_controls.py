"""The safe set from constant controls, against exact values, brute force and the equation."""

import itertools
from dataclasses import dataclass

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.constant_controls import _step_for, escape_value, tabulate_escapes
from mlci.safety.reachability import solve_safe_set
from mlci.simulate import rk4_step
from mlci.spaces import Box, StateSpace
from mlci.systems import FunctionSystem, Pendulum, System, TelescopingPendulum

FREE = np.inf
TELESCOPE = TelescopingPendulum()
PAIN = Regions(TELESCOPE.space, [[-0.3, -FREE, 7.2, -FREE]], [[0.3, FREE, 8.2, FREE]])


@dataclass(frozen=True, eq=False)
class TwoMasses(System):
    """x'' = u_1 and y'' = u_2: two double integrators that know nothing of each other."""

    space = StateSpace(
        Box(np.full(4, -3.0), np.full(4, 3.0)), np.zeros(4, dtype=bool), ("x", "vx", "y", "vy")
    )
    control_box = Box(np.array([-1.0, -0.5]), np.array([1.0, 0.5]))

    def dynamics(self, states, controls):
        rates = states[..., 1], controls[..., 0], states[..., 3], controls[..., 1]
        return np.stack(np.broadcast_arrays(*rates), axis=-1)

    def jacobians(self, states, controls):
        raise NotImplementedError


MASSES = TwoMasses()


def wall(d):
    """Positions from -0.5 to 0.5 of one of the masses, whatever the other does."""
    side = np.where(np.arange(4) == 2 * d, 0.5, FREE)
    return Regions(MASSES.space, [-side], [side])


def braking_value(position, speed, limit):
    """V of a mass on a line before the keep-out positions [-0.5, 0.5].

    Coming from the left, braking stops it at x + v^2 / (2 limit); V is the depth of that point, or
    of the middle if it comes as far.
    """
    position, speed = np.where(speed < 0, -position, position), np.abs(speed)
    stop = np.minimum(position + speed**2 / (2 * limit), 0.0)
    return np.where(position >= 0, position - 0.5, -0.5 - stop)


@pytest.mark.parametrize(("d", "limit"), [(0, 1.0), (1, 0.5)])
def test_a_wall_in_one_of_two_masses_has_its_braking_parabola(d, limit):
    states = np.random.default_rng(0).uniform(-2.5, 2.5, (4000, 4))
    exact = braking_value(*states[:, 2 * d : 2 * d + 2].T, limit)
    near = np.abs(exact) < 0.3
    errors = []
    for step in (0.1, 0.05, 0.025):
        loss = exact[near] - escape_value(MASSES, wall(d), states[near], 6.0, step)
        assert np.all(loss > -1e-9)
        errors.append(loss.max())
    assert errors[-1] < 1e-3
    assert np.all(np.diff(np.log2(errors)) < -1.5)


def test_on_a_grid_the_equation_has_the_same_parabola():
    # The other mass is idle, so that few cells do for it.
    exact_error, equation_error = [], []
    for count in (21, 41):
        grid = Grid(MASSES.space, (count, count, 2, 2))
        exact = braking_value(*grid.centers[:, :2].T, 1.0)
        near = np.abs(exact) < 0.3
        escapes = escape_value(MASSES, wall(0), grid.centers, 5.0, 0.025)
        equation = solve_safe_set(MASSES, grid, wall(0))
        exact_error.append(np.abs(escapes - exact)[near].max())
        equation_error.append(np.abs(equation.values - exact)[near].mean())
    assert max(exact_error) < 1e-3
    assert equation_error[0] > 10 * max(exact_error)
    assert equation_error[1] < 0.7 * equation_error[0]


def test_a_mass_may_pass_beside_a_box():
    box = Regions(MASSES.space, [[-0.5, -FREE, -0.6, -FREE]], [[0.5, FREE, 0.6, FREE]])
    start = np.array([[-2.5, 2.2, 0.4, 0.0], [-2.5, 2.2, 0.0, 0.0]])
    # The first brakes too late for x, but y is beside the box by then; the second has no time.
    time = np.linspace(0, 2, 2001)
    x, y = -2.5 + 2.2 * time - time**2 / 2, 0.4 + 0.25 * time**2
    beyond = np.stack([-0.5 - x, y - 0.6])
    outside = np.hypot(*np.maximum(beyond, 0.0))
    expected = np.min(outside + np.minimum(beyond.max(axis=0), 0.0))
    value = escape_value(MASSES, box, start, 6.0, 0.01)
    assert value[0] == pytest.approx(expected, abs=0.002)
    assert expected > 0.1
    assert value[1] < -0.1


@pytest.mark.parametrize("corners", [((np.pi, 0.0), (1.2 * np.pi, 1.2))])
def test_the_equation_on_a_fine_grid_agrees_on_the_pendulum(corners):
    pendulum = Pendulum()
    keep_out = Regions(pendulum.space, [corners[0]], [corners[1]])
    fine = solve_safe_set(pendulum, Grid(pendulum.space, (161, 161)), keep_out)
    states = np.random.default_rng(0).uniform([2.0, -2.0], [5.0, 2.0], (2000, 2))
    value = escape_value(pendulum, keep_out, states, 6.0, 0.02)
    near = np.abs(value) < 0.1
    assert near.sum() > 100
    assert np.abs(fine.value(states) - value)[near].mean() < 0.003


def sequences(steps):
    """Controls (sequences, steps, 2) that are extreme and switch up to twice, each for itself."""
    ticks = np.arange(0, steps, steps // 8)[1:]
    cuts = [np.array(cut) for k in range(3) for cut in itertools.combinations(ticks, k)]
    flips = np.array([(np.arange(steps)[:, None] >= cut).sum(axis=1) for cut in cuts])
    one = np.where(flips % 2, -1.0, 1.0)
    one = np.concatenate([one, -one])
    both = np.stack([np.repeat(one, len(one), axis=0), np.tile(one, (len(one), 1))], axis=-1)
    return both * TELESCOPE.control_box.upper


def survivors(states, seconds=2.4, dt=0.02):
    """Whether some switching sequence keeps each of states (B, 4) out of PAIN for so long."""
    tried = sequences(round(seconds / dt))
    bounds = TELESCOPE.space.bounds
    owner, number = np.divmod(np.arange(len(states) * len(tried)), len(tried))
    now = states[owner]
    for k in range(tried.shape[1]):
        now = rk4_step(TELESCOPE, now, tried[number, k], dt)
        now = np.clip(now, bounds.lower, bounds.upper)
        out = PAIN.signed_distance(now) > 0
        owner, number, now = owner[out], number[out], now[out]
    return np.isin(np.arange(len(states)), owner)


@pytest.mark.long
def test_no_switching_saves_a_state_that_no_constant_control_saves():
    states = np.random.default_rng(0).uniform([-1, -2, 6, -3], [1, 2, 10, 3], (20_000, 4))
    value = escape_value(TELESCOPE, PAIN, states, 5.0, 0.025)
    away = PAIN.signed_distance(states) > 0
    doomed, safe = (states[away & (np.abs(value - middle) < 0.03)][:12] for middle in (-0.05, 0.05))
    assert len(doomed) == len(safe) == 12
    assert not np.any(survivors(doomed))
    assert np.all(survivors(safe))


def test_the_value_falls_with_the_horizon_until_it_stands_still():
    states = np.random.default_rng(1).uniform([-1, -2, 6, -3], [1, 2, 10, 3], (2000, 4))
    values = [escape_value(TELESCOPE, PAIN, states, tau, 0.05) for tau in (0.05, 0.5, 2.5, 5.0)]
    assert np.all(values[0] <= PAIN.signed_distance(states))
    assert np.all(values[1] <= values[0])
    assert np.any(values[1] < values[0] - 0.1)
    np.testing.assert_array_equal(values[2], values[3])


def test_a_table_of_values_comes_closer_with_its_cells():
    states = np.random.default_rng(2).uniform([-1, -2, 6, -3], [1, 2, 10, 3], (1000, 4))
    exact = escape_value(TELESCOPE, PAIN, states, 5.0, 0.05)
    near = np.abs(exact) < 0.1
    errors = []
    for shape in ((9, 7, 9, 7), (17, 13, 17, 13)):
        table = tabulate_escapes(TELESCOPE, Grid(TELESCOPE.space, shape), PAIN, horizon=5.0)
        errors.append(np.abs(table.value(states) - exact)[near].mean())
    assert errors[1] < 0.6 * errors[0] < 0.06


def least_distances(system, keep_out, states, seconds, dt):
    """The best corner's least sampled distance; rates across a bound are stopped."""
    lower, upper = system.space.bounds.lower, system.space.bounds.upper
    lower = np.where(system.space.periodic, -FREE, lower)
    upper = np.where(system.space.periodic, FREE, upper)
    best = np.full(len(states), -np.inf)
    for control in system.control_box.vertices():
        now, least = states, keep_out.signed_distance(states)
        for _ in range(round(seconds / dt)):
            half = system.dynamics(now, control) * dt / 2
            ahead = system.dynamics(np.clip(now + half, lower, upper), control)
            now = np.clip(now + dt * ahead, lower, upper)
            least = np.minimum(least, keep_out.signed_distance(now))
        best = np.maximum(best, least)
    return best


PENDULUM = Pendulum(control_limit=0.5)
TWO_PARTS = Regions(PENDULUM.space, [[np.pi, 0.0], [1.0, -1.0]], [[1.2 * np.pi, 1.2], [1.2, -0.8]])
ROUND_THE_SEAM = Regions(PENDULUM.space, [[-0.4, -0.5]], [[0.2, 1.2]])


@pytest.mark.parametrize(
    ("system", "keep_out", "shape", "enough"),
    [
        (TELESCOPE, PAIN, (13, 7, 9, 7), 2 * 6 / 9),  # a cell is wider than K is deep
        (PENDULUM, ROUND_THE_SEAM, (41, 41), 0.6),
    ],
)
def test_a_table_holds_v_at_every_centre_up_to_twice_the_depth_of_k(
    system, keep_out, shape, enough
):
    grid = Grid(system.space, shape)
    table = tabulate_escapes(system, grid, keep_out, horizon=3.0)
    step = _step_for(system, grid, keep_out, 3.0)
    exact = escape_value(system, keep_out, grid.centers, 3.0, step)
    assert np.max(table.values) == pytest.approx(enough)
    assert 0.05 < np.mean(table.values < enough) < 0.9
    np.testing.assert_allclose(table.values, np.minimum(exact, enough), rtol=1e-12, atol=1e-12)
    assert np.any((table.values < enough) & (keep_out.signed_distance(grid.centers) > enough))


@pytest.mark.parametrize("step", [0.1, 0.05])
@pytest.mark.parametrize(
    ("system", "keep_out", "corner"),
    [(TELESCOPE, PAIN, [1.0, 2.0, 10.0, 3.0]), (PENDULUM, TWO_PARTS, [2 * np.pi, 3.0])],
)
def test_no_state_with_a_value_above_zero_is_doomed_at_a_ten_times_finer_step(
    system, keep_out, corner, step
):
    corner = np.array(corner)
    states = np.random.default_rng(0).uniform(-corner, corner, (6000, len(corner)))
    if system is TELESCOPE:
        states[:, 2] = 8 + states[:, 2] / 5
    value = escape_value(system, keep_out, states, 3.0, step)
    near = np.abs(value) < 0.1
    exact = least_distances(system, keep_out, states[near], 3.0, step / 10)
    assert np.sum(exact < 0) > 30
    assert not np.any((value[near] >= 0) & (exact < 0))
    assert np.all(value[near] < exact + 2e-4)  # of the coarser oracle
    assert np.mean(exact - value[near]) < 4 * step**2


@dataclass(frozen=True, eq=False)
class Stream(System):
    """x' = 10, y' = u, and x goes round: the samples of a motion lie far apart."""

    rise: float = 0.0

    space = StateSpace(Box([-3.0, -3.0], [3.0, 3.0]), [True, False], ("x", "y"))

    @property
    def control_box(self):
        return Box([self.rise - 0.1], [self.rise + 0.1])

    def dynamics(self, states, controls):
        rates = 10.0 + 0 * states[..., 0], controls[..., 0]
        return np.stack(np.broadcast_arrays(*rates), axis=-1)


def test_a_motion_that_leaps_over_k_between_two_samples_is_doomed():
    needle = Regions(Stream.space, [[0.0, -1.0]], [[0.01, 1.0]])
    states = np.array([[-0.5, 0.5], [-0.5, 1.5], [0.5, 0.5], [2.9, 1.2]])
    value = escape_value(Stream(), needle, states, 0.1, 0.1)
    assert value[0] == pytest.approx(-0.005, abs=1e-9)
    # The second rises as it goes by; the third goes away, round the seam; the fourth as well.
    assert value[1] == pytest.approx(0.505, abs=1e-3)
    assert value[2] == pytest.approx(0.49)
    assert 1.9 < value[3] < np.hypot(2.1, 0.21) + 1e-9


def test_a_motion_may_be_closest_where_the_short_way_round_changes_sides():
    box = Regions(Stream.space, [[-0.1, -0.1]], [[0.1, 0.1]])
    value = escape_value(Stream(rise=-80.0), box, np.array([[2.9, 2.0]]), 0.05, 0.05)
    assert 1.0 < value[0] < 6 - 3.15 - 0.1 + 0.01


def test_a_step_serves_any_horizon():
    table = tabulate_escapes(MASSES, Grid(MASSES.space, (9, 7, 2, 2)), wall(0), horizon=3.017)
    exact = braking_value(*table.grid.centers[:, :2].T, 1.0)
    near = np.abs(exact) < 0.5
    loss = (exact - table.values)[near]
    assert np.all(loss > -1e-9)
    assert np.all(loss < 0.2 * 6 / 9)


def test_a_step_that_does_not_divide_the_horizon_is_refused():
    with pytest.raises(ValueError, match=r"0\.3 s does not divide the horizon of 5\.0 s"):
        escape_value(TELESCOPE, PAIN, np.zeros((1, 4)), 5.0, 0.3)


def test_dynamics_that_are_not_affine_in_the_control_are_refused():
    # Their best control need not be a corner of the control box.
    space = StateSpace(Box([-1, -1], [1, 1]), np.zeros(2, dtype=bool), ("x", "v"))

    def rates(states, controls):
        return states[..., 1], np.cos(3 * controls[..., 0])

    system = FunctionSystem(rates, space, Box([-2], [2]))
    wall = Regions(space, [[0.5, -FREE]], [[1.0, FREE]])
    with pytest.raises(ValueError, match="dynamics is not affine"):
        tabulate_escapes(system, Grid(space, (5, 5)), wall, horizon=1.0)
