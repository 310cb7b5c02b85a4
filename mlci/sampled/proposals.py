"""Paths of a passage, drawn from a mixture of Gaussian policies and weighted.

A component of the mixture is a policy at a width, a factor of its standard deviations: the wider
ones keep the weights bounded where the density has a heavier tail than the policy. A whole path
comes from one component, and its weight is its density over that of the whole mixture (the balance
heuristic of Veach and Guibas 1995, which Owen and Zhou 2000 call deterministic mixture sampling).
Where the control has a limit, normal distributions are truncated, one control given those before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy  # loads scipy.special when it is first used

from mlci.sampled.local_policies import LocalPolicies
from mlci.sampled.passage import Passage
from mlci.sampled.truncated_normal import log_mass, quantile
from mlci.simulate import rk4_step
from mlci.spaces import Bools, Floats, Ints

# Widths are 1 + these / sqrt(number of controls): the length of a normal vector spreads so.
# Narrower ones have more effective samples of most tasks, and miss a part of some without a trace.
_WIDER = np.array([0.0, 1.2, 3.5])
_SHARES = np.array([0.4, 0.4, 0.2])  # of a policy's samples that each width takes


@dataclass(frozen=True, eq=False)
class Proposal:
    """A mixture of Q components.

    Attributes:
        policies: the P policies.
        policy: (Q,) the policy of each component.
        width: (Q,) multiplies its standard deviations.
        count: (Q,) number of paths that it gives.
    """

    policies: LocalPolicies
    policy: Ints
    width: Floats
    count: Ints

    @classmethod
    def of(cls, policies: LocalPolicies, shares: Floats, samples: int) -> Proposal:
        """Each policy at each width, at least once; shares (P,) of policies add up to 1."""
        policy = np.repeat(np.arange(len(policies)), len(_WIDER))
        widths = 1 + _WIDER / np.sqrt(policies.mean[0].size)
        count = np.maximum(1, np.round(samples * np.outer(shares, _SHARES).ravel()))
        return cls(policies, policy, np.tile(widths, len(policies)), count.astype(np.int64))

    def resized(self, samples: int) -> Proposal:
        """The same mixture with so many samples, or nearly; at least one of each component."""
        count = np.round(samples * self.count / np.sum(self.count)).astype(np.int64)
        return replace(self, count=np.maximum(1, count))

    def joined(self, other: Proposal) -> Proposal:
        """The components of this mixture, then the other's."""
        return Proposal(
            self.policies.joined(other.policies),
            np.concatenate([self.policy, other.policy + len(self.policies)]),
            np.concatenate([self.width, other.width]),
            np.concatenate([self.count, other.count]),
        )


@dataclass(frozen=True, eq=False)
class Draws:
    """N paths from a proposal.

    Attributes:
        component: (N,) the component that each comes from.
        controls: (N, T, m) controls.
        paths: (N, K+1, n) states after each substep, not wrapped.
        log_weight: (N,) log of density over the mixture's density, whether or not it reaches the
            goal; -inf for a path that leaves the state space.
        excess: (N,) how far the end is from the goal's middle, in half widths of the goal.
        mode_share: (N, M) probability that each path is due to each mode, by the mixture.
    """

    component: Ints
    controls: Floats
    paths: Floats
    log_weight: Floats
    excess: Floats
    mode_share: Floats

    @property
    def reached(self) -> Bools:
        """(N,) which paths end in the goal and stay in the state space."""
        return (self.excess <= 1) & (self.log_weight > -np.inf)


def draw(passage: Passage, proposal: Proposal, rng: np.random.Generator) -> Draws:
    """Draw paths from a proposal and weigh them; one that diverges has no weight, and no mode."""
    component = np.repeat(np.arange(len(proposal.count)), proposal.count)
    uniform = rng.random((passage.steps, len(component), proposal.policies.mean.shape[-1]))
    return weigh(passage, proposal, component, uniform)


