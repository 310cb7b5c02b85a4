"""Motion against the dynamics: right and wrong units, controls in and out of range."""

from collections.abc import Callable

import numpy as np
import pytest

from mlci.recordings.motion import motion
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum, System, TelescopingPendulum

TIME = np.arange(301) / 100
UNICYCLE = FunctionSystem(
    lambda x, u: (u[..., 0] * np.cos(x[..., 2]), u[..., 0] * np.sin(x[..., 2]), u[..., 1]),
    StateSpace(
        Box(np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 2 * np.pi])),
        np.array([False, False, True]),
        ("x", "y", "heading"),
        ("m", "m", "rad"),
    ),
    Box(np.array([0.0, -2.0]), np.array([1.0, 2.0])),
)


def path(system: System, start: list[float], within: float = 0.9) -> np.ndarray:
    """A motion under smooth controls in a share of their range."""
    box = system.control_box
    phases = np.arange(box.dimension)
    waves = np.sin(2 * TIME[:-1, None] + phases) * within
    controls = (box.lower + box.upper) / 2 + waves * (box.upper - box.lower) / 2
    return rollout(system, np.array(start), controls, 0.01)


CASES = [
    (Pendulum(), [1.0, 0.5]),
    (DoubleIntegrator(), [-1.0, 1.0]),
    (TelescopingPendulum(), [0.2, 0.1, 8.0, 0.5]),
    (UNICYCLE, [0.0, 0.0, 1.0]),
]


@pytest.mark.parametrize(("system", "start"), CASES)
def test_a_motion_of_the_system_is_like_it(system: System, start: list[float]) -> None:
    states = path(system, start)
    found = motion(system, states, TIME)
    widths = system.space.bounds.widths
    assert not found.unlike(widths).any()
    assert np.all(found.worst < 2e-3 * widths)
    noisy = states + np.random.default_rng(0).normal(0, 0.003, states.shape) * widths
    assert not motion(system, noisy, TIME).unlike(widths).any()
    few = np.sort(np.append([0, 300], np.random.default_rng(1).choice(300, 60, replace=False)))
    assert not motion(system, states[few], TIME[few]).unlike(widths).any()


@pytest.mark.parametrize(
    ("change", "unlike", "factor"),
    [
        (lambda x: x * [180 / np.pi, 1.0], [True, False], 57.3),
        (lambda x: x * [1.0, 0.5], [True, False], 2.0),
        (lambda x: x * [-1.0, 1.0], [True, False], None),  # another sense of rotation
        (lambda x: x * [1.0, 1.0] + [1.0, 0.0], [False, False], None),  # unseen: controls may do it
    ],
)
def test_a_wrong_unit_is_seen_with_its_factor(
    change: Callable[[np.ndarray], np.ndarray], unlike: list[bool], factor: float | None
) -> None:
    system = Pendulum()
    found = motion(system, change(path(system, [1.0, 0.5])), TIME)
    assert found.unlike(system.space.bounds.widths).tolist() == unlike
    if factor is not None:
        assert found.factor[0] == pytest.approx(factor, rel=0.02)


def test_a_car_that_slides_sideways_moves_unlike_it() -> None:
    """Each rate is within what some control does, but no control does both."""
    states = path(UNICYCLE, [0.0, 0.0, 1.0])
    aside = states.copy()
    aside[:, :2] = states[:, 1::-1] * [1.0, -1.0]
    assert motion(UNICYCLE, aside, TIME).unlike(UNICYCLE.space.bounds.widths).any()


def test_controls_out_of_range_are_residuals() -> None:
    system = DoubleIntegrator()
    strong = rollout(system, np.array([-1.0, 0.0]), np.full((100, 1), 2.0), 0.01)
    found = motion(system, strong, TIME[:101])
    np.testing.assert_allclose(found.residuals[:, 1], 1.0, atol=1e-9)  # 2 where 1 is the most
    assert found.unlike(system.space.bounds.widths).tolist() == [False, True]
    assert found.driven.tolist() == [False, True]


def test_two_samples_are_a_motion() -> None:
    found = motion(Pendulum(), np.array([[1.0, 0.5], [1.5, 0.5]]), np.array([0.0, 1.0]))
    assert found.residuals.shape == (1, 2)
    assert found.residuals[0, 0] == pytest.approx(0.0)
