from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, lsq_linear

from mlci.control.control_problem import ControlFilter
from mlci.control.ilqr import optimize
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import SafeSet, solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import EULER, RK4, euler_step, rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, Pendulum, System

PENDULUM = Pendulum()
MASS = DoubleIntegrator()
DT = 0.01


@dataclass(frozen=True, eq=False)
class Linear(System):
    """x' = drift x + push u, with two states and three controls."""

    drift: np.ndarray
    push: np.ndarray

    space = StateSpace(Box(-np.ones(2), np.ones(2)), np.zeros(2, dtype=bool), ("a", "b"))
    control_box = Box(-np.ones(3), np.ones(3))

    def dynamics(self, states, controls):
        return states @ self.drift.T + controls @ self.push.T

    def jacobians(self, states, controls):
        batch = states.shape[:-1]
        return (
            np.broadcast_to(self.drift, (*batch, 2, 2)),
            np.broadcast_to(self.push, (*batch, 2, 3)),
        )


def solve_one(system, start, goal, controls, dt=DT, **options):
    """A batch of one, to a goal that is a point."""
    start, goal = np.array([start], dtype=float), np.array([goal], dtype=float)
    return optimize(system, start, goal, goal, np.array([controls]), dt, **options)


def held_controls(rng, batch, holds, each):
    """Random controls (batch, holds * each, 1), each held."""
    return np.repeat(rng.uniform(-2, 2, (batch, holds, 1)), each, axis=1)


def test_one_iteration_solves_a_linear_quadratic_problem():
    rng = np.random.default_rng(0)
    system = Linear(rng.normal(size=(2, 2)), rng.normal(size=(2, 3)))
    steps, dt, weight = 40, 0.05, 7.0
    start, goal = rng.normal(size=2), rng.normal(size=2)
    # The last state is affine in all controls: x_K = free + reach u, so (8) is ridge regression.
    basis = np.eye(steps * 3).reshape(-1, steps, 3)
    free = rollout(system, start, np.zeros((steps, 3)), dt, step=euler_step)[-1]
    ends = rollout(system, np.tile(start, (steps * 3, 1)), basis, dt, step=euler_step)[:, -1]
    reach = (ends - free).T
    hessian = dt * np.eye(steps * 3) + weight * reach.T @ reach
    exact = np.linalg.solve(hessian, weight * reach.T @ (goal - free)).reshape(steps, 3)
    guess = rng.normal(size=(steps, 3))
    found = solve_one(system, start, goal, guess, dt, goal_weight=weight, iterations=1)
    np.testing.assert_allclose(found.controls[0], exact, atol=1e-6)


def test_limited_controls_solve_a_bounded_least_squares_problem():
    rng = np.random.default_rng(3)
    system = Linear(rng.normal(size=(2, 2)), rng.normal(size=(2, 3)))
    steps, dt, weight = 30, 0.05, 50.0
    start, goal = rng.normal(size=2), 4 * rng.normal(size=2)
    basis = np.eye(steps * 3).reshape(-1, steps, 3)
    free = rollout(system, start, np.zeros((steps, 3)), dt, step=euler_step)[-1]
    ends = rollout(system, np.tile(start, (steps * 3, 1)), basis, dt, step=euler_step)[:, -1]
    rows = np.vstack([np.sqrt(dt) * np.eye(steps * 3), np.sqrt(weight) * (ends - free).T])
    wanted = np.append(np.zeros(steps * 3), np.sqrt(weight) * (goal - free))
    exact = lsq_linear(rows, wanted, bounds=(-1, 1), tol=1e-12).x.reshape(steps, 3)
    at_ends = np.abs(exact) > 1 - 1e-6
    assert 0.1 < np.mean(at_ends) < 0.9
    guess = rng.uniform(-1, 1, size=(steps, 3))
    found = solve_one(
        system,
        start,
        goal,
        guess,
        dt,
        goal_weight=weight,
        iterations=60,
        limit=system.control_box,
        tolerance=1e-15,
    )
    assert np.max(np.abs(found.controls)) <= 1
    np.testing.assert_allclose(found.controls[0], exact, atol=1e-4)


