from functools import cache

import numpy as np
import pytest

from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import SafeSet, solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import EULER, RK4, euler_step
from mlci.systems import DoubleIntegrator, Pendulum

PENDULUM = Pendulum()
DT = 0.01
BOTTOM = ((np.pi, 0.0), (1.2 * np.pi, 1.2))
SIDE = ((1.6 * np.pi, 0.0), (1.8 * np.pi, 1.2))
WALL = ((np.pi, -np.inf), (1.2 * np.pi, np.inf))
WIDTHS = [0.0, 0.2]


def region(corners):
    return Regions(PENDULUM.space, [corners[0]], [corners[1]])


@cache
def safe_set(corners, control_limit=2.0, count=101):
    system = Pendulum(control_limit=control_limit)
    return solve_safe_set(system, Grid(system.space, (count, count)), region(corners))


def near_border(omega, margin, count, seed=0):
    """States (count, 2) whose V is just above the margin."""
    bounds = omega.grid.space.bounds
    states = np.random.default_rng(seed).uniform(bounds.lower, bounds.upper, (count * 500, 2))
    value = omega.value(states)
    return states[(value >= margin) & (value < margin + 0.05)][:count]


def nominal_controls(system, omega, states, rng):
    """A quarter of the states each: mild and strong random, extreme and magnified worst case."""
    kind = np.arange(len(states)) * 4 // len(states)
    limit = system.control_limit
    size = np.choose(kind, [2.0, 10.0, limit, 10.0])
    worst = -np.where(omega.gradient(states)[:, 1] >= 0, 1.0, -1.0)
    return (size * np.where(kind < 2, rng.uniform(-1, 1, len(states)), worst))[:, None]


def entries(safety, corners, runs, seconds=5.0):
    """How many filtered runs from the border enter K, tested between the samples too."""
    system, omega, keep_out = safety.system, safety.safe_set, region(corners)
    rng = np.random.default_rng(1)
    path = [near_border(omega, safety.margin, runs)]
    assert len(path[0]) == runs
    for _ in range(round(seconds / DT)):
        nominal = nominal_controls(system, omega, path[-1], rng)
        path.append(euler_step(system, path[-1], safety.apply(path[-1], nominal), DT))
    paths = np.stack(path, axis=1)
    entered = keep_out.violated_by(paths)[:, 0]
    starts, steps = paths[:, :-1], np.diff(paths, axis=1)
    close = keep_out.signed_distance(starts) < 2 * np.linalg.norm(steps, axis=-1)
    for share in np.arange(10) / 10:
        distance = keep_out.signed_distance(starts[close] + share * steps[close])
        entered[np.nonzero(close)[0][distance < -1e-12]] = True
    return int(entered.sum())


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("corners", [BOTTOM, SIDE])
@pytest.mark.long
def test_no_run_of_ten_thousand_enters(corners, width):
    omega = safe_set(corners)
    margin = border_margin(PENDULUM, omega, DT)
    assert entries(SafetyFilter(PENDULUM, omega, DT, margin, width), corners, 2500) == 0


@pytest.mark.parametrize("corners", [BOTTOM, SIDE])
def test_runs_enter_without_a_margin(corners):
    assert entries(SafetyFilter(PENDULUM, safe_set(corners), DT, 0.0), corners, 200) > 10


@pytest.mark.parametrize(("corners", "control_limit"), [(WALL, 2.0), (BOTTOM, 0.5), (SIDE, 0.5)])
def test_the_margin_serves_other_truths_and_weaker_controls(corners, control_limit):
    system, omega = Pendulum(control_limit=control_limit), safe_set(corners, control_limit)
    margin = border_margin(system, omega, DT)
    assert entries(SafetyFilter(system, omega, DT, margin), corners, 400) == 0


def test_the_margin_is_a_cell_and_a_hold_of_the_value():
    # V = x moves at v, at most 2. Far from its border, at x = 0, a steeper V must not count.
    system = DoubleIntegrator(speed_limit=2.0)
    grid = Grid(system.space, (60, 40))
    slope = np.where(np.abs(grid.centers[:, :1]) > 2.5, 5.0, 1.0) * np.array([1.0, 0.0])
    fastest = 2.0 - grid.widths[1] / 2
    omega = SafeSet(grid, grid.centers[:, 0], slope)
    assert border_margin(system, omega, DT) == pytest.approx(grid.widths[0] + DT * fastest)
    nowhere = SafeSet(grid, grid.centers[:, 0] + 10, slope)
    assert border_margin(system, nowhere, DT) == 0


def test_a_value_that_jumps_at_the_border_has_no_margin():
    weak = Pendulum(control_limit=0.5)
    with pytest.raises(ValueError, match=r"largest value .*choose a margin by hand"):
        border_margin(weak, safe_set(WALL, 0.5, 31), DT)


@pytest.mark.parametrize("width", WIDTHS)
def test_far_from_the_border_every_control_is_free(width):
    omega = safe_set(BOTTOM)
    rng = np.random.default_rng(0)
    states = rng.uniform([0, -6], [2 * np.pi, 6], (3, 400, 2))
    controls = rng.uniform(-8, 8, (3, 400, 1))
    safety = SafetyFilter(PENDULUM, omega, DT, 0.1, width)
    ahead = omega.value(euler_step(PENDULUM, states, controls, DT))
    free, forced = ahead >= 0.1 + width, ahead < 0.1
    assert free.sum() > 1000
    assert forced.sum() > 10
    applied = safety.apply(states, controls)
    np.testing.assert_array_equal(applied[free], controls[free])
    np.testing.assert_array_equal(applied[forced], omega.safe_control(PENDULUM, states[forced]))
    by_state, by_control = safety.linearize(states, controls)
    assert by_state.shape == (3, 400, 1, 2)
    assert by_control.shape == (3, 400, 1, 1)
    assert np.all(by_state[free | forced] == 0)
    assert np.all(by_control[free] == 1)
    assert np.all(by_control[forced] == 0)


