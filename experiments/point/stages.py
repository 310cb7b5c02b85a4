"""The stages that points share, kept in the store by the content of what they depend on.

The safe set of a truth and the demonstrations under it are computed once for all grids, time steps
and action counts; the tabular model once for all truths, seeds and tasks.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
from scipy import sparse

import mlci.constant_controls
import mlci.demonstrator
import mlci.reachability
import mlci.safety_filter
import mlci.tabular
from experiments.config.settings import Settings
from experiments.tracking.store import Store, Stored
from mlci.constant_controls import tabulate_escapes
from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import Outcome, Trial, crossing, demonstrate, sample_trials
from mlci.grids import Grid
from mlci.reachability import SafeSet, solve_safe_set
from mlci.regions import Regions
from mlci.safety_filter import SafetyFilter, border_margin
from mlci.simulate import EULER, RK4
from mlci.spaces import Box, Floats, Ints
from mlci.tabular import TabularModel, action_grid, discretize

# What is stored of a tabular model: its own arrays, and those of the sparse matrix of crossings.
_MOVES = ("successor", "reward", "allowed")
_CROSSINGS = ("indices", "indptr")

ESCAPES = "escapes"  # the safe set from constant controls; else it solves the equation (9)
_INTEGRATORS = {"euler": EULER, "rk4": RK4}
_MOST_BATCHES = 20  # of tasks, among which enough must cross the truth where only those count


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

    def demonstration(self, trial: int, horizon: float, dt: float) -> Demonstration:
        """The path of a trial, with its task.

        Args:
            trial: its number.
            horizon: duration of a task [s].
            dt: time between samples [s].
        """
        goal = Box(self.goal_lower[trial], self.goal_upper[trial])
        task = Task(self.starts[trial], goal, horizon)
        return Demonstration(
            task, self.states[trial], self.controls[trial], dt, f"trial_{trial:03d}"
        )

    def counts(self) -> dict[str, int]:
        """How many trials had each outcome."""
        return {kind.value: int(np.sum(self.outcome == kind.value)) for kind in Outcome}


def safe_set_inputs(settings: Settings) -> tuple[Any, ...]:
    """All that the safe set depends on, beside code."""
    method, horizon = settings.safety.method, settings.horizon
    return (
        settings.system,
        _corners(settings.constraint),
        method,
        settings.safety.shape,
        horizon if method == ESCAPES else None,  # the equation's solution is converged
    )


def safe_set(settings: Settings, store: Store) -> tuple[SafeSet, str]:
    """Omega of a truth (10), from the store or computed, and its key in the store."""
    grid, escapes = Grid(settings.model.space, settings.safety.shape), mlci.constant_controls
    source = escapes if settings.safety.method == ESCAPES else mlci.reachability

    def compute() -> dict[str, np.ndarray]:
        system, truth = settings.model, settings.constraint
        if source is escapes:
            safe = tabulate_escapes(system, grid, truth, horizon=settings.horizon)
        else:
            safe = solve_safe_set(system, grid, truth)
        return {"values": safe.values, "gradients": safe.gradients}

    modules = [source, _system_module(settings)]
    stored = store.get("safe_set", safe_set_inputs(settings), modules, compute)
    return SafeSet(grid, stored["values"], stored["gradients"]), stored.key


def demonstration_inputs(settings: Settings, safe_set_key: str | None) -> tuple[Any, ...]:
    """All that the trials of a truth depend on, beside code."""
    demonstrator = settings.demonstrations
    return (
        safe_set_key,
        settings.system,
        _corners(settings.constraint),
        # How many survivors make the study is decided later, and must not make them anew.
        replace(demonstrator, keep=demonstrator.pairs),
        settings.tasks,
        settings.safety,
        settings.horizon,
        settings.seed,
    )


def demonstrations(settings: Settings, store: Store) -> TrialSet:
    """The trials of a truth (8), from the store or computed."""
    system, dt, safety = settings.model, settings.demonstrations.dt, settings.safety
    omega, omega_key, margin, safety_filter = None, None, safety.margin, None
    if len(settings.constraint):  # where nothing is forbidden, everything is safe
        omega, omega_key = safe_set(settings, store)
        margin = border_margin(system, omega, dt) if margin is None else margin
        integrator = _INTEGRATORS[settings.demonstrations.integrator]
        safety_filter = SafetyFilter(system, omega, dt, margin, safety.width, integrator)

    def compute() -> dict[str, np.ndarray]:
        trials = _trials(settings, omega, margin or 0.0)
        attempts = demonstrate(
            system, trials, settings.constraint, safety_filter, **_skill(settings)
        )
        paths = [attempt.demonstration for attempt in attempts]
        return {
            "outcome": np.array([attempt.outcome.value for attempt in attempts]),
            "starts": np.array([path.task.start for path in paths]),
            "goal_lower": np.array([path.task.goal.lower for path in paths]),
            "goal_upper": np.array([path.task.goal.upper for path in paths]),
            "states": np.array([path.states for path in paths]),
            "controls": np.array([path.controls for path in paths]),
            "cost": np.array([attempt.cost for attempt in attempts]),
            "miss": np.array([attempt.miss for attempt in attempts]),
        }

    modules = [
        mlci.demonstrator,
        mlci.safety_filter,
        _system_module(settings),
        sys.modules[__name__],
    ]
    inputs = demonstration_inputs(settings, omega_key)
    return TrialSet(**store.get("demonstrations", inputs, modules, compute))


def _trials(settings: Settings, omega: SafeSet | None, margin: float) -> list[Trial]:
    """The trials that the demonstrator tries.

    Raises:
        RuntimeError: too few tasks cross the truth, where only those are wanted.
    """
    system, demonstrator = settings.model, settings.demonstrations
    draw = partial(
        sample_trials,
        system,
        omega,
        settings.tasks.start_box(system.space),
        trials=demonstrator.pairs,
        seed=settings.seed,
        horizon=settings.horizon,
        dt=demonstrator.dt,
        margin=margin,
        goal_offsets=settings.tasks.goal_offsets,
        restarts=demonstrator.restarts,
        hold=demonstrator.hold,
    )
    if not settings.tasks.crossing:
        return draw()
    trials: list[Trial] = []
    for batch in range(_MOST_BATCHES):
        drawn = draw(first=batch * demonstrator.pairs)
        trials += crossing(system, drawn, settings.constraint, **_skill(settings))
        if len(trials) >= demonstrator.pairs:
            return trials[: demonstrator.pairs]
    raise RuntimeError(
        f"of {_MOST_BATCHES * demonstrator.pairs} tasks only {len(trials)} would enter the truth "
        "if it were not there: widen truth.boxes or tasks, or set tasks.crossing=false"
    )


def _skill(settings: Settings) -> dict[str, Any]:
    """What `demonstrate` has to know of a demonstrator, beside tasks, truth and filter."""
    demonstrator = settings.demonstrations
    return {
        "dt": demonstrator.dt,
        "goal_weight": demonstrator.goal_weight,
        "iterations": demonstrator.iterations,
        "goal_tolerance": demonstrator.goal_tolerance,
        "wind": demonstrator.wind,
        "limit": settings.model.control_box if demonstrator.clip else None,
        "integrator": _INTEGRATORS[demonstrator.integrator],
    }


def tabular_model(settings: Settings, store: Store) -> TabularModel:
    """The tabular model (1); its regions are the hypotheses and then the truth's boxes."""
    hypotheses, truth = settings.candidates, settings.constraint
    stored = _discretized(settings, store, "mdp", hypotheses, (*_MOVES, *_CROSSINGS))
    # Apart, so that points which differ in the truth share what takes the time.
    apart = _discretized(settings, store, "mdp_truth", truth, _CROSSINGS)
    crosses = [
        sparse.csr_matrix(
            (np.ones(len(each["indices"]), dtype=bool), each["indices"], each["indptr"]),
            shape=(stored["successor"].size, len(regions)),
        )
        for each, regions in ((stored, hypotheses), (apart, truth))
    ]
    return TabularModel(
        system=settings.model,
        grid=settings.cells,
        actions=action_grid(settings.model, settings.action_counts),
        dt=settings.dt,
        regions=hypotheses.joined(truth),
        crosses=sparse.hstack(crosses, format="csr"),
        temperature=settings.temperature,
        **{name: stored[name] for name in _MOVES},
    )


