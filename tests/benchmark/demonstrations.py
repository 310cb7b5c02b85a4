"""Optimal paths of the pendulum, equation (8), without a filter: who finds how cheap ones.

Everybody returns the costs (B,) of some tasks x 3 first guesses, in the same order. The goal is the
point that is nearest to the start: peers know no winding.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np

from mlci.control.ilqr import optimize
from mlci.demonstrator import sample_trials
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum
from tests.benchmark import loops
from tests.benchmark.contest import OURS, Contender, Contest, Work

SYSTEM, DT, STEPS, WEIGHT, GUESSES = Pendulum(), 0.01, 500, 300.0, 3
_TOLERANCE = 1e-9  # share of the cost by which an iteration must gain
_ALLOWED = 0.01  # by how much the mean cost may be above the best that is known
ITERATIONS, _CROCODDYL = 4, 3  # iterations, as few as `_ALLOWED` takes
_MANY = 60  # iterations after which nothing changes


@cache
def _problem() -> tuple[Floats, Floats, Floats]:
    """Starts (B, 2), goals (B, 2) and guesses (B, K) of 100 tasks, each with three guesses."""
    box = Box(np.array([0.0, -2.0]), np.array([2 * np.pi, 2.0]))
    trials = sample_trials(
        SYSTEM, None, box, trials=100, seed=0, horizon=STEPS * DT, dt=DT, restarts=GUESSES
    )
    starts = np.repeat([trial.task.start for trial in trials], GUESSES, axis=0)
    goals = np.repeat([trial.task.goal.lower for trial in trials], GUESSES, axis=0)
    goals = starts + SYSTEM.space.difference(goals, starts)
    return starts, goals, np.concatenate([trial.guesses for trial in trials])[:, :, 0]


def solve(members: slice, iterations: int, system: Pendulum = SYSTEM) -> Floats:
    """Costs of some members by this project."""
    starts, goals, guesses = (each[members] for each in _problem())
    return optimize(
        system,
        starts,
        goals,
        goals,
        guesses[:, :, None],
        DT,
        goal_weight=WEIGHT,
        iterations=iterations,
        tolerance=_TOLERANCE,
        wind=False,
    ).cost


@cache
def _best() -> Floats:
    """(100,) the cheapest that plain loops find of each task, with iterations to spare."""
    costs = loops.ilqr_batch(*_problem(), DT, WEIGHT, _MANY, 0.0)
    return np.asarray(costs.reshape(-1, GUESSES).min(axis=1))


def error(costs: Floats) -> float:
    """How far the mean cost of the best guesses is above the best known."""
    best = costs.reshape(-1, GUESSES).min(axis=1)
    return float(np.mean(best) / np.mean(_best()[: len(best)]) - 1)


def contests() -> Iterator[Contest]:
    """The batch of a study, and one task alone."""
    yield _contest("300 paths of 5 s in 500 steps", slice(None))
    yield _contest("3 paths (one task) of 5 s in 500 steps", slice(0, GUESSES))


def _contest(name: str, members: slice) -> Contest:
    """Who solves these members; the slow ones solve fewer of them."""
    count = len(_problem()[0][members])
    some, few, one = (slice(0, min(count, most)) for most in (60, 15, GUESSES))

    def ours() -> Work:
        return lambda: solve(members, ITERATIONS)

    def plain_loops() -> Work:
        starts, goals, guesses = (each[members] for each in _problem())
        return lambda: loops.ilqr_batch(starts, goals, guesses, DT, WEIGHT, ITERATIONS, _TOLERANCE)

    return Contest(
        "demonstrations",
        name,
        [
            Contender(OURS, ours),
            Contender("crocoddyl", _crocoddyl(some), share=some.stop / count),
            Contender("casadi, ipopt", _casadi(few), share=few.stop / count),
            Contender("plain compiled loops", plain_loops),
            Contender("plain numpy", _student(one), share=GUESSES / count),
        ],
        error,
        _ALLOWED,
        "cost above the best",
    )


def _crocoddyl(members: slice) -> Any:
    """DDP of a hinge that carries a mass; its Euler steps use the new velocity for the angle."""

    def prepare() -> Work:
        import crocoddyl
        import pinocchio

        model = pinocchio.Model()
        hinge = model.addJoint(0, pinocchio.JointModelRY(), pinocchio.SE3.Identity(), "hinge")
        mass = pinocchio.Inertia(1.0, np.array([0.0, 0.0, 1.0]), np.zeros((3, 3)))
        model.appendBodyToJoint(hinge, mass, pinocchio.SE3.Identity())
        model.gravity.linear = np.array([0.0, 0.0, -1.0])
        state = crocoddyl.StateMultibody(model)
        motor = crocoddyl.ActuationModelFull(state)

        def action(residual: Any, weight: float, dt: float) -> Any:
            costs = crocoddyl.CostModelSum(state, 1)
            costs.addCost("all", crocoddyl.CostModelResidual(state, residual), 2 * weight)
            free = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, motor, costs)
            free.armature = np.zeros(1)  # the default leaves gravity out
            return crocoddyl.IntegratedActionModelEuler(free, dt)

        solvers = []
        for start, goal, guess in zip(*(each[members] for each in _problem()), strict=True):
            running = action(crocoddyl.ResidualModelControl(state, 1), 1.0, DT)
            last = action(crocoddyl.ResidualModelState(state, goal, 1), WEIGHT, 0.0)
            problem = crocoddyl.ShootingProblem(start, [running] * STEPS, last)
            problem.nthreads = 1
            controls = [np.array([u]) for u in guess]
            solver = crocoddyl.SolverDDP(problem)
            solver.th_stop = _TOLERANCE
            solvers.append((solver, problem, controls))

        def work() -> Floats:
            costs = []
            for solver, problem, controls in solvers:
                solver.solve(problem.rollout(controls), controls, _CROCODDYL, True)
                costs.append(solver.cost)
            return np.array(costs)

        return work

    return prepare


def _casadi(members: slice) -> Any:
    """Multiple shooting: states and controls are unknowns, Euler's steps are constraints."""

    def prepare() -> Work:
        import casadi

        x, u = casadi.SX.sym("x", 2, STEPS + 1), casadi.SX.sym("u", 1, STEPS)
        start, goal = casadi.SX.sym("start", 2), casadi.SX.sym("goal", 2)
        rates = casadi.vertcat(x[1, :-1], casadi.sin(x[0, :-1]) + u)
        gaps = casadi.vertcat(x[:, 0] - start, casadi.vec(x[:, 1:] - x[:, :-1] - DT * rates))
        cost = DT * casadi.sumsqr(u) + WEIGHT * casadi.sumsqr(x[:, -1] - goal)
        problem = {
            "x": casadi.vertcat(casadi.vec(x), casadi.vec(u)),
            "p": casadi.vertcat(start, goal),
            "f": cost,
            "g": gaps,
        }
        quiet = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
        solver = casadi.nlpsol("solver", "ipopt", problem, quiet)

        def work() -> Floats:
            costs = []
            for begin, end, guess in zip(*(each[members] for each in _problem()), strict=True):
                path = np.empty((STEPS + 1, 2))
                path[0] = begin
                loops._pendulum_path(path, guess, end, DT, WEIGHT)
                first = np.concatenate([path.ravel(), guess])
                found = solver(x0=first, p=np.concatenate([begin, end]), lbg=0, ubg=0)
                costs.append(float(found["f"]))
            return np.array(costs)

        return work

    return prepare