def test_the_blend_rises_from_the_safe_to_the_nominal_control():
    omega, margin, width = safe_set(BOTTOM), 0.1, 0.3
    safety = SafetyFilter(PENDULUM, omega, DT, margin, width)
    # A line of states below K that climbs straight away from it: V there is the distance.
    states = np.stack([np.full(200, 3.5), np.linspace(-0.5, -0.05, 200)], axis=1)
    controls = np.full((200, 1), 7.0)
    safe = omega.safe_control(PENDULUM, states)
    share = ((safety.apply(states, controls) - safe) / (controls - safe))[:, 0]
    room = (omega.value(euler_step(PENDULUM, states, controls, DT)) - margin) / width
    assert np.all(np.diff(share) <= 0)
    assert share[0] == 1
    assert share[-1] == 0
    halfway = np.argmin(np.abs(room - 0.5))
    assert share[halfway] == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(("integrator", "dt"), [(EULER, DT), (RK4, 0.1)])
def test_linearize_matches_finite_differences_of_apply(integrator, dt):
    omega, step = safe_set(SIDE), 1e-6
    safety = SafetyFilter(PENDULUM, omega, dt, 0.1, 0.4, integrator)
    rng = np.random.default_rng(2)
    states = near_border(omega, 0.3, 400)
    controls = rng.uniform(-8, 8, (len(states), 1))
    by_state, by_control = safety.linearize(states, controls)
    # The interpolant has kinks at cell centres, and u* jumps: keep away from both.
    position = (integrator.step(PENDULUM, states, controls, dt) / omega.grid.widths) % 1.0 - 0.5
    smooth = np.all(np.abs(position) > 1e-3, axis=1)
    best = omega.safe_control(PENDULUM, states)
    for d in range(2):
        push = 1e-3 * np.eye(2)[d]
        for there in (states - push, states + push):
            smooth &= (omega.safe_control(PENDULUM, there) == best)[:, 0]
    assert smooth.sum() > 300
    assert np.mean(by_state[smooth] != 0) > 0.5
    for d in range(2):
        push = step * np.eye(2)[d]
        change = safety.apply(states + push, controls) - safety.apply(states - push, controls)
        np.testing.assert_allclose(
            by_state[smooth, :, d], change[smooth] / (2 * step), rtol=1e-5, atol=1e-6
        )
    change = safety.apply(states, controls + step) - safety.apply(states, controls - step)
    np.testing.assert_allclose(by_control[smooth, :, 0], change[smooth] / (2 * step), rtol=1e-5)


def test_a_filter_looks_one_step_of_its_integrator_ahead():
    omega, margin, dt = safe_set(SIDE), 0.1, 0.3  # long enough for the steps to part
    states = near_border(omega, 0.3, 400)
    controls = np.random.default_rng(3).uniform(-8, 8, (400, 1))
    free = {}
    for integrator in (EULER, RK4):
        safety = SafetyFilter(PENDULUM, omega, dt, margin, integrator=integrator)
        free[integrator] = (safety.apply(states, controls) == controls)[:, 0]
        ahead = integrator.step(PENDULUM, states, controls, dt)
        np.testing.assert_array_equal(free[integrator], omega.value(ahead) >= margin)
    assert np.any(free[EULER] != free[RK4])


def test_impossible_filters_are_refused():
    omega = safe_set(BOTTOM)
    with pytest.raises(ValueError, match="hold must be positive, not 0 s"):
        SafetyFilter(PENDULUM, omega, 0, 0.1)
    with pytest.raises(ValueError, match=r"at least 0, not -0\.1 and 0\.0"):
        SafetyFilter(PENDULUM, omega, DT, -0.1)
    with pytest.raises(ValueError, match=r"at least 0, not 0\.1 and -1"):
        SafetyFilter(PENDULUM, omega, DT, 0.1, -1)


@pytest.mark.parametrize("width", WIDTHS)
def test_clearance_is_how_far_a_state_may_move_before_the_filter_acts(width: float) -> None:
    """Where V falls as steeply as anywhere, straight towards K, no farther and no less far."""
    system = DoubleIntegrator()
    grid = Grid(system.space, (31, 31))
    omega = SafeSet.from_values(grid, 2 * grid.centers[:, 0])
    keep_in = SafetyFilter(system, omega, DT, margin=0.1, width=width)
    states = np.column_stack([np.linspace(0.5, 2.0, 7), np.linspace(-1.0, 1.0, 7)])
    clearance = keep_in.clearance(states)
    np.testing.assert_allclose(clearance, states[:, 0] - (0.1 + width) / 2, rtol=1e-12)
    away = -omega.safe_control(system, states)
    for share, acts in ((0.999, False), (1.001, True)):
        ahead = states - share * clearance[:, None] * [1.0, 0.0]
        changed = (keep_in.apply(states, away, ahead) != away).any(axis=1)
        assert (changed == acts).all()
