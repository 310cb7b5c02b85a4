"""Rewards that are no quadratic, on a line where moves are numbers: exact by sums on a grid."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from mlci.demonstrations import Task
from mlci.regions import Regions
from mlci.sampled.model import SampledModel
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import FunctionSystem

LINE = StateSpace(Box([-4.0], [4.0]), [False], ("x",))
STARTS, GOAL, DT, STEPS = np.array([-0.5]), Box([0.4], [0.8]), 0.25, 8
ABOVE = Regions(LINE, [[1.0], [1.6], [2.4]], [[4.0], [4.0], [4.0]])


@dataclass(frozen=True, eq=False)
class Paid(FunctionSystem):
    """x' = u, for a reward r(x, u) of numbers."""

    reward: Callable[[Floats, Floats], Floats] = lambda x, u: -(u**2)

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        return self.reward(states[..., 0], controls[..., 0])


def paid(reward: Callable[[Floats, Floats], Floats]) -> Paid:
    return Paid(lambda x, u: (u[..., 0],), LINE, Box([-2.0], [2.0]), reward)


def exact(reward: Callable[[Floats, Floats], Floats], temperature: float) -> tuple[float, Floats]:
    """Log Z and Phi of the three regions, by the trapezoid rule."""
    x = np.linspace(-4, 4, 1601)
    step = x[1] - x[0]
    kernel = np.exp(reward(x[:, None], (x - x[:, None]) / DT) * DT / temperature) * step / DT
    last = ((x >= GOAL.lower[0]) & (x <= GOAL.upper[0])).astype(float)
    last[np.isclose(x, GOAL.lower[0]) | np.isclose(x, GOAL.upper[0])] = 0.5
    first = int(np.argmin(np.abs(x - STARTS[0])))

    def total(height: float) -> float:
        below = (x <= height).astype(float)
        values = last * below
        for _ in range(STEPS):
            values = below * (kernel @ values)
        return float(values[first])

    z = total(4.0)
    return np.log(z), 1 - np.array([total(height) for height in ABOVE.lower[:, 0]]) / z


def fuel(knee: float) -> Callable[[Floats, Floats], Floats]:
    return lambda x, u: -2 * knee**2 * (np.sqrt(1 + np.square(u / knee)) - 1)


REWARDS = {
    "squares": (1.0, None, lambda x, u: -(u**2)),
    "state": (0.3, None, lambda x, u: -(u**2) - 3 * (x - 1) ** 2),
    "hills": (1.0, None, lambda x, u: -(u**2) + 2 * np.cos(3 * x)),
    "cross": (1.0, None, lambda x, u: -((u - 0.8 * x) ** 2) - 0.5 * x**4),
    "step": (1.0, None, lambda x, u: -(u**2) - 2 * (x > 0.2)),
    "wall": (1.0, None, lambda x, u: np.where(x > 1.3, -np.inf, -(u**2))),
    "fuel": (1.0, None, fuel(0.5)),
    "thrift": (0.3, None, fuel(0.1)),
    "steep": (1.0, None, lambda x, u: -(u**4)),
    "free": (1.0, 3.0, lambda x, u: -(x**2) + 0 * u),
}


@pytest.mark.parametrize("name", REWARDS)
def test_any_reward_has_the_exact_log_z_and_phi(name):
    temperature, limit, reward = REWARDS[name]
    box = None if limit is None else Box([-limit], [limit])
    most = np.inf if limit is None else limit
    log_z, phi = exact(lambda x, u: np.where(np.abs(u) <= most, reward(x, u), -np.inf), temperature)
    model = SampledModel(paid(reward), ABOVE, DT, temperature, samples=1500, limit=box)
    distribution = model.distribution(Task(STARTS, GOAL, DT * STEPS))
    assert abs(distribution.log_z - log_z) < 3.2 * distribution.log_z_error
    apart = distribution.violation_probabilities() - phi
    assert np.all(np.abs(apart) < 3.2 * distribution.avoidance_errors())
    assert distribution.diagnosis.trusted


@pytest.mark.parametrize(
    ("reward", "words"),
    [
        (lambda x, u: -2 * np.abs(u) + 0 * x, "has no expansion that paths can be drawn from"),
        (lambda x, u: -(x**2) + 0 * u, "nowhere does it bend down in all directions"),
        (lambda x, u: -(u**2) + np.sqrt(x), r"running_reward is nan at state \[-"),
        (lambda x, u: -(u**2) + np.where(x > 0, np.inf, 0), "running_reward is inf at state"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value encountered in sqrt")
def test_a_reward_without_an_expansion_is_refused(reward, words):
    with pytest.raises(ValueError, match=words):
        SampledModel(paid(reward), ABOVE, DT)