def test_limited_mass_saturates_as_pontryagin_says():
    # u = clip(slope (T / 2 - t)) between rest and rest, with the slope that covers the distance.
    time, limit, distance = (np.arange(250) + 0.5) * DT, 1.0, 1.5

    def covered(slope):
        controls = np.clip(slope * (1.25 - time), -limit, limit)
        return np.sum(controls * (2.5 - time)) * DT

    slope = brentq(lambda slope: covered(slope) - distance, 0.1, 100)
    exact = np.clip(slope * (1.25 - time), -limit, limit)
    options = {"goal_weight": 1e4, "iterations": 30, "limit": MASS.control_box}
    found = solve_one(MASS, [0, 0], [distance, 0], np.full((250, 1), 0.3), **options)
    assert np.mean(np.abs(exact) == limit) > 0.3
    np.testing.assert_allclose(found.controls[0, :, 0], exact, atol=0.02)
    assert np.sum(found.controls**2) * DT == pytest.approx(np.sum(exact**2) * DT, rel=2e-3)


def test_goal_without_winding_is_the_one_nearest_to_the_start():
    rng = np.random.default_rng(5)
    starts = np.stack([rng.uniform(-9, 9, 40), rng.uniform(-1, 1, 40)], axis=1)
    goals = np.stack([rng.uniform(0, 2 * np.pi, 40), np.zeros(40)], axis=1)
    guesses = np.repeat(rng.choice([-2.0, 2.0], (40, 1, 1)), 100, axis=1)  # over the top
    turns = {}
    for wind in (True, False):
        found = optimize(PENDULUM, starts, goals, goals, guesses, 0.05, wind=wind, iterations=20)
        way = found.states[:, -1, 0] - starts[:, 0]
        nearest = np.mod(goals[:, 0] - starts[:, 0] + np.pi, 2 * np.pi) - np.pi
        reached = np.linalg.norm(found.excess, axis=1) < 0.05
        assert np.mean(reached) > 0.7
        turns[wind] = np.abs(way - nearest)[reached] / (2 * np.pi)
        np.testing.assert_allclose(turns[wind], np.round(turns[wind]), atol=0.01)
        ends = np.sum(found.controls**2, axis=(1, 2)) * 0.05 + 300 * np.sum(found.excess**2, axis=1)
        np.testing.assert_allclose(found.cost, ends)
    assert np.max(turns[False]) < 0.01
    assert np.mean(turns[True] > 0.5) > 0.2


def swing_by_pontryagin(motion):
    """Fine times, and states and costates (4, .) of the swing from (0.5, 0) to (3, 0) in 5 s."""

    def ends(first, last):
        return np.array([first[0] - 0.5, first[1], last[0] - 3.0, last[1]])

    time = np.linspace(0, 5, 200)
    line = np.stack([np.linspace(0.5, 3, 200), np.full(200, 0.5), 0 * time, 0 * time])
    exact = solve_bvp(motion, ends, time, line, tol=1e-8, max_nodes=100_000)
    assert exact.success
    fine = np.linspace(0, 5, 20_001)
    return fine, exact.sol(fine)


@pytest.fixture(scope="module")
def swing_effort():
    """Effort of the cheapest swing from (0.5, 0) to (3, 0) in 5 s, by Pontryagin's conditions."""

    # Minimum of int u^2: u = -q / 2, with costates p' = -q cos(theta), q' = -p.
    def motion(_, y):
        angle, speed, p, q = y
        return np.stack([speed, np.sin(angle) - q / 2, -q * np.cos(angle), -p])

    fine, path = swing_by_pontryagin(motion)
    effort = np.trapezoid((path[3] / 2) ** 2, fine)
    assert effort == pytest.approx(2.3849, abs=1e-4)
    return effort


def test_swing_costs_what_pontryagin_says(swing_effort):
    found = solve_one(PENDULUM, [0.5, 0], [3, 0], np.zeros((500, 1)), iterations=30)
    assert np.sum(found.controls**2) * DT == pytest.approx(swing_effort, rel=0.01)
    assert np.linalg.norm(found.states[0, -1] - [3, 0]) < 0.05
    applied = rollout(PENDULUM, [0.5, 0], found.controls[0], DT, step=euler_step)
    np.testing.assert_allclose(found.states[0], applied, atol=1e-12)


@dataclass(frozen=True, eq=False)
class Quadratic(Linear):
    """With r = -(1/2) z' cost z - slope . z, where z = (x, u)."""

    cost: np.ndarray
    slope: np.ndarray

    def running_reward(self, states, controls):
        z = np.concatenate([states, controls], axis=-1)
        return -np.einsum("...i,ij,...j->...", z, self.cost, z) / 2 - z @ self.slope


