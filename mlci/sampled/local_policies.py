"""Gaussian policies round the modes of a passage, which propose its paths.

Around a way the dynamics are taken as linear in deviations, and the logarithm of the density as
quadratic. Backwards in time that is the Riccati recursion: with the cost J = -log f, and a cost to
go V_(k+1) that is quadratic,

    Q = l_k + V_(k+1)(F_k),    u | x ~ N(u* - Q_uu^-1 (Q_u + Q_ux (x - x*)), Q_uu^-1),

since exp(-Q), as a function of u, is a Gaussian of covariance Q_uu^-1 whose integral is exp(-V_k).
For a linear system with a quadratic reward that is the law of the paths exactly. V's slope times
the dynamics' second derivatives belongs to Q, which the demonstrator's optimiser leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlci.sampled.modes import GOAL_SHARE, Modes
from mlci.sampled.passage import Passage
from mlci.sampled.truncated_normal import mean_and_variance
from mlci.spaces import Floats, Ints

_LEAST = 0.3  # of the reward's own curvature by a control, which Q_uu keeps where V is not convex
_NUDGE = 1e-4  # by which second derivatives are taken
_PRIOR = 10  # effective samples for each coefficient that the policy before stands for in a refit


@dataclass(frozen=True, eq=False)
class LocalPolicies:
    """P policies, each of which takes a control that is Gaussian about a function of the state.

    Attributes:
        mode: (P,) number of the mode that each belongs to.
        states: (P, T, n) states of its way.
        mean: (P, T, m) mean control there.
        gain: (P, T, m, n) its derivative by the state.
        root: (P, T, m, m) lower triangular root of the control's covariance.
    """

    mode: Ints
    states: Floats
    mean: Floats
    gain: Floats
    root: Floats

    def __len__(self) -> int:
        return len(self.mode)

    def joined(self, other: LocalPolicies) -> LocalPolicies:
        """These policies, then the other's."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return LocalPolicies(*(np.concatenate(pair) for pair in pairs))

    def of(self, numbers: slice) -> LocalPolicies:
        """Some of these policies."""
        return LocalPolicies(*(each[numbers] for each in vars(self).values()))

    def means(self, number: int, states: Floats) -> Floats:
        """(N, T, m) mean controls of a policy at states (N, T, n)."""
        apart = states - self.states[number]
        return np.asarray(
            self.mean[number] + np.einsum("tij,btj->bti", self.gain[number], apart, optimize=True)
        )

    def deviates(self, number: int, states: Floats, controls: Floats) -> Floats:
        """(N, T, m) the standard normal numbers that make a policy take controls (N, T, m)."""
        rest = controls - self.means(number, states)
        inverse = np.linalg.inv(self.root[number])
        return np.asarray(np.einsum("tij,btj->bti", inverse, rest, optimize=True))


def riccati_policies(passage: Passage, modes: Modes) -> tuple[LocalPolicies, Floats]:
    """The policy round each mode, and the log of the integral of its Gaussian (M,) [nat].

    Where the recursion diverges, the policy is that of a reward without dynamics: no feedback.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return _backwards(passage, modes)


def _backwards(passage: Passage, modes: Modes) -> tuple[LocalPolicies, Floats]:
    """See `riccati_policies`."""
    states, controls = modes.states, modes.controls
    members, steps, m = controls.shape
    n = states.shape[-1]
    price = passage.goal_price(GOAL_SHARE) / passage.temperature
    slope = 2 * price * (states[:, -1] - modes.goals)
    curvature = np.broadcast_to(np.diag(2 * price), (members, n, n))
    shift, gain, covariance = (
        np.empty((members, steps, *shape)) for shape in ((m,), (m, n), (m, m))
    )
    alone, diverges = np.empty((members, steps)), np.zeros(members, dtype=bool)
    for k in range(steps - 1, -1, -1):
        q, q_slope, least = _expansion(passage, states[:, k], controls[:, k], slope, curvature)
        lost = ~(np.isfinite(q).all(axis=(1, 2)) & np.isfinite(q_slope).all(axis=1))
        q[lost], q_slope[lost], diverges = np.eye(n + m), 0.0, diverges | lost
        alone[:, k] = 1 / np.sqrt(np.maximum(_LEAST * least, 1e-12))
        inverse = _inverse(q[:, n:, n:], least)
        across = q[:, n:, :n]
        covariance[:, k] = inverse
        shift[:, k] = -np.einsum("bij,bj->bi", inverse, q_slope[:, n:])
        gain[:, k] = -inverse @ across
        slope = q_slope[:, :n] + np.einsum("bji,bj->bi", across, shift[:, k])
        curvature = q[:, :n, :n] + across.mT @ gain[:, k]
        curvature = (curvature + curvature.mT) / 2
    for member in range(members):
        diverges[member] |= not _has_root(covariance[member])
    shift[diverges], gain[diverges], covariance[diverges] = 0.0, 0.0, np.eye(m)
    root = np.linalg.cholesky(covariance)
    root[diverges] *= alone[diverges, :, None, None]
    log_volume = np.sum(np.log(np.diagonal(root, axis1=-2, axis2=-1)), axis=(1, 2))
    log_integral = -modes.cost + log_volume + steps * m / 2 * np.log(2 * np.pi)
    policies = LocalPolicies(np.arange(members), states[:, :-1], controls + shift, gain, root)
    return policies, log_integral


def _expansion(
    passage: Passage, states: Floats, controls: Floats, slope: Floats, curvature: Floats
) -> tuple[Floats, Floats, Floats]:
    """Q's Hessian (M, n + m, n + m) and gradient (M, n + m) in (x, u), and the reward's own
    curvature (M,) by the control, from V's slope (M, n) and curvature (M, n, n)."""
    (members, n), scale = states.shape, passage.dt / passage.temperature
    point = np.concatenate([states, controls], axis=-1)
    d = point.shape[-1]
    nudges = _NUDGE * np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)])
    by_point = _jacobian(passage, point + nudges[:, None, :], n)
    gradient, hessian = passage.system.reward_derivatives(states, controls)
    change = (by_point[1 : 1 + d] - by_point[1 + d :]) / (2 * _NUDGE)
    bent = np.einsum("dbij,bi->bdj", change, slope)  # V's slope times second derivatives
    by_point = by_point[0]
    q = by_point.mT @ curvature @ by_point - scale * hessian + (bent + bent.mT) / 2
    q_slope = np.einsum("bij,bi->bj", by_point, slope) - scale * gradient
    own = np.broadcast_to(-scale * hessian[..., n:, n:], (members, d - n, d - n))
    return q, q_slope, np.min(np.linalg.eigvalsh(own), axis=-1)


