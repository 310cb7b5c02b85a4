"""What keeps simulated demonstrators out of a truth: a safe set, and a filter that stays in it."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import mlci.safety.joint_barrier
import mlci.safety.safety_filter
from experiments.config.settings import BARRIER, Settings
from experiments.point.no_answer import NoAnswer
from experiments.point.stages import safe_set
from experiments.tracking.store import Store
from mlci.control.control_problem import ControlFilter, SafeStates
from mlci.safety.reachability import SafeSet
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import Integrator
from mlci.systems import System


@dataclass(frozen=True, eq=False)
class KeepOut:
    """What keeps out of a truth.

    Attributes:
        safe: the states that can.
        margin: V that starts and goals have at least.
        filter: what replaces controls that would leave these states.
        module: the module that decides how.
        key: of the stored safe set; None where it has no grid.
    """

    safe: SafeStates
    margin: float
    filter: ControlFilter
    module: ModuleType
    key: str | None = None


def keep_out(settings: Settings, store: Store, integrator: Integrator) -> KeepOut:
    """What keeps a point's demonstrators out of its truth.

    Args:
        settings: a point whose truth has regions.
        store: where safe sets are kept.
        integrator: the demonstrator's.
    """
    safety, dt = settings.safety, settings.demonstrations.dt
    if safety.method == BARRIER:
        barrier = safety.barrier(settings.real_system.build(), settings.constraint, dt)
        return KeepOut(barrier, barrier.margin, barrier, mlci.safety.joint_barrier)
    system = settings.limited_model
    omega, key = safe_set(settings, store)
    margin = derived_margin(system, omega, dt) if safety.margin is None else safety.margin
    kept_by = SafetyFilter(system, omega, dt, margin, safety.width, integrator)
    return KeepOut(omega, margin, kept_by, mlci.safety.safety_filter, key)


def derived_margin(system: System, safe_set: SafeSet, dt: float) -> float:
    """The margin of a safe set, where none is given; see `border_margin`.

    Raises:
        NoAnswer: there is none, since V changes too fast for the grid and the hold.
    """
    try:
        return border_margin(system, safe_set, dt)
    except ValueError as error:
        raise NoAnswer(
            f"safety.margin: null, but {error}, as in safety.margin=0.1, or use more cells in "
            "safety.shape, or a shorter demonstrations.dt"
        ) from error
