"""A chain of links that motors or muscles at its joints move: arms, legs, and whole bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.mechanics.rigid_chain import RigidChain, steepness
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import System

_LISTS = ("masses", "centers", "inertias", "lower", "upper", "speed_limits", "torques")
_OPTIONAL = ("drag", "rotors", "joints")


@dataclass(frozen=True, eq=False)
class PlanarChain(System):
    """L links in a plane, moved by torques at their joints: 2 L dimensions, L controls.

    A state holds L joint angles, then their rates. The first angle is that of the first link from
    upright, the others are against the link before; in a straight chain they are 0. A joint whose
    range is a whole turn wraps. One link with its mass at its end is `Pendulum`, with
    mass = m l^2 / torque.

    Attributes:
        lengths: (L,) from joint to joint, or to the hand [m].
        masses: (L,) [kg].
        centers: (L,) from a link's first joint to its centre of mass [m].
        inertias: (L,) about the centre of mass [kg m^2].
        lower: (L,) least joint angles [rad].
        upper: (L,) largest joint angles [rad].
        speed_limits: (L,) bounds on the joint rates [rad/s].
        torques: (L,) torque of a control of 1 [N m]: the reward -|u|^2 weighs joints by them.
        control_limit: bound on each control.
        gravity: g [m/s^2]; 0 where the chain moves in a horizontal plane.
        drag: (L,) torque that brakes a joint [N m s/rad]; nothing if it is empty.
        rotors: (L,) inertia of each joint's motor through its gear [kg m^2]; 0 if it is empty.
        joints: (L,) names; joint_1 and so on if it is empty.

    Raises:
        ValueError: lists of other lengths, a number that must be positive and is not, names that
            are not different, or a joint whose range is empty or more than a turn.
    """

    lengths: tuple[float, ...]
    masses: tuple[float, ...]
    centers: tuple[float, ...]
    inertias: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    speed_limits: tuple[float, ...]
    torques: tuple[float, ...]
    control_limit: float = 1.0
    gravity: float = 0.0
    drag: tuple[float, ...] = ()
    rotors: tuple[float, ...] = ()
    joints: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        links = len(self.lengths)
        if not links:
            raise ValueError("a PlanarChain needs at least one link")
        for name in (*_LISTS, *(name for name in _OPTIONAL if len(getattr(self, name)))):
            if len(getattr(self, name)) != links:
                raise ValueError(
                    f"PlanarChain.{name} must have a value for each of {links} lengths, not "
                    f"{len(getattr(self, name))}"
                )
        for name in ("lengths", "masses", "speed_limits", "torques", "control_limit"):
            values = np.asarray(getattr(self, name), dtype=float)
            if not np.all(np.isfinite(values) & (values > 0)):
                raise ValueError(f"PlanarChain.{name} must be positive, not {getattr(self, name)}")
        for name in ("centers", "inertias", "drag", "rotors"):
            values = np.asarray(getattr(self, name), dtype=float)
            if not np.all(np.isfinite(values) & (values >= 0)):
                raise ValueError(f"PlanarChain.{name} must be at least 0: {getattr(self, name)}")
        if np.any(np.add(np.square(self.centers), self.inertias) == 0):
            raise ValueError("a link of a PlanarChain needs a centre or an inertia above 0")
        if not np.isfinite(self.gravity):
            raise ValueError(f"PlanarChain.gravity must be finite, not {self.gravity}")
        if len({*self.joints, *(f"{name}_speed" for name in self.joints)}) < 2 * len(self.joints):
            raise ValueError(
                f"PlanarChain.joints must be different, and each from another's with _speed, not "
                f"{self.joints}"
            )
        widths = np.subtract(self.upper, self.lower)
        if not np.all((widths > 0) & (widths <= 2 * np.pi + 1e-9)):
            raise ValueError(
                f"a joint of a PlanarChain moves between angles that are no more than a turn "
                f"apart, not {self.lower} and {self.upper}"
            )

    @cached_property
    def body(self) -> RigidChain:
        """The links without their joints' limits."""
        return RigidChain(
            np.array(self.lengths, dtype=float),
            np.array(self.masses, dtype=float),
            np.array(self.centers, dtype=float),
            np.array(self.inertias, dtype=float),
            np.array(self.rotors or (0.0,) * self.links, dtype=float),
            self.gravity,
        )

    @property
    def links(self) -> int:
        """L."""
        return len(self.lengths)

    @cached_property
    def space(self) -> StateSpace:
        names = self.joints or tuple(f"joint_{k + 1}" for k in range(self.links))
        speeds = np.array(self.speed_limits, dtype=float)
        bounds = Box(np.append(self.lower, -speeds), np.append(self.upper, speeds))
        turns = np.isclose(np.subtract(self.upper, self.lower), 2 * np.pi, rtol=0, atol=1e-9)
        return StateSpace(
            bounds,
            np.append(turns, np.zeros(self.links, dtype=bool)),
            (*names, *(f"{name}_speed" for name in names)),
            ("rad",) * self.links + ("rad/s",) * self.links,
        )

    @cached_property
    def control_box(self) -> Box:
        most = np.full(self.links, self.control_limit)
        return Box(-most, most)

    def dynamics(self, states: Floats, controls: Floats) -> Floats:
        angles, rates, torques = self._rows(states, controls)
        bending = self.body.accelerations(angles, rates, torques)
        found = np.empty((2 * self.links, *bending.shape[1:]))
        found[: self.links], found[self.links :] = rates, bending
        return np.moveaxis(found, 0, -1)

    def jacobians(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        links, each = self.links, np.arange(self.links)
        change = self.body.derivatives(*self._rows(states, controls))
        by_torque = change[:, 2 * links :]
        if self.drag:
            change[:, links : 2 * links] -= by_torque * _column(self.drag, by_torque.ndim - 1)
        found = np.zeros((2 * links, 3 * links, *change.shape[2:]))
        found[each, links + each], found[links:] = 1.0, change
        found[links:, 2 * links :] = by_torque * _column(self.torques, by_torque.ndim - 1)
        found = np.moveaxis(found, (0, 1), (-2, -1))
        return found[..., : 2 * links], found[..., 2 * links :]

    def controls_for(self, states: Floats, accelerations: Floats) -> Floats:
        """Controls (..., L) under which the joints accelerate so (..., L) [rad/s^2]."""
        angles, rates, bending = self._aligned(states, accelerations)
        torques = self.body.torques(angles, rates, bending)
        if self.drag:
            torques = torques + _column(self.drag, torques.ndim) * rates
        return np.moveaxis(torques / _column(self.torques, torques.ndim), 0, -1)

    def hand(self, states: Floats) -> Floats:
        """Where the chain ends (..., 2), forward and up of its first joint [m], at (..., 2 L)."""
        return np.moveaxis(self.body.hand(np.moveaxis(states, -1, 0)[: self.links]), 0, -1)

    def center_of_mass(self, states: Floats) -> Floats:
        """The centre of mass (..., 2), forward and up of the first joint [m], at (..., 2 L)."""
        angles = np.moveaxis(states, -1, 0)[: self.links]
        return np.moveaxis(self.body.center_of_mass(angles), 0, -1)

    @property
    def hand_steepness(self) -> float:
        """The least `steepness` of `InTaskSpace(chain.hand, ...)` [m/rad]."""
        return steepness(self.body.lengths)

    @property
    def center_steepness(self) -> float:
        """The least `steepness` of `InTaskSpace(chain.center_of_mass, ...)` [m/rad]."""
        return steepness(self.body.moments / np.sum(self.body.masses))

    def energy(self, states: Floats) -> Floats:
        """Kinetic and potential energy (...) [J] at (..., 2 L)."""
        rows = np.moveaxis(states, -1, 0)
        return self.body.energy(rows[: self.links], rows[self.links :])

    def _aligned(self, states: Floats, others: Floats) -> tuple[Floats, Floats, Floats]:
        """Angles, rates and what stands beside them, (L, ...) each, with as many axes."""
        axes = max(states.ndim, others.ndim)
        rows = [
            np.moveaxis(each.reshape(*(1,) * (axes - each.ndim), *each.shape), -1, 0)
            for each in (states, others)
        ]
        return rows[0][: self.links], rows[0][self.links :], rows[1]

    def _rows(self, states: Floats, controls: Floats) -> tuple[Floats, Floats, Floats]:
        """Angles, rates and torques (L, ...), with as many axes; drag is taken off torques."""
        angles, rates, controls = self._aligned(states, controls)
        torques = controls * _column(self.torques, controls.ndim)
        if self.drag:
            torques = torques - _column(self.drag, rates.ndim) * rates
        batch = np.broadcast_shapes(angles.shape, torques.shape)
        return angles, rates, np.broadcast_to(torques, batch)


def _column(values: tuple[float, ...], axes: int) -> Floats:
    """Values (L,) with as many axes."""
    return np.array(values, dtype=float).reshape(-1, *(1,) * (axes - 1))