def _student(members: slice) -> Any:
    """iLQR as the textbook has it, one path after the other."""

    def prepare() -> Work:
        def work() -> Floats:
            return np.array(
                [
                    _textbook(*each)
                    for each in zip(*(each[members] for each in _problem()), strict=True)
                ]
            )

        return work

    return prepare


def _textbook(start: Floats, goal: Floats, u: Floats) -> float:
    """Cost of one path."""

    def roll_out(shift: Floats, gain: Floats, x: Floats, u: Floats) -> tuple[Floats, Floats, float]:
        path, controls = [start], []
        for k in range(STEPS):
            controls.append(u[k] + shift[k] + gain[k] @ (path[k] - x[k]))
            rate = SYSTEM.dynamics(path[k], np.array([controls[k]]))
            path.append(path[k] + DT * rate)
        cost = DT * np.sum(np.square(controls)) + WEIGHT * np.sum(np.square(path[-1] - goal))
        return np.array(path), np.array(controls), float(cost)

    x, u, cost = roll_out(np.zeros(STEPS), np.zeros((STEPS, 2)), np.zeros((STEPS, 2)), u)
    damping, by_control = 0.0, np.array([0.0, DT])
    for _ in range(ITERATIONS):
        slope, bend = 2 * WEIGHT * (x[-1] - goal), 2 * WEIGHT * np.eye(2)
        shift, gain = np.empty(STEPS), np.empty((STEPS, 2))
        for k in reversed(range(STEPS)):
            by_state = np.array([[1.0, DT], [DT * np.cos(x[k, 0]), 1.0]])
            q_u = 2 * DT * u[k] + by_control @ slope
            q_uu = 2 * DT + by_control @ bend @ by_control
            q_ux = by_control @ bend @ by_state
            shift[k], gain[k] = -q_u / (q_uu + damping), -q_ux / (q_uu + damping)
            slope = by_state.T @ slope + gain[k] * (q_u + q_uu * shift[k]) + q_ux * shift[k]
            cross = np.outer(gain[k], q_ux)
            bend = by_state.T @ bend @ by_state + cross + cross.T
            bend += q_uu * np.outer(gain[k], gain[k])
        for size in 0.5 ** np.arange(8.0):
            found = roll_out(size * shift, gain, x, u)
            if found[2] < cost:
                x, u, cost = found
                damping = damping / 4 if damping > 1e-6 else 0.0
                break
        else:
            damping = max(4 * damping, 0.02 * DT)
    return cost
