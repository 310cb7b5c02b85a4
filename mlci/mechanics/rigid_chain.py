"""Rigid links in a plane, each hinged to the one before: a chain's equations of motion.

With theta_i the angle of link i from upright, w_i its rate, and r_bi how far link i carries the
centre of mass of link b (its length for b > i, its own centre for b = i, else 0), Lagrange's
equations are

    sum_j A_ij cos(theta_i - theta_j) w_j' = T_i + G_i sin theta_i
                                             - sum_j A_ij sin(theta_i - theta_j) w_j^2,
    A_ij = sum_b m_b r_bi r_bj + I_i [i = j],    G_i = g sum_b m_b r_bi.

A torque tau_i at joint i turns link i and, the other way, link i - 1: T_i = tau_i - tau_(i+1). The
rotor of a geared motor at joint i takes torque J_i (w_i' - w_(i-1)') of it, where J is its inertia
times the square of the gear ratio (without gyroscopic effects: Spong 1987, "Modeling and control of
elastic joint robots").
Arrays begin with the axis of links, so that members of a batch are contiguous.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlci.spaces import Floats


@dataclass(frozen=True, eq=False)
class RigidChain:
    """L links, by what their motion depends on.

    Attributes:
        lengths: (L,) from joint to joint, or to the hand [m].
        masses: (L,) [kg].
        centers: (L,) from a link's first joint to its centre of mass [m].
        inertias: (L,) about the centre of mass [kg m^2].
        rotors: (L,) J, inertia of each joint's motor as seen through its gear [kg m^2].
        gravity: g [m/s^2]; 0 where the chain moves in a horizontal plane.
    """

    lengths: Floats
    masses: Floats
    centers: Floats
    inertias: Floats
    rotors: Floats
    gravity: float

    @cached_property
    def _reach(self) -> Floats:
        """(L, L) r_bi."""
        links = len(self.lengths)
        return np.tril(np.tile(self.lengths, (links, 1)), -1) + np.diag(self.centers)

    @cached_property
    def coupling(self) -> Floats:
        """A (L, L) [kg m^2]."""
        return self._reach.T @ (self.masses[:, None] * self._reach) + np.diag(self.inertias)

    @cached_property
    def geared(self) -> Floats:
        """(L, L) what rotors add to A_ij cos(theta_i - theta_j) [kg m^2]."""
        apart = np.eye(len(self.lengths)) - np.eye(len(self.lengths), k=-1)
        return apart.T @ (self.rotors[:, None] * apart)

    @cached_property
    def moments(self) -> Floats:
        """(L,) sum_b m_b r_bi, of which gravity makes G [kg m]."""
        return self.masses @ self._reach

    def accelerations(self, angles: Floats, rates: Floats, torques: Floats) -> Floats:
        """Joint accelerations (L, ...) [rad/s^2] from joint angles, rates and torques (L, ...)."""
        theta, w = np.cumsum(angles, axis=0), np.cumsum(rates, axis=0)
        sin, cos, squares = np.sin(theta), np.cos(theta), np.square(w)
        force = sin * (self._weights(sin) - self._mixed(cos * squares))
        force = force + cos * self._mixed(sin * squares) + _on_links(torques)
        return _of_joints(_solved(self._mass(sin, cos), force[:, None])[:, 0])

    def torques(self, angles: Floats, rates: Floats, accelerations: Floats) -> Floats:
        """Torques (L, ...) [N m] under which joints accelerate so: inverse dynamics."""
        theta, w = np.cumsum(angles, axis=0), np.cumsum(rates, axis=0)
        sin, cos, squares = np.sin(theta), np.cos(theta), np.square(w)
        turning = np.cumsum(accelerations, axis=0)
        force = cos * self._mixed(cos * turning) + sin * self._mixed(sin * turning)
        force = force + np.tensordot(self.geared, turning, axes=1)
        force = force + sin * self._mixed(cos * squares) - cos * self._mixed(sin * squares)
        return _joint_sums(force - sin * self._weights(sin))

    def inertia(self, angles: Floats) -> Floats:
        """Torque at joint i for a unit of acceleration at joint j (L, L, ...) [kg m^2]."""
        theta = np.cumsum(angles, axis=0)
        mass = self._mass(np.sin(theta), np.cos(theta))
        mass = np.moveaxis(_joint_sums(mass), 1, 0)
        return np.moveaxis(_joint_sums(mass), 1, 0)

    def derivatives(self, angles: Floats, rates: Floats, torques: Floats) -> Floats:
        """Of joint accelerations by angles, rates and torques (L, 3 L, ...)."""
        theta, w = np.cumsum(angles, axis=0), np.cumsum(rates, axis=0)
        links, sin, cos = len(theta), np.sin(theta), np.cos(theta)
        turning = np.cumsum(self.accelerations(angles, rates, torques), axis=0)
        mass = self._mass(sin, cos)
        geared = _of_pairs(self.geared, mass.ndim)
        swirl = _of_pairs(self.coupling, mass.ndim) * (sin[:, None] * cos - cos[:, None] * sin)
        batch = np.broadcast_shapes(theta.shape[1:], turning.shape[1:])
        # How the equations' left side less the right one changes, by theta, w and torques.
        change = np.zeros((links, 3 * links, *batch))
        by_angle = change[:, :links]
        by_angle += swirl * turning - (mass - geared) * np.square(w)
        total, each = np.sum(by_angle, axis=1), np.arange(links)
        by_angle[each, each] -= total + self._weights(cos) * cos
        change[:, links : 2 * links] = 2 * swirl * w
        change[each, 2 * links + each] = -1.0
        change[each[:-1], 2 * links + 1 + each[:-1]] = 1.0
        found = _of_joints(-_solved(mass, change))
        for block in (slice(0, links), slice(links, 2 * links)):  # theta is the sum of angles
            found[:, block] = np.moveaxis(_joint_sums(np.moveaxis(found[:, block], 1, 0)), 1, 0)
        return found

    def energy(self, angles: Floats, rates: Floats) -> Floats:
        """Kinetic and potential energy (...) [J], the latter against the first joint."""
        theta, w = np.cumsum(angles, axis=0), np.cumsum(rates, axis=0)
        sin, cos = np.sin(theta), np.cos(theta)
        momentum = sum(part * self._mixed(part * w) for part in (sin, cos))
        kinetic = np.sum(w * (momentum + np.tensordot(self.geared, w, axes=1)), axis=0) / 2
        return np.asarray(kinetic + np.sum(self._weights(cos) * cos, axis=0))

    def hand(self, angles: Floats) -> Floats:
        """Where the chain ends (2, ...): forward and up from its first joint [m]."""
        return _placed(self.lengths, angles)

    def center_of_mass(self, angles: Floats) -> Floats:
        """The centre of mass of all links (2, ...): forward and up [m]."""
        return _placed(self.moments / np.sum(self.masses), angles)

    def _mass(self, sin: Floats, cos: Floats) -> Floats:
        """A_ij cos(theta_i - theta_j), and what rotors add (L, L, ...)."""
        pairs = sin[:, None] * sin + cos[:, None] * cos
        pairs *= _of_pairs(self.coupling, pairs.ndim)
        if np.any(self.rotors):
            pairs += _of_pairs(self.geared, pairs.ndim)
        return pairs

    def _mixed(self, values: Floats) -> Floats:
        """sum_j A_ij values_j (L, ...)."""
        return np.asarray(np.tensordot(self.coupling, values, axes=1))

    def _weights(self, like: Floats) -> Floats:
        """G (L, 1, ...), of as many axes as an array."""
        return np.asarray(self.gravity * self.moments.reshape(-1, *(1,) * (like.ndim - 1)))


def steepness(carried: Floats) -> float:
    """The most that a point moves per distance between joint angles (L,), Euclidean [m/rad].

    Joint j turns the point about itself, at a distance of at most what all links from j on carry it
    (L,); a straight chain turns it most.
    """
    return float(np.linalg.norm(np.cumsum(carried[::-1])))


def _placed(carried: Floats, angles: Floats) -> Floats:
    """A point (2, ...) that each link carries by a distance (L,)."""
    theta = np.cumsum(angles, axis=0)
    return np.stack([np.tensordot(carried, part(theta), axes=1) for part in (np.sin, np.cos)])


def _of_pairs(matrix: Floats, axes: int) -> Floats:
    """A matrix (L, L) with as many axes."""
    return matrix.reshape(*matrix.shape, *(1,) * (axes - 2))


def _on_links(torques: Floats) -> Floats:
    """T (L, ...) of joint torques."""
    on = np.array(torques, dtype=float)
    on[:-1] -= torques[1:]
    return on


def _joint_sums(on_links: Floats) -> Floats:
    """What of links (L, ...) adds up at each joint: those from it on."""
    return np.cumsum(on_links[::-1], axis=0)[::-1]


def _of_joints(of_links: Floats) -> Floats:
    """Joint rates (L, ...) of those of links."""
    rates = np.array(of_links)
    rates[1:] -= of_links[:-1]
    return rates


def _solved(matrix: Floats, right: Floats) -> Floats:
    """X (L, R, ...) with matrix X = right, of positive definite matrices (L, L, ...).

    Elimination over the whole batch at once: numpy's own solver takes matrices one by one, which
    costs more for each of these few rows.
    """
    matrix, x, count = matrix.copy(), right.copy(), len(matrix)
    for k in range(count - 1):
        factor = matrix[k + 1 :, k] / matrix[k, k]
        matrix[k + 1 :, k + 1 :] -= factor[:, None] * matrix[k, k + 1 :]
        x[k + 1 :] -= factor[:, None] * x[k]
    for k in range(count - 1, -1, -1):
        for j in range(k + 1, count):
            x[k] -= matrix[k, j] * x[j]
        x[k] /= matrix[k, k]
    return x
