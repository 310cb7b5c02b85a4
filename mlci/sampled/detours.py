"""Ways round a truth: the passage whose modes they are, and first guesses on both sides of it.

Where a truth blocks the modes of a passage, few of its paths keep out. So modes are looked for with
a reward that falls inside the truth and near to it: r(x, u) - price max(0, margin - dist_K(x))^2.
Paths are only proposed by them. Their weights are by the reward itself and 0 inside the truth, so
that price and margin change how many effective samples there are, and not what they tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlci.differences import first_derivatives
from mlci.regions import Regions
from mlci.sampled.local_policies import LocalPolicies, riccati_policies
from mlci.sampled.modes import Modes, distinct, find_modes, improve
from mlci.sampled.passage import Passage
from mlci.sampled.proposals import Proposal, roll_out
from mlci.spaces import Bools, Floats, Ints
from mlci.wrapped import Wrapped

_DEPTHS = np.array([0.25, 0.7, 2.0])  # spreads of paths, so deep that staying inside costs a nat
_MARGIN = 1.0  # spreads of paths, by which modes keep away
_WIDTHS = np.array([1.0, 2.0, 4.0, 8.0])  # of a proposal's deviations, for guesses that bend
_PAIRS = 4  # of guesses at each width


@dataclass(frozen=True, eq=False)
class Softened(Wrapped):
    """A system whose running reward falls inside a truth, and within a margin of it.

    Attributes:
        system: the other one.
        truth: regions that know their distance.
        price: of the squared depth beyond the margin, by time.
        margin: in the unit of the distance.
    """

    truth: Regions
    price: float
    margin: float

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        own = self.system.running_reward(states, controls)
        return own - self.price * np.square(self._depth(states))

    def reward_derivatives(self, states: Floats, controls: Floats) -> tuple[Floats, Floats]:
        """See `System`; of the price's Hessian the part that is never positive (Gauss, Newton)."""
        gradient, hessian = map(np.copy, self.system.reward_derivatives(states, controls))
        n, depth = states.shape[-1], self._depth(states)[..., None]
        steep = np.zeros((*depth.shape[:-1], n))
        deep: Bools = np.any(depth > 0, axis=-1)
        if deep.any():
            by_state = first_derivatives(lambda x: self._depth(x)[..., None], states[deep])
            steep[deep] = by_state[..., 0, :]
        gradient[..., :n] -= 2 * self.price * depth * steep
        hessian[..., :n, :n] -= 2 * self.price * steep[..., :, None] * steep[..., None, :]
        return gradient, hessian

    def _depth(self, states: Floats) -> Floats:
        """(...,) how far states (..., n) are beyond the margin; 0 outside of it."""
        finite: Bools = np.all(np.isfinite(states), axis=-1)
        distance = self.truth.signed_distance(np.where(finite[..., None], states, 0.0))
        return np.where(finite, np.maximum(self.margin - distance, 0.0), 0.0)


@dataclass(frozen=True, eq=False)
class Detours:
    """A truth, and what proposes paths that keep out of it.

    Attributes:
        truth: its regions.
        policies: round each way of `find_detours`, so that paths near to the truth and far from it
            are all proposed.
    """

    truth: Regions
    policies: LocalPolicies

    def depth(self, paths: Floats) -> Floats:
        """(N,) how deep paths (N, K+1, n) enter the truth: 0 if not at all, inf if they diverge."""
        finite = np.isfinite(paths).all(axis=(1, 2))
        depth, known = np.full(len(paths), np.inf), paths[finite]
        entered = np.any(self.truth.violated_by(known), axis=1)
        depth[finite] = 0.0
        deepest = -np.min(self.truth.signed_distance(known[entered]), axis=1)
        depth[np.flatnonzero(finite)[entered]] = np.maximum(deepest, np.finfo(float).tiny)
        return depth