def test_one_iteration_solves_a_linear_problem_with_a_quadratic_reward_of_state_and_control():
    rng = np.random.default_rng(4)
    root = rng.normal(size=(5, 5))
    system = Quadratic(
        rng.normal(size=(2, 2)), rng.normal(size=(2, 3)), root @ root.T, rng.normal(size=5)
    )
    steps, dt, weight = 30, 0.05, 7.0
    start, goal, guess = rng.normal(size=2), rng.normal(size=2), rng.normal(size=(steps, 3))
    # All z = (x_k, u_k) are affine in all controls: z = free + reach u.
    basis = np.eye(steps * 3).reshape(-1, steps, 3)
    still = rollout(system, start, np.zeros((steps, 3)), dt, step=euler_step)
    moved = rollout(system, np.tile(start, (steps * 3, 1)), basis, dt, step=euler_step) - still
    reach = np.concatenate([moved[:, :-1], basis], axis=-1)
    free = np.concatenate([still[:-1], np.zeros((steps, 3))], axis=-1)
    hessian = dt * np.einsum("aki,ij,bkj->ab", reach, system.cost, reach)
    hessian += 2 * weight * moved[:, -1] @ moved[:, -1].T
    slope = dt * np.einsum("aki,ki->a", reach, free @ system.cost + system.slope)
    slope += 2 * weight * moved[:, -1] @ (still[-1] - goal)
    exact = -np.linalg.solve(hessian, slope).reshape(steps, 3)
    solution = solve_one(system, start, goal, guess, dt, goal_weight=weight, iterations=1)
    np.testing.assert_allclose(solution.controls[0], exact, atol=1e-5)


class Upright(Pendulum):
    """Pays for leaning as well: concave in the angle, seen as a cost, below the horizontal."""

    def running_reward(self, states, controls):
        return -(controls[..., 0] ** 2 + 1 - np.cos(states[..., 0]))

    @staticmethod
    def control(q):
        return -q / 2

    slope = staticmethod(np.sin)  # of the state's cost, by the angle


class Gentle(Pendulum):
    """Finds strong controls dearer than their square."""

    def running_reward(self, states, controls):
        return -(controls[..., 0] ** 2 + controls[..., 0] ** 4 / 4)

    @staticmethod
    def control(q):
        root = np.sqrt(q**2 / 4 + 8 / 27)  # Cardano's for u^3 + 2 u + q = 0
        return np.cbrt(-q / 2 + root) + np.cbrt(-q / 2 - root)

    slope = staticmethod(np.zeros_like)


@pytest.mark.parametrize("system", [Upright(), Gentle()], ids=lambda each: type(each).__name__)
@pytest.mark.long
def test_swing_with_a_reward_of_its_own_is_the_one_that_pontryagin_says(system):
    # Minimum of -int r: d(-r)/du = -q, with costates p' = d r/d theta - q cos(theta), q' = -p.
    def motion(_, y):
        angle, speed, p, q = y
        pull = -q * np.cos(angle) - system.slope(angle)
        return np.stack([speed, np.sin(angle) + system.control(q), pull, -p])

    fine, path = swing_by_pontryagin(motion)
    controls = system.control(path[3])
    cost = np.trapezoid(-system.running_reward(path[:2].T, controls[:, None]), fine)
    # What |u|^2 alone would choose costs more by far than the tolerances below.
    plain = solve_one(PENDULUM, [0.5, 0], [3, 0], np.zeros((100, 1)), 0.05, iterations=30)
    assert np.max(np.abs(plain.controls[0, :, 0] - controls[:-1:200])) > 0.2

    costs = []
    for dt in (0.02, 0.01):
        guess = np.zeros((round(5 / dt), 1))
        options = {"goal_weight": 1e5, "iterations": 50}
        solution = solve_one(system, [0.5, 0], [3, 0], guess, dt, **options)
        costs.append(solution.cost[0])
        held = solution.controls[0, :, 0] - controls[: -1 : round(dt / 0.00025)]
        # A control held for dt differs from the continuous one by about |u'| dt, with |u'| <= 2.
        assert np.max(np.abs(held)) < 2 * dt
    # Euler's step errs by the first order in dt, which two steps of it cancel; what is left is of
    # the second order, and what the goal's price lets the end miss, |p|^2 / (4 * 1e5).
    assert 2 * costs[1] - costs[0] == pytest.approx(cost, rel=3e-5)


