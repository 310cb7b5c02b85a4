"""What is told about a system that breaks a promise, and that ours break none."""

import re

import numpy as np
import pytest

from mlci.spaces import Box, StateSpace
from mlci.system_check import check_affine, check_system
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum, System, TelescopingPendulum


class Line(System):
    """Three states and two controls, with Jacobians from differences."""

    @property
    def space(self):
        names = ("first", "second", "third")
        return StateSpace(Box([-1, -1, -1], [1, 1, 1]), [False] * 3, names, ("m",) * 3)

    @property
    def control_box(self):
        return Box([-1, -2], [1, 2])

    def dynamics(self, states, controls):
        x, u = states, controls
        rates = np.broadcast_arrays(x[..., 1] * x[..., 2], np.sin(u[..., 0]), u[..., 1])
        return np.stack(rates, axis=-1)


@pytest.mark.parametrize("system", [Pendulum(), DoubleIntegrator(), Line()])
def test_sound_system_passes(system):
    check_system(system)


def broken(**attributes):
    """Line with something put in its place."""
    return type("Broken", (Line,), attributes)()


def boundary(value):
    return property(lambda self: value)


def flawed(change):
    """Dynamics of Line, changed."""
    return broken(dynamics=lambda self, x, u: change(Line.dynamics(self, x, u), x, u))


def jacobians(change):
    """Jacobians of Line as differences give them, changed."""
    return broken(jacobians=lambda self, x, u: change(*System.jacobians(self, x, u)))


def reward_derivatives(change):
    """Derivatives of the reward as differences give them, changed."""
    known = System.reward_derivatives
    return broken(reward_derivatives=lambda self, x, u: change(*known(self, x, u)))


def spoil_one(by_state, by_control):
    by_state = by_state.copy()
    by_state[..., 0, 2] += 0.5
    return by_state, by_control


def write_into(rates, x, u):
    x[..., 0] = 0
    return rates


NAMES = StateSpace(Box([0, 0], [1, 1]), [False, False], ("a", "a"))
BATCH = "for states (7, 1, 3) and controls (5, 2)"
FAULTS = {
    "space is a method": (broken(space=lambda self: None), "space must be a StateSpace, not a me"),
    "space is a box": (
        broken(space=boundary(Box([0], [1]))),
        "space must be a StateSpace, not Box",
    ),
    "space raises": (broken(space=property(lambda self: {}["a"])), "space fails: KeyError: 'a'"),
    "names repeat": (broken(space=boundary(NAMES)), "names must be words, each once, not ('a', 'a"),
    "no controls": (
        broken(control_box=boundary(Box([-1, -np.inf], [1, np.inf]))),
        "control_box must be finite and not empty: [ -1. -inf] to [ 1. inf]",
    ),
    "raises": (
        broken(dynamics=lambda self, x, u: np.stack([x[..., 0], u[..., 0], u[..., 1]], axis=-1)),
        f"dynamics fails {BATCH}: ValueError: all input arrays must have the same shape",
    ),
    "shape": (
        flawed(lambda rates, x, u: rates[..., :2]),
        f"dynamics must be (7, 5, 3) {BATCH}, not (7, 5, 2)",
    ),
    "list": (flawed(lambda rates, x, u: list(rates)), f"of real numbers {BATCH}, not list"),
    "complex": (flawed(lambda rates, x, u: rates + 0j), "not ndarray of complex128"),
    "nan": (
        flawed(lambda rates, x, u: np.where(x[..., :1] > 0, rates, np.nan)),
        "dynamics is [nan, nan, nan] at state [-",
    ),
    "mixes": (
        flawed(lambda rates, x, u: rates - rates.mean(axis=tuple(range(rates.ndim - 1)))),
        "dynamics mixes the members of a batch: at state [",
    ),
    "writes": (flawed(write_into), "dynamics fails " + BATCH + ": ValueError: assignment dest"),
    "reward": (
        broken(running_reward=lambda self, x, u: -(u**2)),
        f"running_reward fails {BATCH}: ValueError: ",
    ),
    "one Jacobian": (jacobians(lambda a, b: a), "must be two arrays, dh/dx and dh/du, not ndarray"),
    "shape of a Jacobian": (
        jacobians(lambda a, b: (a, b[..., :1])),
        f"jacobians: dh/du must be (7, 5, 3, 2) {BATCH}, not (7, 5, 3, 1)",
    ),
    "wrong Jacobian": (jacobians(spoil_one), "jacobians: dh/dx[0, 2] is "),
    "gradient alone": (
        reward_derivatives(lambda gradient, hessian: gradient),
        "reward_derivatives must be two arrays, the gradient and the Hessian, not ndarray",
    ),
    "shape of a Hessian": (
        reward_derivatives(lambda gradient, hessian: (gradient, hessian[..., 3:])),
        f"the Hessian must be (7, 5, 5, 5) {BATCH}, not (7, 5, 5, 2)",
    ),
    "wrong gradient": (
        reward_derivatives(lambda gradient, hessian: (-gradient, hessian)),
        "reward_derivatives: the gradient[",
    ),
    "derivatives of another reward": (
        broken(
            running_reward=lambda self, x, u: -np.sum(u**2, axis=-1) - 0 * x[..., 0],
            reward_derivatives=lambda self, x, u: (
                System.reward_derivatives(self, x, u)[0],
                np.zeros((7, 5, 5, 5)),
            ),
        ),
        "reward_derivatives: the Hessian[3, 3] is 0 where differences give -2, at state [",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_told_with_what_shows_it(fault):
    system, message = FAULTS[fault]
    with pytest.raises(ValueError, match="^Broken" + ".*" + re.escape(message)):
        check_system(system)


def test_wrong_jacobian_is_told_with_both_values():
    with pytest.raises(ValueError, match="mend it, or leave jacobians out") as caught:
        check_system(jacobians(spoil_one))
    given, true = map(
        float, re.search(r"is (\S+) where differences give (\S+),", str(caught.value)).groups()
    )
    assert given - true == pytest.approx(0.5, abs=1e-5)


def drives(push):
    """A mass on a line that a control drives through a function."""
    space = StateSpace(Box([-1, -1], [1, 1]), [False, False], ("x", "v"))
    rates = lambda x, u: (x[..., 1], x[..., 0] + push(x, u[..., 0]))  # noqa: E731
    return FunctionSystem(rates, space, Box([-2], [2]))


@pytest.mark.parametrize(
    "system",
    [
        Pendulum(),
        DoubleIntegrator(),
        TelescopingPendulum(),
        drives(lambda x, u: (1 + x[..., 0] ** 2) * u + 1e6 * x[..., 1] ** 3),
    ],
)
def test_dynamics_that_are_affine_in_the_control_pass(system):
    check_affine(system)


@pytest.mark.parametrize(
    "push",
    [
        lambda x, u: np.cos(3 * u),
        lambda x, u: u**3,
        lambda x, u: u * np.abs(u),
        lambda x, u: u + 1e-4 * u**2,
        lambda x, u: np.where(x[..., 0] > 0, np.tanh(u), u),
    ],
)
def test_dynamics_that_are_not_affine_are_told_with_three_values(push):
    system = drives(push)
    check_system(system)
    with pytest.raises(ValueError, match="dynamics is not affine") as caught:
        check_affine(system)
    message = re.search(
        r"the rate of v is (\S+) at state .* and (\S+) and (\S+) at controls \[.* which makes "
        r"(\S+); take what enters the rates",
        str(caught.value),
    )
    _, one, other, mean = map(float, message.groups())
    assert min(one, other) <= mean <= max(one, other)
