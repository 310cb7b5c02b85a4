"""What keeps simulated demonstrators out of a truth: a safe set, and a filter that stays in it."""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType

import mlci.safety.joint_barrier
import mlci.safety.safety_filter
from experiments.config.settings import BARRIER, Settings
from experiments.point.stages import safe_set
from experiments.tracking.store import Store
from mlci.control.control_problem import ControlFilter, SafeStates
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import Integrator


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
    margin = border_margin(system, omega, dt) if safety.margin is None else safety.margin
    kept_by = SafetyFilter(system, omega, dt, margin, safety.width, integrator)
    return KeepOut(omega, margin, kept_by, mlci.safety.safety_filter, key)