def _jacobian(passage: Passage, point: Floats, n: int) -> Floats:
    """Derivative (..., n, n + m) of the next state by (x, u) (..., n + m)."""
    of = passage.system, point[..., :n], point[..., n:], passage.dt
    rate = np.concatenate(passage.integrator.rate_jacobians(*of), axis=-1)
    return np.asarray(np.eye(n, point.shape[-1]) + passage.dt * rate)


def _has_root(covariance: Floats) -> bool:
    """Whether matrices (T, m, m) are finite and positive definite, rounding included."""
    if not np.isfinite(covariance).all():
        return False
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return False
    return True


def _inverse(q_uu: Floats, least: Floats) -> Floats:
    """Inverse of Q_uu (M, m, m), whose eigenvalues are at least a share of those (M,)."""
    values, vectors = np.linalg.eigh(q_uu)
    values = np.maximum(values, np.maximum(_LEAST * least, 1e-12)[:, None])
    return np.asarray((vectors / values[:, None, :]) @ vectors.mT)


def refit(
    policies: LocalPolicies,
    states: Floats,
    controls: Floats,
    share: Floats,
    limits: tuple[Floats, Floats],
) -> LocalPolicies:
    """The policies that weighted paths would most likely come from: a round of cross-entropy.

    For each time and policy a linear regression of the control on the state, in which the policy
    before counts as some effective samples. Limits make means and variances others than those of
    the policy, so that what is fitted is how far the paths are from what it gives within them.

    Args:
        policies: P policies that are near to the paths.
        states: (N, T, n) where controls begin.
        controls: (N, T, m) controls.
        share: (N, P) weight of each path that belongs to each policy.
        limits: (m,) least and largest controls.
    """
    mean, gain, root = policies.mean.copy(), policies.gain.copy(), policies.root.copy()
    for p in range(len(policies)):
        used = np.flatnonzero(share[:, p] > 0)
        if not len(used):
            continue
        weight = share[used, p] / np.sum(share[used, p])
        rest, variance = _rest(policies, p, states[used], controls[used], limits)
        expected = np.einsum("b,bti->ti", weight, variance)[:, None, :]
        rest = np.moveaxis(rest, 1, 0)
        apart = states[used] - policies.states[p]
        design = np.moveaxis(np.concatenate([np.ones((*apart.shape[:2], 1)), apart], -1), 1, 0)
        scale = np.sqrt(np.einsum("b,tbi->ti", weight, np.square(design)))[:, None, :]
        scale = np.where(scale > 0, scale, 1.0)
        design = design / scale
        prior = _PRIOR * design.shape[-1] * np.sum(np.square(weight))
        weighted = (design * weight[:, None]).mT
        normal = weighted @ design + prior * np.eye(design.shape[-1])
        change = np.linalg.solve(normal, weighted @ rest)
        rest = (rest - design @ change) / np.sqrt(np.maximum(expected, _LEAST))
        scatter = (rest * weight[:, None]).mT @ rest + prior * np.eye(rest.shape[-1])
        change = change / np.maximum(expected, _LEAST) / scale.mT
        change = policies.root[p] @ change.mT  # (T, m, 1 + n)
        mean[p] += change[..., 0]
        gain[p] += change[..., 1:]
        root[p] = policies.root[p] @ np.linalg.cholesky(scatter / (1 + prior))
    return LocalPolicies(policies.mode, policies.states, mean, gain, root)


def _rest(
    policies: LocalPolicies,
    number: int,
    states: Floats,
    controls: Floats,
    limits: tuple[Floats, Floats],
) -> tuple[Floats, Floats]:
    """Deviates (N, T, m) less their mean within the limits, and their variance there (N, T, m)."""
    deviates = policies.deviates(number, states, controls)
    if np.all(np.isinf(limits)):
        return deviates, np.ones(deviates.shape)
    diagonal = np.diagonal(policies.root[number], axis1=-2, axis2=-1)
    middle = controls - diagonal * deviates
    mean, variance = mean_and_variance(*((limit - middle) / diagonal for limit in limits))
    return deviates - mean, variance