def test_scale_of_a_reward_is_no_matter():
    @dataclass(frozen=True)
    class Dear(Pendulum):
        price: float = 1.0

        def running_reward(self, states, controls):
            return -self.price * np.square(controls[..., 0])

        def reward_derivatives(self, states, controls):
            gradient, hessian = Pendulum().reward_derivatives(states, controls)
            return self.price * gradient, self.price * hessian

    guess, power = np.full((200, 1), 0.7), 2.0**20  # whose products are exact
    once = solve_one(Dear(), [0.5, 0], [3, 0], guess)
    more = solve_one(Dear(price=power), [0.5, 0], [3, 0], guess, goal_weight=300 * power)
    np.testing.assert_array_equal(more.controls, once.controls)
    np.testing.assert_array_equal(more.costs, power * once.costs)
    np.testing.assert_array_equal(
        once.controls, solve_one(PENDULUM, [0.5, 0], [3, 0], guess).controls
    )


class Curious(Pendulum):
    """Likes some of the controls that it does not like: -r is not convex, in u, x, or both."""

    def running_reward(self, states, controls):
        u, speed = controls[..., 0], states[..., 1]
        return 0.5 * np.cos(3 * u) - 0.1 * u**2 + 0.4 * u * speed - 0.2 * speed**2


def test_reward_that_is_not_concave_is_improved_nevertheless():
    rng = np.random.default_rng(6)
    starts, goals = rng.uniform([0, -1], [2 * np.pi, 1], (2, 20, 2))
    guesses = held_controls(rng, 20, 10, 30)
    solution = optimize(Curious(), starts, goals, goals, guesses, DT, iterations=8)
    assert np.all(np.diff(solution.costs, axis=0) <= 0)
    # Every step is downhill, so that a short one succeeds at once.
    assert np.all(np.diff(solution.costs[:4], axis=0) < 0)


def test_reward_of_states_alone_is_optimised():
    # Nothing is paid for the control, so that the limit alone holds it back: full throttle.
    class Eager(DoubleIntegrator):
        def running_reward(self, states, controls):
            return states[..., 1]

    free = np.array([[-np.inf, -np.inf]])
    solution = optimize(
        *(Eager(), np.zeros((1, 2)), free, -free, np.zeros((1, 100, 1)), DT), limit=MASS.control_box
    )
    np.testing.assert_allclose(solution.controls[0, :-1], 1.0)  # the last one moves no state
    assert solution.cost[0] == pytest.approx(-0.5 * (1 - DT))


@pytest.mark.parametrize(
    ("integrator", "order", "steps", "bias"),
    # A held control is itself of the second order.
    [(EULER, 1, (50, 100, 200), 0.02), (RK4, 2, (25, 50, 100), 2e-4)],
    ids=["Euler", "Runge-Kutta"],
)
@pytest.mark.long
def test_effort_comes_closer_with_the_integrators_order(
    swing_effort, integrator, order, steps, bias
):
    errors = []
    for count in steps:
        guess, dt = np.zeros((count, 1)), 5 / count
        options = {"goal_weight": 1e5, "iterations": 100, "tolerance": 1e-12}
        solution = solve_one(
            PENDULUM, [0.5, 0], [3, 0], guess, dt, integrator=integrator, **options
        )
        errors.append(np.sum(solution.controls**2) * dt / swing_effort - 1)
        again = rollout(PENDULUM, [0.5, 0], solution.controls[0], dt, step=integrator.step)
        np.testing.assert_allclose(solution.states[0], again, atol=1e-12)
    slope = -np.polyfit(np.log(steps), np.log(np.abs(errors)), 1)[0]
    assert slope == pytest.approx(order, abs=0.2)
    assert np.abs(errors[-1]) < bias


@pytest.mark.parametrize(
    ("lower", "upper", "effort"),
    [
        ([1.0, 0.0], [1.0, 0.0], 12 / 8),  # 12 d^2 / T^3 from rest to rest
        ([1.0, -np.inf], [1.0, np.inf], 3 / 8),  # 3 d^2 / T^3 with a free last velocity
        ([1.0, -np.inf], [2.0, np.inf], 3 / 8),  # the near side of a range
        ([-3.0, -np.inf], [-2.0, np.inf], 3 * 4 / 8),
        ([-1.0, -0.5], [2.0, 0.5], 0.0),  # the goal holds the start
        ([-np.inf, -np.inf], [np.inf, np.inf], 0.0),
    ],
)
def test_goals_that_are_points_ranges_or_free(lower, upper, effort):
    found = optimize(
        MASS,
        np.zeros((1, 2)),
        np.array([lower]),
        np.array([upper]),
        np.full((1, 200, 1), 0.3),
        DT,
        goal_weight=1e4,
        iterations=20,
    )
    assert np.sum(found.controls**2) * DT == pytest.approx(effort, rel=0.02, abs=1e-6)


