"""The estimate of memory, against what numpy asks for."""

from __future__ import annotations

import dataclasses
import math
import tracemalloc

import numpy as np
import pytest

from experiments.config import memory
from experiments.config.memory import expected_memory, machine_memory
from experiments.config.settings import GridSettings, Settings
from mlci.maxent import TrajectoryDistribution
from mlci.spaces import Box, Floats
from mlci.tabular import action_grid, discretize


def test_a_model_takes_no_more_than_expected_and_not_much_less(
    monkeypatch: pytest.MonkeyPatch, settings: Settings
) -> None:
    """Discretisation and one task; a point holds most arrays twice while it joins them."""
    # So that blocks of work do not count.
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", 1 << 13)
    large = dataclasses.replace(
        settings, grid=GridSettings((160, 100), None, 0), actions=9, dt=0.1, horizon=2.0
    )
    monkeypatch.setattr(memory, "_BYTES_AT_REST", 0)
    violation_probabilities(settings)  # loops are compiled, which takes memory once
    tracemalloc.start()
    phi = violation_probabilities(large)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert np.max(phi) > 0.5
    assert peak < expected_memory(large) < 4 * peak


def violation_probabilities(settings: Settings) -> Floats:
    """Phi (C,) of one task, from the system on."""
    actions = action_grid(settings.model, settings.action_counts)
    model = discretize(settings.model, settings.cells, actions, settings.dt, settings.candidates)
    start = int(settings.cells.index([-1.0, 0.5]))
    goal = settings.cells.cells_in(Box(np.array([-0.5, -np.inf]), np.array([0.5, np.inf])))
    steps = round(settings.horizon / settings.dt)
    return TrajectoryDistribution(model, start, goal, steps).violation_probabilities()


def test_every_axis_of_size_counts(settings: Settings) -> None:
    few = expected_memory(settings)
    for changes in (
        {"grid": GridSettings((1200, 8), None, 0)},
        {"actions": 300},
        {"dt": 0.0005},
        {"transition": dataclasses.replace(settings.transition, samples=10)},
        {"hypotheses": dataclasses.replace(settings.hypotheses, shape=(1000, None))},
    ):
        assert expected_memory(dataclasses.replace(settings, **changes)) > few + 1e6


def test_a_system_that_does_not_tell_its_memory_has_no_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert 1e8 < machine_memory() < math.inf

    def refuse(name: str) -> int:
        raise ValueError(name)

    monkeypatch.setattr("os.sysconf", refuse)
    assert machine_memory() == math.inf
