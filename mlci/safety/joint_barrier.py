"""A safety filter for chains of any number of joints: brake a joint before it enters K.

K is a union of boxes of joint angles, at any rates. A box is not entered as long as one of its
joints stays on one side of it. With p how far the joint is from that side, and v its rate away from
it, a joint that brakes by a keeps to its side for ever if

    p - min(v, 0)^2 / (2 a) >= 0.

V is the largest of these numbers over the joints and sides of a box, the smallest over boxes. Where
V >= 0, holding the best joint of each box keeps out of K for ever: an inner approximation of (10),
of any dimension and without a grid. It is sound where torques are not limited, as the paper's
demonstrators exceed the control range: inverse dynamics give any acceleration of one joint and
leave those of the others. `braking_controls` says how large controls that takes.

While it acts, the filter lets the joint go as fast as it could still be braked after a hold dt,

    v' >= -sqrt(2 a (p + v dt - margin)),

a barrier that paths glide along (Ames et al. 2019, "Control barrier functions: theory and
applications"). Within a hold the dynamics are taken as those at its start: the joint may come
nearer by about a dt^2 / 2, which the margin is for, and brakes by up to 2 a.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.control.control_problem import ControlFilter
from mlci.differences import first_derivatives
from mlci.mechanics.planar_chain import PlanarChain
from mlci.regions import Regions
from mlci.spaces import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class JointBarrier(ControlFilter):
    """What keeps a chain out of boxes of joint angles; see the module's head.

    Attributes:
        chain: the chain, whose joints that K bounds do not wrap.
        truth: K.
        dt: hold time of the controls [s].
        braking: (L,) a, the deceleration that each joint is trusted to [rad/s^2].
        margin: how far from K it stays [rad].

    Raises:
        ValueError: a region that is no box of joint angles, a joint that wraps, or numbers that are
            not positive.
    """

    chain: PlanarChain
    truth: Regions
    dt: float
    braking: tuple[float, ...]
    margin: float = 0.02

    def __post_init__(self) -> None:
        if not (0 < self.dt < np.inf and 0 <= self.margin < np.inf):
            raise ValueError(f"a barrier needs dt > 0 and margin >= 0: {self.dt}, {self.margin}")
        if len(self.braking) != self.chain.links or not np.all(np.array(self.braking) > 0):
            raise ValueError(
                f"a barrier needs a positive deceleration of each joint, not {self.braking}"
            )
        links, space = self.chain.links, self.chain.space
        if self.truth.space.dimension != space.dimension:
            raise ValueError(
                f"a barrier of a chain of {space.dimension} dimensions keeps out of regions of as "
                f"many, not of {self.truth.space.dimension}"
            )
        bounded = np.isfinite(self.truth.lower) | np.isfinite(self.truth.upper)
        if not np.all(self.truth.are_boxes) or np.any(bounded[:, links:]):
            raise ValueError("a barrier keeps out of boxes of joint angles at any rates alone")
        if not np.all(np.any(bounded, axis=1)):
            raise ValueError("a barrier cannot keep out of a region that bounds no joint")
        if wraps := [
            space.names[d] for d in np.flatnonzero(np.any(bounded, axis=0) & space.periodic)
        ]:
            raise ValueError(f"a barrier knows no side of joints that wrap: {', '.join(wraps)}")

    def value(self, states: Floats) -> Floats:
        """V (...) at states (..., 2 L) [rad]; inf where nothing is forbidden."""
        return np.asarray(np.min(np.max(self._rooms(states), axis=-1), axis=-1, initial=np.inf))

    def contains(self, states: Floats, margin: float = 0.0) -> Bools:
        """Whether V >= margin at states (..., 2 L)."""
        return np.asarray(self.value(states) >= margin)

    def apply(self, states: Floats, controls: Floats, ahead: Floats | None = None) -> Floats:
        """See `ControlFilter.apply`: the best joint of each box that a hold would come too near.

        Raises:
            ValueError: states that are not (..., 2 L), or controls that are not (..., L).
        """
        self._check(states, controls)
        if ahead is None:
            ahead = states + self.dt * self.chain.dynamics(states, controls)
        applied = np.array(controls, dtype=float)
        for box, near, guard in self._active(states, ahead):
            applied[near] += self._correction(states[near], applied[near], box, guard)
        return applied

    def linearize(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """See `ControlFilter.linearize`: by differences, of the same joints; errors as `apply`."""
        self._check(states, controls)
        n, m = states.shape[-1], controls.shape[-1]
        by_state = np.zeros((*controls.shape, n))
        by_control = np.broadcast_to(np.eye(m), (*controls.shape, m)).copy()
        applied = np.array(controls, dtype=float)
        ahead = states + self.dt * self.chain.dynamics(states, controls)
        for box, near, guard in self._active(states, ahead):
            point = np.concatenate([states[near], applied[near]], axis=-1)

            def corrected(z: Floats, box: int = box, guard: Ints = guard) -> Floats:
                """Applied controls (B, m) at (x, u) (B, n + m)."""
                return z[..., n:] + self._correction(z[..., :n], z[..., n:], box, guard)

            change = first_derivatives(corrected, point)
            by_state[near] = change[..., :n] + change[..., n:] @ by_state[near]
            by_control[near] = change[..., n:] @ by_control[near]
            applied[near] = corrected(point)
        return by_state, by_control

    def braking_controls(self, states: Floats) -> Floats:
        """(..., L) the largest control, of any joint, that brakes each joint by a alone."""
        chain, found = self.chain, []
        rest = chain.controls_for(states, np.zeros((*states.shape[:-1], chain.links)))
        for joint, most in enumerate(self.braking):
            push = most * np.eye(chain.links)[joint]
            away = chain.controls_for(states, np.broadcast_to(push, rest.shape)) - rest
            found.append(np.max(np.abs(rest) + np.abs(away), axis=-1))
        return np.stack(found, axis=-1)

    def _check(self, states: Floats, controls: Floats) -> None:
        """Refuse states and controls that are not of the chain, or do not belong together."""
        links, shapes = self.chain.links, (np.shape(states), np.shape(controls))
        batch = shapes[0][:-1]
        if shapes != ((*batch, 2 * links), (*batch, links)):
            raise ValueError(
                f"a barrier of {links} joints takes states (..., {2 * links}) and as many controls "
                f"(..., {links}), not {shapes[0]} and {shapes[1]}"
            )

    @cached_property
    def _sides(self) -> tuple[Floats, Floats, Floats]:
        """Borders (C, 2 L) and whether they are some, first below K then above, and a (2 L,)."""
        links = self.chain.links
        borders = np.hstack([self.truth.lower[:, :links], self.truth.upper[:, :links]])
        return borders, np.isfinite(borders), np.tile(self.braking, 2)

    def _rooms(self, states: Floats) -> Floats:
        """What each joint and side (..., C, 2 L) has of room; -inf where K has no such side."""
        _, known, braking = self._sides
        away, rate = self._from_borders(states)
        room = away - np.square(np.minimum(rate, 0.0)) / (2 * braking)
        return np.where(known, room, -np.inf)

    def _from_borders(self, states: Floats) -> tuple[Floats, Floats]:
        """p (..., C, 2 L) and v (..., 1, 2 L)."""
        links, borders = self.chain.links, self._sides[0]
        sign = np.repeat([-1.0, 1.0], links)
        angles = np.tile(states[..., None, :links], 2)
        rates = np.tile(states[..., None, links:], 2)
        with np.errstate(invalid="ignore"):
            return sign * (angles - borders), sign * rates

    def _active(self, states: Floats, ahead: Floats) -> list[tuple[int, Bools, Ints]]:
        """Boxes that states ahead are too near to, at which states, and the best joint's side."""
        rooms, found = self._rooms(ahead), []
        near = ~(np.max(rooms, axis=-1) >= self.margin)
        for box in np.flatnonzero(np.any(near, axis=tuple(range(near.ndim - 1)))).tolist():
            where = near[..., box]
            found.append((box, where, np.argmax(self._rooms(states[where])[:, box], axis=-1)))
        return found

    def _correction(self, states: Floats, controls: Floats, box: int, guard: Ints) -> Floats:
        """What is added to controls (B, L) so that a joint's side (B,) keeps out of a box."""
        chain, links = self.chain, self.chain.links
        away, rate = (
            np.take_along_axis(each, guard[..., None], axis=-1)[..., 0]
            for each in self._side_of(states, box)
        )
        least = -np.sqrt(
            2 * self._sides[2][guard] * np.maximum(away + self.dt * rate - self.margin, 0.0)
        )
        joint, sign = guard % links, np.where(guard < links, -1.0, 1.0)
        bending = chain.dynamics(states, controls)[..., links:]
        now = sign * np.take_along_axis(bending, joint[..., None], axis=-1)[..., 0]
        more = np.maximum((least - rate) / self.dt - now, 0.0)
        wanted = np.where(np.arange(links) == joint[..., None], (sign * more)[..., None], 0.0)
        return chain.controls_for(states, bending + wanted) - chain.controls_for(states, bending)

    def _side_of(self, states: Floats, box: int) -> tuple[Floats, Floats]:
        """p and v (..., 2 L) of one box."""
        away, rate = self._from_borders(states)
        return away[..., box, :], np.broadcast_to(rate[..., 0, :], away[..., box, :].shape)