def test_cost_is_effort_plus_the_goals_price():
    rng = np.random.default_rng(1)
    starts, guesses = rng.uniform(-2, 2, (4, 2)), held_controls(rng, 4, 3, 10)
    goals = [
        Box.point([3.0, 0.5]),
        Box.point([3.0 - 4 * np.pi, 0.5]),
        Box(np.array([6.0, -np.inf]), np.array([6.5, np.inf])),
        Box(np.array([-np.inf, 1.0]), np.array([np.inf, 1.5])),
    ]
    lower, upper = np.array([g.lower for g in goals]), np.array([g.upper for g in goals])
    found = optimize(PENDULUM, starts, lower, upper, guesses, DT, goal_weight=50.0, iterations=0)
    for b, goal in enumerate(goals):
        last = rollout(PENDULUM, starts[b], guesses[b], DT, step=euler_step)[-1]
        price = 50 * np.sum(PENDULUM.space.excess(last, goal) ** 2)
        assert found.cost[b] == pytest.approx(np.sum(guesses[b] ** 2) * DT + price, rel=1e-12)


@pytest.fixture(scope="module")
def safety_filter():
    truth = Box(np.array([np.pi, 0.0]), np.array([1.2 * np.pi, 1.2]))
    grid = Grid(PENDULUM.space, (61, 61))
    safe_set = solve_safe_set(PENDULUM, grid, Regions.from_boxes(PENDULUM.space, [truth]))
    return SafetyFilter(PENDULUM, safe_set, DT, border_margin(PENDULUM, safe_set, DT), 0.2)


def test_cost_never_rises_and_no_member_sees_another(safety_filter):
    rng = np.random.default_rng(2)
    starts, goals = rng.uniform([0, -2], [2 * np.pi, 2], (2, 3, 2))
    guesses = held_controls(rng, 3, 5, 40)
    options = {"safety_filter": safety_filter, "iterations": 8}
    together = optimize(PENDULUM, starts, goals, goals, guesses, DT, **options)
    assert np.all(np.diff(together.costs, axis=0) <= 0)
    assert np.median(together.costs[-1] / together.costs[0]) < 0.05
    for b in range(3):
        alone = solve_one(PENDULUM, starts[b], goals[b], guesses[b], **options)
        np.testing.assert_allclose(alone.states[0], together.states[b], atol=1e-9)
        np.testing.assert_allclose(alone.controls[0], together.controls[b], atol=1e-9)


class Saturation(ControlFilter):
    """v = 2 tanh((u + tilt . x) / 2): smooth, invertible, and different at every state."""

    tilt = np.array([0.8, -0.5])

    def apply(self, states, controls, ahead=None):
        return 2 * np.tanh((controls + (states @ self.tilt)[..., None]) / 2)

    def linearize(self, states, controls):
        slope = 1 - (self.apply(states, controls) / 2) ** 2
        return slope[..., None] * self.tilt, slope[..., None]


def test_filter_is_part_of_the_optimised_motion():
    # Every applied control within (-2, 2) can still be had, so the optimum is the same.
    guess = np.full((200, 1), 0.1)
    free = solve_one(MASS, [0, 0], [1, 0], guess)
    bent = solve_one(MASS, [0, 0], [1, 0], guess, safety_filter=Saturation())
    assert np.max(free.controls) > 1.4
    assert bent.cost == pytest.approx(free.cost, rel=1e-8)
    np.testing.assert_allclose(bent.controls, free.controls, atol=1e-3)
    again = rollout(MASS, [0, 0], bent.controls[0], DT, step=euler_step)
    np.testing.assert_allclose(bent.states[0], again, atol=1e-12)


class Override(ControlFilter):
    """Every control is replaced by 0, as by a hard switch that is never off."""

    def apply(self, states, controls, ahead=None):
        return np.zeros_like(controls)

    def linearize(self, states, controls):
        return np.zeros((*controls.shape, 2)), np.zeros((*controls.shape, 1))


def test_filter_that_overrules_everything_leaves_nothing_to_optimise():
    found = solve_one(MASS, [0, 1], [0, 0], np.ones((100, 1)), safety_filter=Override())
    assert not found.controls.any()
    assert found.states[0, -1] == pytest.approx([1.0, 1.0])
    assert np.all(found.costs == found.costs[0])


