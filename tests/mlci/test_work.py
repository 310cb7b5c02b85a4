"""How much work the algorithms do, counted: what would make them slow fails here on any machine."""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from held_bytes import held_bytes

from mlci import recursions
from mlci.compiled import Compiled
from mlci.control.ilqr import optimize
from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.spaces import Box, Floats
from mlci.systems import Pendulum, TelescopingPendulum
from mlci.tabular import TabularModel, action_grid, discretize


@dataclass(frozen=True, eq=False)
class Counted(Pendulum):
    """A pendulum that counts the states whose rate or Jacobian is asked for."""

    rates: list[int] = field(default_factory=list)
    slopes: list[int] = field(default_factory=list)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        found = super().dynamics(states, controls)
        self.rates.append(found[..., 0].size)
        return found

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        found = super().jacobians(states, controls)
        self.slopes.append(found[0][..., 0, 0].size)
        return found


def papers_pendulum(system: Pendulum) -> TabularModel:
    """400 cells, 9 actions, 100 hypotheses."""
    hypotheses = Regions.from_grid(system.space, (10, 10))
    return discretize(
        system, Grid(system.space, (20, 20)), action_grid(system, 9), 0.25, hypotheses
    )


def test_a_move_takes_four_rates_a_step_and_one_for_its_length() -> None:
    system = Counted()
    moves = 400 * 9
    model = papers_pendulum(system)
    asked = sum(system.rates), sum(system.slopes)
    assert model.substeps == 3
    assert asked[0] <= moves * (4 * 3 + 1)
    assert asked[1] <= moves
    assert len(system.rates) <= 100  # calls of a user's function, whose arrays are long


def test_a_model_of_the_papers_size_holds_few_bytes_a_move() -> None:
    system = TelescopingPendulum()
    grid, actions = Grid(system.space, (10, 5, 10, 5)), action_grid(system, [5, 3])
    model = discretize(
        system, grid, actions, 0.25, Regions.from_grid(system.space, (10, None, 10, None))
    )
    _ = model.merged
    moves = grid.size * len(actions)
    assert held_bytes(model) / moves < 40


def test_log_z_and_phi_take_one_exponential_for_each_merged_move_on_a_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    model = papers_pendulum(Pendulum())
    task = Task(np.array([0.5, 0.0]), Box.point([3.0, 0.0]), 5.0)
    exponentials = []

    def exp(value: Any) -> Any:
        exponentials.append(np.size(value))
        return np.exp(value)

    for name, kernel in list(vars(recursions).items()):
        if isinstance(kernel, Compiled):
            monkeypatch.setattr(recursions, name, kernel.function)
    monkeypatch.setattr(recursions, "np", SimpleNamespace(**{**vars(np), "exp": exp}))
    distribution = TrajectoryDistribution.of_task(model, task)
    phi = distribution.violation_probabilities()
    assert phi.max() > 0.5

    merged, log_z = model.merged, distribution.log_z
    cell = np.repeat(np.arange(model.states), np.diff(merged.begins))
    ways = np.sum((log_z[:-1, cell] > -np.inf) & (log_z[1:, merged.successor] > -np.inf))
    assert 0 < sum(exponentials) <= ways


def test_probabilities_of_regions_take_no_more_memory_than_they_may(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    distribution = TrajectoryDistribution.of_task(
        papers_pendulum(Pendulum()), Task(np.array([0.5, 0.0]), Box.point([3.0, 0.0]), 5.0)
    )
    whole = distribution.avoidance_probabilities()  # and what tasks share is made, loops compiled
    two_steps = 2 * 8 * 400 * 100
    monkeypatch.setattr(recursions, "ALPHA_BYTES", two_steps // 10)
    tracemalloc.start()
    try:
        np.testing.assert_array_equal(distribution.avoidance_probabilities(), whole)
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert two_steps // 10 < most < two_steps / 2  # log Z and what it is made of beside them


def test_an_iteration_of_the_demonstrator_takes_eight_rates_and_a_jacobian_a_step() -> None:
    system = Counted()
    members, steps, iterations = 3, 50, 4
    starts, goals = np.full((members, 2), 0.5), np.full((members, 2), 2.5)
    guesses = np.random.default_rng(0).uniform(-2, 2, (members, steps, 1))
    optimize(system, starts, goals, goals, guesses, 0.02, iterations=iterations)
    each = members * steps
    assert sum(system.rates) <= each * (1 + 8 * iterations)  # the guess; then eight step sizes
    assert sum(system.slopes) <= each * iterations
    assert len(system.rates) <= steps * (1 + 8 * iterations)  # all members in one call
