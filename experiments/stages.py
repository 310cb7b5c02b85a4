"""The stages that points share: the safe set of a truth, and the demonstrations under it.

Each is computed once for all grids, time steps and action counts, and kept in the store by the
content of what it depends on.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from types import ModuleType

import numpy as np

import mlci.demonstrator
import mlci.reachability
import mlci.safety_filter
from experiments.settings import Settings
from experiments.store import Store
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.grids import Grid
from mlci.reachability import SafeSet, solve
from mlci.safety_filter import SafetyFilter, border_margin
from mlci.spaces import Box, Floats, Ints


@dataclass(frozen=True, eq=False)
class TrialSet:
    """Every trial of a truth, kept or rejected.

    Attributes:
        outcome: (P,) `Outcome` values.
        starts: (P, n) first states.
        goal_lower: (P, n) lower corners of the goals.
        goal_upper: (P, n) upper corners.
        states: (P, K+1, n) paths.
        controls: (P, K, m) applied controls.
        cost: (P,) optimiser's cost.
        miss: (P,) final distance to the goal, raw units.
    """

    outcome: np.ndarray
    starts: Floats
    goal_lower: Floats
    goal_upper: Floats
    states: Floats
    controls: Floats
    cost: Floats
    miss: Floats

    def kept(self, most: int) -> Ints:
        """Indices of the first `most` trials that were kept."""
        return np.flatnonzero(self.outcome == Outcome.KEPT.value)[:most]

    def goal(self, trial: int) -> Box:
        """The goal of a trial."""
        return Box(self.goal_lower[trial], self.goal_upper[trial])

    def counts(self) -> dict[str, int]:
        """How many trials had each outcome."""
        return {kind.value: int(np.sum(self.outcome == kind.value)) for kind in Outcome}


def safe_set(settings: Settings, store: Store) -> tuple[SafeSet, str]:
    """Omega of a truth (10), from the store or computed, and its key in the store."""
    grid = Grid(settings.model.space, settings.safety.shape)

    def compute() -> dict[str, np.ndarray]:
        found = solve(settings.model, grid, settings.constraint)
        return {"values": found.values, "gradients": found.gradients}

    depends = (settings.system, settings.truth.boxes, settings.safety.shape)
    stored = store.get("safe_set", depends, [mlci.reachability, _system_module(settings)], compute)
    return SafeSet(grid, stored["values"], stored["gradients"]), stored.key


def demonstrations(settings: Settings, store: Store) -> TrialSet:
    """The trials of a truth (8), from the store or computed."""
    system, chosen, safety = settings.model, settings.demonstrations, settings.safety
    omega, omega_key = safe_set(settings, store)
    margin = safety.margin
    if margin is None:
        margin = border_margin(system, omega, chosen.dt)

    def compute() -> dict[str, np.ndarray]:
        trials = sample_trials(
            system,
            omega,
            _task_box(settings),
            trials=chosen.pairs,
            seed=settings.seed,
            horizon=settings.horizon,
            dt=chosen.dt,
            margin=margin,
            restarts=chosen.restarts,
            hold=chosen.hold,
        )
        attempts = demonstrate(
            system,
            trials,
            settings.constraint,
            SafetyFilter(system, omega, chosen.dt, margin, safety.width),
            dt=chosen.dt,
            goal_weight=chosen.goal_weight,
            iterations=chosen.iterations,
            goal_tolerance=chosen.goal_tolerance,
        )
        shown = [attempt.demonstration for attempt in attempts]
        return {
            "outcome": np.array([attempt.outcome.value for attempt in attempts]),
            "starts": np.array([demonstration.task.start for demonstration in shown]),
            "goal_lower": np.array([demonstration.task.goal.lower for demonstration in shown]),
            "goal_upper": np.array([demonstration.task.goal.upper for demonstration in shown]),
            "states": np.array([demonstration.states for demonstration in shown]),
            "controls": np.array([demonstration.controls for demonstration in shown]),
            "cost": np.array([attempt.cost for attempt in attempts]),
            "miss": np.array([attempt.miss for attempt in attempts]),
        }

    # How many survivors make the study is decided later, and must not make them anew.
    depends = (
        omega_key,
        replace(chosen, keep=chosen.pairs),
        settings.tasks,
        safety,
        settings.horizon,
        settings.seed,
    )
    modules = [mlci.demonstrator, mlci.safety_filter, sys.modules[__name__]]
    return TrialSet(**store.get("demonstrations", depends, modules, compute))


def _task_box(settings: Settings) -> Box:
    """Where starts and goals are drawn; a free dimension spans the state space."""
    box, bounds = settings.tasks.box(), settings.model.space.bounds
    return Box(
        np.where(np.isfinite(box.lower), box.lower, bounds.lower),
        np.where(np.isfinite(box.upper), box.upper, bounds.upper),
    )


def _system_module(settings: Settings) -> ModuleType:
    """The module that defines the system."""
    return sys.modules[type(settings.model).__module__]