def weigh(passage: Passage, proposal: Proposal, component: Ints, uniform: Floats) -> Draws:
    """Follow components (N,) of a proposal and weigh the paths; arguments as of `roll_out`."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _weighed(passage, proposal, component, uniform)


def _weighed(passage: Passage, proposal: Proposal, component: Ints, uniform: Floats) -> Draws:
    """See `weigh`."""
    paths, controls = roll_out(passage, proposal, component, uniform)
    log_densities = _log_densities(passage, proposal, paths[:, : -1 : passage.substeps], controls)
    shares = proposal.count / np.sum(proposal.count)
    log_parts = log_densities + np.log(shares)
    log_mixture = scipy.special.logsumexp(log_parts, axis=1)
    log_reward = passage.log_reward(paths[:, : -1 : passage.substeps], controls)
    log_weight = np.where(passage.stays(paths), log_reward - log_mixture, -np.inf)
    mode = proposal.policies.mode[proposal.policy]
    of_mode = (mode[:, None] == np.arange(np.max(mode) + 1)).astype(float)
    mode_share = np.exp(log_parts - log_mixture[:, None]) @ of_mode
    mode_share[~np.isfinite(log_mixture)] = 0.0
    excess = passage.excess(paths[:, -1])
    return Draws(component, controls, paths, log_weight, excess, mode_share)


def roll_out(
    passage: Passage, proposal: Proposal, component: Ints, uniform: Floats
) -> tuple[Floats, Floats]:
    """Paths (N, K+1, n) and controls (N, T, m) of some components (N,).

    Args:
        passage: the passage.
        proposal: the proposal.
        component: (N,) the component that each path follows.
        uniform: (T, N, m) numbers in [0, 1), which decide on each control, one hold after another.
    """
    policies, policy = proposal.policies, proposal.policy[component]
    width, count = proposal.width[component][:, None], len(component)
    m, substeps = policies.mean.shape[-1], passage.substeps
    path = np.empty((passage.steps * substeps + 1, len(passage.start), count))
    controls = np.empty((passage.steps, m, count))
    states = np.broadcast_to(passage.start[:, None], path.shape[1:]).T
    path[0] = states.T
    for k in range(passage.steps):
        apart = states - policies.states[policy, k]
        mean = policies.mean[policy, k] + np.einsum("bij,bj->bi", policies.gain[policy, k], apart)
        root = width[..., None] * policies.root[policy, k]
        control = _truncated(mean, root, passage.limits, uniform[k])
        controls[k] = control.T
        for part in range(substeps):
            states = rk4_step(passage.system, states, control, passage.dt / substeps)
            path[k * substeps + part + 1] = states.T
    return np.moveaxis(path, -1, 0), np.moveaxis(controls, -1, 0)


def _truncated(
    mean: Floats, root: Floats, limits: tuple[Floats, Floats], uniform: Floats
) -> Floats:
    """Controls (N, m) inside limits (m,), from uniform numbers (N, m): about means (N, m), with
    roots (N, m, m) of the covariance."""
    control, deviates = mean.copy(), np.zeros(mean.shape)
    for j in range(mean.shape[1]):
        middle = mean[:, j] + np.einsum("bi,bi->b", root[:, j, :j], deviates[:, :j])
        low, high = ((limit[j] - middle) / root[:, j, j] for limit in limits)
        deviates[:, j] = quantile(low, high, uniform[:, j])
        control[:, j] = np.clip(middle + root[:, j, j] * deviates[:, j], limits[0][j], limits[1][j])
    return control


def _log_densities(
    passage: Passage, proposal: Proposal, states: Floats, controls: Floats
) -> Floats:
    """(N, Q) log density of controls (N, T, m) from states (N, T, n) by each component."""
    policies, size = proposal.policies, controls[0].size
    limited = passage.limit is not None
    found = np.empty((len(controls), len(proposal.policy)))
    for p in range(len(policies)):
        root = policies.root[p]
        diagonal = np.diagonal(root, axis1=-2, axis2=-1)
        deviates = policies.deviates(p, states, controls)
        squares = np.sum(np.square(deviates), axis=(1, 2))
        constant = -np.sum(np.log(diagonal)) - size / 2 * np.log(2 * np.pi)
        for component in np.flatnonzero(proposal.policy == p):
            width = proposal.width[component]
            found[:, component] = constant - size * np.log(width) - squares / (2 * width**2)
            if limited:
                middle = controls - diagonal * deviates
                low, high = ((limit - middle) / (width * diagonal) for limit in passage.limits)
                found[:, component] -= np.sum(log_mass(low, high), axis=(1, 2))
    return found