def model_inputs(settings: Settings, regions: Regions) -> tuple[Any, ...]:
    """All that the tabular model with the crossings of some regions depends on, beside code."""
    return (
        settings.system,
        settings.grid,
        settings.action_counts,
        settings.dt,
        settings.transition.samples,
        settings.temperature,
        _corners(regions),
    )


def _discretized(
    settings: Settings, store: Store, stage: str, regions: Regions, names: Sequence[str]
) -> Stored:
    """Arrays of the tabular model with the crossings of some regions, stored or computed."""

    def compute() -> dict[str, np.ndarray]:
        model = discretize(
            settings.model,
            settings.cells,
            action_grid(settings.model, settings.action_counts),
            settings.dt,
            regions,
            settings.transition.samples,
            settings.temperature,
        )
        arrays = {name: getattr(model, name) for name in _MOVES}
        arrays |= {name: getattr(model.crosses, name) for name in _CROSSINGS}
        return {name: arrays[name] for name in names}

    modules = [mlci.tabular, _system_module(settings), sys.modules[__name__]]
    return store.get(stage, model_inputs(settings, regions), modules, compute)


def _corners(regions: Regions) -> list[list[str]]:
    """The corners of regions, for a key: infinite sides are no JSON."""
    sides = np.hstack([regions.lower, regions.upper])
    return [[repr(float(side)) for side in box] for box in sides]


def _system_module(settings: Settings) -> ModuleType:
    """The module that defines the system."""
    return sys.modules[type(settings.model).__module__]