class Broken(ControlFilter):
    """Passes every control; its derivatives are NaN for paths on the negative side."""

    def apply(self, states, controls, ahead=None):
        return controls

    def linearize(self, states, controls):
        broken = np.where(states[..., :1, None] < -0.5, np.nan, 1.0)
        by_state = np.zeros((*controls.shape, states.shape[-1]))
        return by_state, broken * np.eye(controls.shape[-1])


class Understated(Override):
    """Passes every control, and claims to pass a thousandth: steps are far too long."""

    def apply(self, states, controls, ahead=None):
        return controls

    def linearize(self, states, controls):
        return np.zeros((*controls.shape, 2)), np.full((*controls.shape, 1), 1e-3)


def test_damping_grows_until_a_step_succeeds():
    options = {"safety_filter": Understated(), "iterations": 20}
    costs = solve_one(MASS, [0, 0], [1, 0], np.zeros((200, 1)), **options).costs[:, 0]
    assert costs[1] == costs[0]
    assert costs[-1] < costs[0] / 10


class Fuse(Override):
    """Passes controls up to 1.2, and blows beyond."""

    def apply(self, states, controls, ahead=None):
        return np.where(np.abs(controls) > 1.2, np.nan, controls)

    def linearize(self, states, controls):
        return np.zeros((*controls.shape, 2)), np.ones((*controls.shape, 1))


def test_step_that_fails_leaves_the_shorter_ones():
    # The full step of the first iteration is the optimum, which needs controls up to 1.5.
    found = solve_one(MASS, [0, 0], [1, 0], np.zeros((200, 1)), safety_filter=Fuse(), iterations=1)
    halfway = 0.5 * solve_one(MASS, [0, 0], [1, 0], np.zeros((200, 1)), iterations=1).controls
    np.testing.assert_allclose(found.controls, halfway, atol=1e-6)


def test_members_that_diverge_or_lose_their_hessian_poison_nobody():
    system = Linear(np.zeros((2, 2)), np.eye(2, 3))
    starts = np.array([[1.0, 0.0], [-1.0, 0.0], [1e300, 0.0], [1.5, 0.0]])
    goals, guesses = np.array([[2.0, 0.0]] * 4), np.full((4, 100, 3), 0.2)
    found = optimize(system, starts, goals, goals, guesses, DT, safety_filter=Broken())
    assert found.cost[1] == found.costs[0, 1]
    assert found.cost[2] == np.inf
    for b in (0, 3):
        alone = solve_one(system, starts[b], goals[b], guesses[b], safety_filter=Broken())
        assert alone.cost[0] < found.costs[0, b] / 10
        np.testing.assert_allclose(found.states[b], alone.states[0], atol=1e-9)


def test_shapes_that_disagree_are_named():
    with pytest.raises(ValueError, match=r"\(B, K, 1\), not \(\(3, 2\), .*\(2, 10, 1\)\)"):
        optimize(MASS, *np.zeros((3, 3, 2)), np.zeros((2, 10, 1)), DT)
    lower, upper = np.zeros((1, 2)), np.array([[0.0, np.inf]])
    with pytest.raises(ValueError, match="both ends or at neither"):
        optimize(MASS, lower, lower, upper, np.zeros((1, 10, 1)), DT)


class Asked(SafetyFilter):
    """A filter that is asked at every state, however far it is from acting."""

    def clearance(self, states):
        return np.zeros(states.shape[:-1])


def test_a_filter_that_is_asked_only_where_it_could_act_changes_nothing():
    grid = Grid(MASS.space, (31, 31))
    safe = SafeSet.from_values(grid, 2 * grid.centers[:, 0])  # it falls evenly towards K
    starts = np.column_stack([np.linspace(0.3, 2.0, 6), np.linspace(-1.0, 0.5, 6)])
    goals, guesses = np.tile([-1.0, 0.0], (6, 1)), np.full((6, 200, 1), -0.5)
    found, asked = (
        optimize(MASS, starts, goals, goals, guesses, DT, safety_filter=kind(MASS, safe, DT, 0.1))
        for kind in (SafetyFilter, Asked)
    )
    assert np.any(found.controls > 0.9)  # by the filter: the goal is the other way
    np.testing.assert_array_equal(found.states, asked.states)
    np.testing.assert_array_equal(found.controls, asked.controls)
