"""The trials of a truth's demonstrators: made as they are in reality, and kept in the store.

They are computed once for all grids, time steps, action counts and ways to infer. What of them
`settings.reality` says, inference does not know.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import mlci.control.effort
import mlci.demonstrator
import mlci.safety.safety_filter
from experiments.config.settings import Settings
from experiments.point.no_answer import NoAnswer
from experiments.point.stages import region_inputs, safe_set, shape_modules, system_module
from experiments.point.streams import Purpose, stream
from experiments.tracking.store import Store
from mlci.demonstrations import Demonstration, Task, even_times
from mlci.demonstrator import Attempt, Outcome, Trial, crossing, demonstrate, sample_trials
from mlci.safety.reachability import SafeSet
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import EULER, RK4, step_count
from mlci.spaces import Bools, Box, Floats, Ints, StateSpace

_INTEGRATORS = {"euler": EULER, "rk4": RK4}
_MOST_BATCHES = 20  # of tasks, among which enough must cross the truth where only those count


@dataclass(frozen=True, eq=False)
class TrialSet:
    """Every trial of a truth, kept or rejected.

    Attributes:
        outcome: (P,) `Outcome` values.
        rule_breaking: (P,) whether the demonstrator ignores the constraint.
        starts: (P, n) first states, as recorded.
        goal_lower: (P, n) lower corners of the goals.
        goal_upper: (P, n) upper corners.
        states: (P, K+1, n) paths, as recorded.
        controls: (P, K, m) applied controls.
        cost: (P,) optimiser's cost.
        miss: (P,) final distance to the goal, raw units.
    """

    outcome: np.ndarray
    rule_breaking: Bools
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
        states, controls = self.states[trial], self.controls[trial]
        times = even_times(len(states), dt)
        return Demonstration(task, states, controls, times, f"trial_{trial:03d}")

    def counts(self) -> dict[str, int]:
        """How many trials had each outcome."""
        return {kind.value: int(np.sum(self.outcome == kind.value)) for kind in Outcome}


def demonstration_inputs(settings: Settings, safe_set_key: str | None) -> tuple[Any, ...]:
    """All that the trials of a truth depend on, beside code."""
    demonstrator = settings.demonstrations
    return (
        safe_set_key,
        settings.real_system,
        settings.reality,
        region_inputs(settings, settings.constraint),
        # How many survivors make the study is decided later, and must not make them anew.
        replace(demonstrator, keep=demonstrator.pairs),
        settings.tasks,
        settings.safety,
        settings.horizon,
        settings.seed,
        settings.truth.controls,
    )


def demonstrations(settings: Settings, store: Store) -> TrialSet:
    """The trials of a truth (8), from the store or computed."""
    system, dt, safety = settings.real_model, settings.demonstrations.dt, settings.safety
    omega, omega_key, margin, safety_filter = None, None, safety.margin, None
    if len(settings.constraint):  # where nothing is forbidden, everything is safe
        omega, omega_key = safe_set(settings, store)
        limited = settings.limited_model
        margin = border_margin(limited, omega, dt) if margin is None else margin
        integrator = _skill(settings)["integrator"]
        safety_filter = SafetyFilter(limited, omega, dt, margin, safety.width, integrator)

    def compute() -> dict[str, np.ndarray]:
        trials = _trials(settings, omega, margin or 0.0)
        breaking = rule_breakers(settings)
        attempts = _attempts(settings, trials, breaking, safety_filter)
        paths = [attempt.demonstration for attempt in attempts]
        recorded = {
            "starts": np.array([path.task.start for path in paths]),
            "goal_lower": np.array([path.task.goal.lower for path in paths]),
            "goal_upper": np.array([path.task.goal.upper for path in paths]),
            "states": np.array([path.states for path in paths]),
        }
        if settings.reality.sensor_noise is not None:
            noise = _sensor_noise(settings, settings.reality.sensor_noise)
            recorded = _measured(recorded, noise, system.space)
        return {
            "outcome": np.array([attempt.outcome.value for attempt in attempts]),
            "rule_breaking": breaking,
            **recorded,
            "controls": np.array([path.controls for path in paths]),
            "cost": np.array([attempt.cost for attempt in attempts]),
            "miss": np.array([attempt.miss for attempt in attempts]),
        }

    modules = [
        mlci.demonstrator,
        mlci.control.effort,
        mlci.safety.safety_filter,
        system_module(settings.model),
        sys.modules[__name__],
        *shape_modules(settings, settings.constraint),
    ]
    inputs = demonstration_inputs(settings, omega_key)
    return TrialSet(**store.get("demonstrations", inputs, modules, compute))


def rule_breakers(settings: Settings) -> Bools:
    """(P,) which trials are of demonstrators who ignore the constraint.

    Those of a smaller share are among those of a larger one.
    """
    demonstrator = settings.demonstrations
    draws = [
        stream(settings.seed, Purpose.RULE_BREAKING, trial).random()
        for trial in range(demonstrator.pairs)
    ]
    return np.array(draws) < demonstrator.rule_breaking


def _attempts(
    settings: Settings,
    trials: list[Trial],
    breaking: Bools,
    safety_filter: SafetyFilter | None,
) -> list[Attempt]:
    """What becomes of every trial; who ignores the constraint may enter the truth."""
    attempts: dict[int, Attempt] = {}
    skill = _skill(settings)
    limited = skill | {"limit": settings.control_limit}
    for members, truth, kept_by, skill_of in (
        (np.flatnonzero(~breaking), settings.constraint, safety_filter, limited),
        (np.flatnonzero(breaking), None, None, skill),
    ):
        if len(members):
            tried = [trials[member] for member in members]
            of_members = demonstrate(settings.real_model, tried, truth, kept_by, **skill_of)
            attempts |= dict(zip(members.tolist(), of_members, strict=True))
    return [attempts[number] for number in range(len(trials))]


def _sensor_noise(settings: Settings, deviation: tuple[float, ...]) -> Floats:
    """(P, K+1, n) what is wrong with recorded states, of a standard deviation (n,)."""
    demonstrator = settings.demonstrations
    shape = step_count(settings.horizon, demonstrator.dt) + 1, len(deviation)
    return np.array(
        [
            stream(settings.seed, Purpose.SENSOR_NOISE, trial).normal(0.0, deviation, shape)
            for trial in range(demonstrator.pairs)
        ]
    )


def _measured(exact: dict[str, Floats], noise: Floats, space: StateSpace) -> dict[str, Floats]:
    """Paths and tasks as recorded: start, and goal where it is a point, are read off the path.

    No sensor shows a state outside of the state space.
    """
    low, high = (
        np.where(space.periodic, side, end)
        for side, end in ((-np.inf, space.bounds.lower), (np.inf, space.bounds.upper))
    )
    states = np.clip(exact["states"] + noise, low, high)
    lower, upper = exact["goal_lower"], exact["goal_upper"]
    point = lower == upper
    return {
        "starts": states[:, 0],
        "goal_lower": np.where(point, states[:, -1], lower),
        "goal_upper": np.where(point, states[:, -1], upper),
        "states": states,
    }


def _trials(settings: Settings, omega: SafeSet | None, margin: float) -> list[Trial]:
    """The trials that the demonstrator tries.

    Raises:
        NoAnswer: too few tasks cross the truth, where only those are wanted.
    """
    system, demonstrator = settings.real_model, settings.demonstrations
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
        control_noise=settings.reality.control_noise,
    )
    if not settings.tasks.crossing:
        return draw()
    trials: list[Trial] = []
    for batch in range(_MOST_BATCHES):
        drawn = draw(first=batch * demonstrator.pairs)
        trials += crossing(system, drawn, settings.constraint, **_skill(settings))
        if len(trials) >= demonstrator.pairs:
            return trials[: demonstrator.pairs]
    raise NoAnswer(
        f"of {_MOST_BATCHES * demonstrator.pairs} tasks only {len(trials)} would enter the truth "
        "if it were not there: widen truth.boxes or tasks, or set tasks.crossing=false"
    )


def nominal_skill(settings: Settings) -> dict[str, Any]:
    """What `demonstrate` has to know of the demonstrator that inference knows of."""
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


def _skill(settings: Settings) -> dict[str, Any]:
    """The same of the demonstrators that there really are."""
    skill, reality = nominal_skill(settings), settings.reality
    if reality.iterations is not None:
        skill["iterations"] = reality.iterations
    if reality.integrator is not None:
        skill["integrator"] = _INTEGRATORS[reality.integrator]
    return skill
