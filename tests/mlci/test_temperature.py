"""The temperature of paths: against sums over all paths, and of paths drawn at a known one."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.special import logsumexp

from mlci.demonstrations import Demonstration, Task
from mlci.evidence import DEFAULT_MODEL_ERROR, PAPER, Rates
from mlci.forecasts import ForecastMap
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.likelihood_interval import DROP
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.spaces import Bools, Box, Floats, StateSpace
from mlci.systems import DoubleIntegrator
from mlci.tabular import action_grid, discretize
from mlci.temperature import (
    RANGE,
    TemperatureEstimate,
    estimate_temperature,
    temperature_of_rewards,
)

CELLS = Regions.from_grid(StateSpace(Box([0.0], [1.0]), [False], ("place",)), (3,))
SYSTEM = DoubleIntegrator()
HYPOTHESES = Regions.from_grid(SYSTEM.space, (3, 3))
FIRST = np.arange(9) < 3
MODEL = discretize(SYSTEM, Grid(SYSTEM.space, (9, 7)), action_grid(SYSTEM, 5), 0.5, HYPOTHESES)


@dataclass(frozen=True)
class Thermostat:
    """What is asked of a model here: its temperature."""

    temperature: float = 1.0

    def with_temperature(self, temperature: float) -> Thermostat:
        return Thermostat(temperature)


@dataclass(frozen=True)
class AllPaths:
    """A task with L ways to do it, their rewards (L,) and the regions (L, C) that they cross."""

    rewards: Floats
    crosses: Bools
    model: Thermostat = Thermostat()
    start: int = 0

    def with_temperature_of(self, model: Thermostat) -> AllPaths:
        return replace(self, model=model)

    @property
    def log_z(self) -> Floats:
        exponents = self.rewards / self.model.temperature
        best = np.max(exponents)
        return np.array([[best + np.log(np.sum(np.exp(exponents - best)))]])

    def probabilities(self) -> Floats:
        return np.exp(self.rewards / self.model.temperature - self.log_z[0, 0])

    def avoidance_probabilities(self) -> Floats:
        return np.minimum(self.probabilities() @ ~self.crosses, 1.0)


def random_tasks(rng: np.random.Generator, count: int, regions: int) -> list[AllPaths]:
    """Tasks with thirty ways to do each."""
    return [
        AllPaths(-rng.gamma(4.0, 1.0, 30), rng.random((30, regions)) < 0.4) for _ in range(count)
    ]


def inference_of(tasks: Sequence[AllPaths], violated: Bools, rates: Rates = PAPER) -> Inference:
    count = len(violated)
    return Inference(
        CELLS,
        tuple(map(str, range(count))),
        np.array([task.avoidance_probabilities() for task in tasks]),
        violated,
        np.ones(count, dtype=bool),
        prior_none=0.4,
        rates=rates,
    )


def estimate(tasks: Any, rewards: Floats, inference: Inference) -> TemperatureEstimate:
    return temperature_of_rewards(tasks, rewards, inference)


@pytest.mark.parametrize("rates", [PAPER, Rates(0.1), Rates(0.1, 0.2)])
@pytest.mark.parametrize("seed", range(4))
def test_the_likelihood_is_the_sum_over_what_may_be_forbidden(seed: int, rates: Rates) -> None:
    rng = np.random.default_rng(seed)
    tasks = random_tasks(rng, 8, 3)
    drawn = rng.integers(0, 30, 8) % 12
    rewards = np.array([task.rewards[way] for task, way in zip(tasks, drawn, strict=True)])
    crossed = np.array([task.crosses[way] for task, way in zip(tasks, drawn, strict=True)])
    eta, eps = rates.model_error, rates.rule_breaking

    fine = np.geomspace(1 / RANGE, RANGE, 2001)
    densities, terms = np.zeros(len(fine)), np.log(np.tile([0.4, 0.2, 0.2, 0.2], (len(fine), 1)))
    for j, (task, way) in enumerate(zip(tasks, drawn, strict=True)):
        weights = np.exp((task.rewards - np.max(task.rewards)) / fine[:, None])
        total = np.sum(weights, axis=1)
        densities += (task.rewards[way] - np.max(task.rewards)) / fine - np.log(total)
        for i in range(3):
            avoids = np.sum(weights[:, ~task.crosses[:, i]], axis=1) / total
            lawful = (not crossed[j, i]) / ((1 - eta) * avoids + eta + 1e-300)
            with np.errstate(divide="ignore"):
                terms[:, i + 1] += np.log((1 - eps) * lawful + eps)
    values = densities + logsumexp(terms, axis=1)
    inside = fine[values >= values.max() - DROP]
    found = estimate(tasks, rewards, inference_of(tasks, crossed, rates))
    # Between nodes, a factor of 1.9 apart, what constraints add is interpolated: within 1 %.
    assert found.temperature == pytest.approx(fine[np.argmax(values)], rel=0.01)
    assert (found.lower, found.upper) == pytest.approx((inside[0], inside[-1]), rel=0.01)
    assert (found.assumed, found.used) == (1.0, tuple("01234567"))


@pytest.mark.long
def test_the_interval_covers_the_temperature_of_drawn_paths() -> None:
    """In 200 worlds, of which three in four have a constraint: 95 % +- three standard errors."""
    rng, covered, truth = np.random.default_rng(2), [], 0.6
    for _ in range(200):
        tasks, drawn, forbidden = random_tasks(rng, 6, 3), [], int(rng.integers(4))
        for task in tasks:
            chance = task.with_temperature_of(Thermostat(truth)).probabilities()
            if forbidden < 3:
                chance = chance * ~task.crosses[:, forbidden]
            drawn.append(int(rng.choice(30, p=chance / chance.sum())))
        pairs = list(zip(tasks, drawn, strict=True))
        rewards = np.array([task.rewards[way] for task, way in pairs])
        crossed = np.array([task.crosses[way] for task, way in pairs])
        found = estimate(tasks, rewards, inference_of(tasks, crossed))
        covered.append(found.lower <= truth <= found.upper)
    assert 0.90 <= np.mean(covered) <= 0.99


@pytest.fixture(scope="module")
def tasks() -> list[Task]:
    ends = [((-1.5, 0.0), (1.0, 0.0)), ((2.0, 0.2), (-0.5, 0.0)), ((0.0, 1.0), (0.5, -0.5))]
    return [Task(np.array(start), Box.point(np.array(end)), 5.0) for start, end in ends]


@pytest.mark.parametrize("exact_ends", [True, False])
@pytest.mark.parametrize("horizon", [0.5, 2.5])  # one step, and five
def test_a_distribution_at_another_temperature_is_that_of_a_fresh_model(
    exact_ends: bool, horizon: float
) -> None:
    task = Task(np.array([-0.3, 0.4]), Box.point([0.0, 0.5]), horizon)
    forbidden = np.arange(9) == 0
    warm = discretize(SYSTEM, MODEL.grid, MODEL.actions, 0.5, HYPOTHESES, temperature=3.0)
    fresh, first = (
        TrajectoryDistribution.of_task(model.under(forbidden), task, exact_ends=exact_ends)
        for model in (warm, MODEL)
    )
    assert np.isfinite(first.log_z[0, first.start])
    warmed = first.with_temperature_of(first.model.with_temperature(3.0))
    np.testing.assert_allclose(warmed.log_z, fresh.log_z, rtol=1e-12)
    alpha = fresh.avoidance_probabilities()
    np.testing.assert_allclose(warmed.avoidance_probabilities(), alpha, rtol=1e-12)


def test_of_a_tabular_model_it_is_the_same_as_over_all_its_paths() -> None:
    """Three moves from a cell to a range of places, one path after the other."""
    task = Task(np.array([-0.6, 0.8]), Box([-0.2, -np.inf], [1.5, np.inf]), 1.5)
    distribution = TrajectoryDistribution.of_task(MODEL, task)
    rewards, crosses = [], []
    for moves in itertools.product(range(5), repeat=3):
        cells, reward = [distribution.start], 0.0
        for move in moves:
            if not MODEL.kept.allowed(MODEL.truth)[cells[-1], move]:
                break
            reward += MODEL.kept.reward[cells[-1], move]
            cells.append(int(MODEL.kept.successor[cells[-1], move]))
        if len(cells) == 4 and cells[-1] in distribution.goal:
            rewards.append(reward)
            crosses.append(MODEL.crossed(np.array(cells[:-1]), np.array(moves)))
    every = AllPaths(np.array(rewards), np.array(crosses)[:, :3])
    assert len(rewards) > 2
    worst = int(np.argsort(rewards)[1])
    crossed = np.tile(crosses[worst], (4, 1))
    inference = replace(
        inference_of([every] * 4, crossed[:, :3], Rates(0.1)), hypotheses=HYPOTHESES.select(FIRST)
    )
    drawn = np.full(4, rewards[worst])
    first = temperature_of_rewards([distribution] * 4, drawn, inference, FIRST)
    second = estimate([every] * 4, drawn, inference)
    assert first.temperature == pytest.approx(second.temperature, rel=1e-6)
    assert (first.lower, first.upper) == pytest.approx((second.lower, second.upper), rel=1e-6)


def direct(task: Task, wave: float, known: bool = True) -> Demonstration:
    """The cheapest path from start to goal, and a swing of no use on top of it."""
    start, goal = task.start, task.goal.lower
    time, horizon = np.arange(501) * 0.01, task.horizon
    # u = a + b t with x(5) and x'(5) as they should be.
    by_ends = np.array([[horizon**2 / 2, horizon**3 / 6], [horizon, horizon**2 / 2]])
    wanted = [goal[0] - start[0] - start[1] * horizon, goal[1] - start[1]]
    a, b = np.linalg.solve(by_ends, wanted)
    turn = 2 * np.pi / horizon
    place = start[0] + start[1] * time + a * time**2 / 2 + b * time**3 / 6
    place += wave * (1 - np.cos(turn * time))
    speed = start[1] + a * time + b * time**2 / 2 + wave * turn * np.sin(turn * time)
    held = (time + 0.005)[:-1]
    control = a + b * held + wave * turn**2 * np.cos(turn * held)
    states = np.column_stack([place, speed])
    return Demonstration(task, states, control[:, None] if known else None, time)


def test_a_swing_of_no_use_is_warm_and_the_cheapest_path_cold(tasks: list[Task]) -> None:
    """What the best demonstrator does is colder than what a wasteful one does."""
    found = []
    for wave in (0.0, 0.25, 0.45):
        paths = [direct(task, wave) for task in tasks]
        inference = infer(MODEL, paths)
        found.append(estimate_temperature(MODEL, paths, inference))
        unknown = [direct(task, wave, known=False) for task in tasks]
        blind = estimate_temperature(MODEL, unknown, inference)
        assert blind.temperature == pytest.approx(found[-1].temperature, rel=0.01)
    cold, middle, warm = found
    assert cold.temperature < middle.temperature < warm.temperature
    assert cold.upper < 1.0
    assert [estimate.used for estimate in found] == [("0", "1", "2")] * 3


def test_a_calibration_leaves_the_default_model_error(tasks: list[Task]) -> None:
    """Its map belongs to the temperature of the model."""
    paths = [direct(task, 0.25) for task in tasks]
    inference = infer(MODEL, paths, rates=Rates(DEFAULT_MODEL_ERROR))
    calibrated = replace(inference, rates=PAPER, calibration=ForecastMap(()))
    expected = estimate_temperature(MODEL, paths, inference)
    assert estimate_temperature(MODEL, paths, calibrated) == expected


def test_where_the_profile_is_flat_it_is_said() -> None:
    """Equal ways to do a task tell nothing; the best is colder than anything, the worst warmer."""
    crosses = np.zeros((2, 3), dtype=bool)
    same, differ = AllPaths(np.array([-1.0, -1.0]), crosses), AllPaths(np.array([-1, -3]), crosses)
    nothing, cold, warm = (
        estimate([task] * 9, np.full(9, reward), inference_of([task] * 9, np.zeros((9, 3), bool)))
        for task, reward in ((same, -1.0), (differ, -1.0), (differ, -3.0))
    )
    assert [found.flat for found in (nothing, cold, warm)] == [True] * 3
    assert str(nothing) == "like any"
    assert (nothing.lower, nothing.upper) == nothing.searched
    # 9 log(1 + e^(-2 / T)) = DROP at the upper end.
    upper = -2 / np.log(np.expm1(DROP / 9))
    assert cold.upper == pytest.approx(upper, rel=1e-3)
    assert str(cold) == f"colder than {upper:.3g}"
    assert cold.warnings == [
        "the demonstrations do not bound their temperature: of 0.01 to 100 they look colder than "
        f"{upper:.3g}"
    ]
    assert str(warm).startswith("warmer than")


def test_a_temperature_that_is_not_assumed_is_a_warning() -> None:
    estimate = TemperatureEstimate(1.0, 0.4, 0.2, 0.9, (0.01, 100.0), ("a",))
    assert estimate.summary() == "the paths look like 0.4 (0.2 to 0.9)"
    (warning,) = estimate.warnings
    assert "look like 0.4 (0.2 to 0.9), and 1 is assumed" in warning
    assert "more random than they are" in warning
    (warning,) = replace(estimate, assumed=0.1).warnings
    assert "steadier than they are" in warning
    assert not replace(estimate, assumed=0.5).warnings
    assert estimate.record()["lower"] == 0.2


def test_of_no_task_that_the_model_can_do_nothing_is_said(tasks: list[Task]) -> None:
    paths = [direct(task, 0.0) for task in tasks]
    inference = replace(infer(MODEL, paths), reachable=np.zeros(3, dtype=bool))
    estimate = estimate_temperature(MODEL, paths, inference)
    assert estimate.used == ()
    assert estimate.flat
    assert not estimate.warnings
    assert estimate.summary() == "the tabular model can do none of the tasks"
