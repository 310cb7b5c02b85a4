"""Hypotheses about what is applied: sets of pairs of a state and a control that may be forbidden.

A *window* is a piece of a path that lasts as long as a time step of the tabular model. Its pair is
the state in its middle and the mean of the controls over it: a move of the tabular model has one
window, and a demonstration is looked at through all that fit into it, as noise of recorded states
makes spikes of single controls.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.inverse_dynamics import controls_along
from mlci.spaces import Bools, Floats
from mlci.systems import System


class ControlHypotheses(ABC):
    """C hypotheses, each of which forbids some pairs of a state and a control.

    Attributes:
        names: (C,) name of each.
        uses_states: whether any of them depends on the state.
    """

    names: tuple[str, ...]
    uses_states: ClassVar[bool] = True

    def __len__(self) -> int:
        return len(self.names)

    @abstractmethod
    def check(self, system: System) -> None:
        """Raise a ValueError unless they are hypotheses about a system."""

    @abstractmethod
    def holds(self, states: Floats, controls: Floats) -> Bools:
        """(..., C) which forbid pairs of wrapped states (..., n) and controls (..., m)."""

    def applied_by(
        self,
        system: System,
        demonstration: Demonstration,
        window: float,
        tolerance: Floats | float = 0.0,
    ) -> Bools:
        """(C,) which hypotheses a demonstration violates: the pair of some window is forbidden.

        Its recorded controls count, or else those of `mlci.inverse_dynamics.controls_along`. As a
        mean is linear in when its window begins, but where an end passes a sample, these windows
        are looked at.

        Args:
            system: the dynamics.
            demonstration: the path.
            window: length of the windows [s], such as the time step of a tabular model.
            tolerance: (m,) a pair counts if it is forbidden with all controls that are so near, in
                their units.

        Raises:
            ValueError: a window that is not positive, or longer than the demonstration; controls of
                another number than the system's.
        """
        middles, controls = window_pairs(system, demonstration, window)
        reach = np.broadcast_to(np.asarray(tolerance, dtype=float), controls.shape[-1:])
        signs = product(*((-1.0, 1.0) if side else (0.0,) for side in reach.tolist()))
        held = [self.holds(middles, controls + np.array(sign) * reach) for sign in signs]
        return np.asarray(np.any(np.all(held, axis=0), axis=0))


@dataclass(frozen=True, eq=False)
class JoinedHypotheses(ControlHypotheses):
    """Hypotheses of several kinds as one list.

    Attributes:
        parts: the kinds, in order; their lengths add up to C.

    Raises:
        ValueError: two of one name.
    """

    parts: tuple[ControlHypotheses, ...]

    def __post_init__(self) -> None:
        if len(set(self.names)) < len(self.names):
            raise ValueError(f"{len(self)} hypotheses need as many names, not {list(self.names)}")

    @property
    def names(self) -> tuple[str, ...]:  # type: ignore[override]
        """(C,) those of the parts."""
        return tuple(name for part in self.parts for name in part.names)

    @property
    def uses_states(self) -> bool:  # type: ignore[override]
        """Whether any of them depends on the state."""
        return any(part.uses_states for part in self.parts if len(part))

    def check(self, system: System) -> None:
        """See `ControlHypotheses.check`."""
        for part in self.parts:
            part.check(system)

    def holds(self, states: Floats, controls: Floats) -> Bools:
        """See `ControlHypotheses.holds`."""
        return np.concatenate(
            [part.holds(states, controls) for part in self.parts if len(part)], axis=-1
        )


def window_pairs(
    system: System, demonstration: Demonstration, window: float
) -> tuple[Floats, Floats]:
    """Wrapped states (W, n) and mean controls (W, m) of the windows of a demonstration.

    Raises:
        ValueError: as of `ControlHypotheses.applied_by`.
    """
    times, controls = demonstration.times, demonstration.controls
    if not 0 < window <= times[-1] * (1 + 1e-9):
        raise ValueError(
            f"a window must be positive and at most {times[-1]:g} s, as long as the "
            f"demonstration, not {window:g} s"
        )
    if controls is None:
        controls = controls_along(system, demonstration.states, times)
    if controls.shape[1] != system.control_box.dimension:
        raise ValueError(
            f"demonstration {demonstration.name!r} has {controls.shape[1]} controls, the system "
            f"{system.control_box.dimension}"
        )
    effects = np.vstack([np.zeros(controls.shape[1]), controls * np.diff(times)[:, None]])
    total = np.cumsum(effects, axis=0)
    begins = np.union1d(times, times - window)
    begins = begins[(begins >= 0) & (begins <= times[-1] - window * (1 - 1e-9))]
    until, since = (_at(times, total, begins + late) for late in (window, 0.0))
    middles = _at(times, demonstration.states, begins + window / 2)
    return system.space.wrap(middles), (until - since) / window


def _at(times: Floats, values: Floats, wanted: Floats) -> Floats:
    """(W, d) values (K+1, d) at times (K+1,), interpolated linearly at others (W,)."""
    return np.column_stack([np.interp(wanted, times, column) for column in values.T])