def softened(passage: Passage, truth: Regions, paths: Floats, weight: Floats) -> list[Passage]:
    """The passage with rewards that fall inside a truth, the most steeply falling one first.

    Their scales are those of the passage's own paths while these are inside: how far their
    distances from the border spread, and for how long they are.

    Args:
        passage: the passage.
        truth: regions that know their distance.
        paths: (B, K+1, n) paths of the passage, whether or not they enter the truth.
        weight: (B,) their weights, which add up to 1.
    """
    distance = truth.signed_distance(paths)
    inside = weight @ (distance < 0)
    time = max(passage.dt, float(np.sum(inside)) * passage.dt / passage.substeps)
    if not inside.any():  # as where only chords cross it
        inside[:] = 1.0
    variance = weight @ np.square(distance - weight @ distance)
    spread = float(np.sqrt(inside @ variance / np.sum(inside)))
    spread = max(spread, 1e-6 * float(np.max(np.abs(distance))))
    price = passage.temperature / (time * np.square(_DEPTHS * spread))
    systems = [Softened(passage.system, truth, each, _MARGIN * spread) for each in price.tolist()]
    return [replace(passage, system=system) for system in systems]


def find_detours(
    passage: Passage,
    straight: Modes,
    proposal: Proposal,
    soft: Sequence[Passage],
    restarts: int,
    rng: np.random.Generator,
) -> tuple[Modes, LocalPolicies]:
    """The locally optimal ways round a truth and those without it, and policies round them.

    Args:
        passage: the passage without the truth.
        straight: its modes.
        proposal: what draws its paths.
        soft: the same with rewards that fall inside the truth.
        restarts: first guesses for each winding, as of `find_modes`.
        rng: draws the guesses.
    """
    goals, guesses = _bent(passage, straight, proposal, rng)
    is_late = np.arange(len(goals)) % (2 * _PAIRS) >= _PAIRS
    bent = _improved(soft[0], goals, guesses, np.ones_like(is_late, dtype=np.int64), is_late)
    found = distinct(passage, find_modes(soft[0], restarts, rng).joined(bent))
    modes, (policies, _) = found, riccati_policies(soft[0], found)
    for softer in soft[1:]:
        ways = _improved(softer, found.goals, found.controls, found.restarts, found.late)
        modes, policies = modes.joined(ways), policies.joined(riccati_policies(softer, ways)[0])
    policies = policies.joined(riccati_policies(passage, straight)[0])
    modes = modes.joined(straight)
    return modes, replace(policies, mode=np.arange(len(modes)))


def _improved(
    passage: Passage, goals: Floats, guesses: Floats, restarts: Ints, late: Bools
) -> Modes:
    """What the optimiser makes of first guesses (B, T, m) to goals (B, n)."""
    starts = np.broadcast_to(passage.start, goals.shape)
    return Modes(*improve(passage, starts, goals, guesses), restarts, late)


def _bent(
    passage: Passage, straight: Modes, proposal: Proposal, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Goals (B, n) and controls (B, T, m) of guesses that bend away from straight ways.

    They come in pairs, one to either side: what is a deviation in one has the other sign in its
    partner.
    """
    share = proposal.count / np.sum(proposal.count)
    width = np.repeat(_WIDTHS, 2 * _PAIRS)
    component = np.repeat(rng.choice(len(share), size=len(width) // 2, p=share), 2)
    wide = Proposal(proposal.policies, proposal.policy[component], width, np.ones_like(component))
    size = passage.steps, len(width) // 2, proposal.policies.mean.shape[-1]
    uniform = np.empty((size[0], len(width), size[2]))
    uniform[:, ::2] = rng.uniform(1e-9, 1 - 1e-9, size)
    uniform[:, 1::2] = 1 - uniform[:, ::2]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        _, controls = roll_out(passage, wide, np.arange(len(width)), uniform)
    known = np.isfinite(controls).all(axis=(1, 2))
    mode = proposal.policies.mode[wide.policy]
    return straight.goals[mode][known], controls[known]
