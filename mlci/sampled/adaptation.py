"""A proposal that suits a passage: policies round its modes, refitted to weighted paths.

Round the modes policies are exact where the system is linear. Elsewhere a few rounds of
cross-entropy (Rubinstein 1999; with mixtures, Cappe, Douc, Guillin, Marin and Robert 2008) fit them
to the paths of a pilot, in the directions where the density is not Gaussian. Where a pilot misses
the goal, the refit takes a wider goal; where few paths carry the weight, flatter weights; and where
a pilot enters a truth, the paths that enter it least.
"""

from __future__ import annotations

import numpy as np
import scipy  # loads scipy.special when it is first used

from mlci.sampled.detours import Detours
from mlci.sampled.local_policies import LocalPolicies, refit, riccati_policies
from mlci.sampled.modes import Modes
from mlci.sampled.passage import Passage
from mlci.sampled.proposals import Draws, Proposal, draw
from mlci.sampled.weights import effective_count
from mlci.spaces import Bools, Floats

_KEPT = 0.2  # of the samples comes from the policies that are fitted to no sample
_FLATTER = 0.8  # power of the modes' probabilities that shares of samples follow
_EVEN = 0.1  # of the samples is for all modes alike
_FEWEST, _MOST = 2, 6  # rounds
_ENOUGH = 0.25  # effective share of the samples, from which a round more is not worth its time
NEEDED = 20  # effective samples for each coefficient of a refit
_IN_GOAL = 0.05  # of a pilot is in the goal, or a wider one takes its place
_KEEP_OUT = 0.1  # of a pilot keeps out of a truth, or the paths that enter it least do in its place


def adapted_proposal(
    passage: Passage,
    modes: Modes,
    samples: int,
    pilot: int,
    rng: np.random.Generator,
    detours: Detours | None = None,
) -> tuple[Proposal, int]:
    """A proposal of some samples, fitted on pilots, and how many rounds of these there were.

    Args:
        passage: the passage.
        modes: at least one.
        samples: of the proposal.
        pilot: samples of each round.
        rng: draws the pilots.
        detours: a truth that paths keep out of; the modes are its.
    """
    needed = NEEDED * (1 + len(passage.start))
    if detours:
        first, shares = detours.policies, np.full(len(modes), 1 / len(modes))
    else:
        first, log_integral = riccati_policies(passage, modes)
        shares = scipy.special.softmax(log_integral)
    latest = first
    for number in range(1, _MOST + 1):
        proposal = _mixture(first, latest, shares, pilot)
        draws = draw(passage, proposal, rng)
        depth = detours.depth(draws.paths) if detours else np.zeros(len(draws.paths))
        log_weight = np.where(draws.reached & (depth == 0), draws.log_weight, -np.inf)
        weight = flattened(draws, needed, depth <= np.quantile(depth, _KEEP_OUT))
        latest = refit(
            latest,
            draws.paths[:, : -1 : passage.substeps],
            draws.controls,
            draws.mode_share * weight[:, None],
            passage.limits,
        )
        shares = weight @ draws.mode_share
        if number >= _FEWEST and effective_count(log_weight) >= _ENOUGH * len(log_weight):
            break
    return _mixture(first, latest, shares, samples), number


def _mixture(first: LocalPolicies, latest: LocalPolicies, shares: Floats, samples: int) -> Proposal:
    """The policies fitted to no sample and the latest, by the modes' probabilities (M,)."""
    of_modes = spread(shares)
    if latest is first:
        return Proposal.of(first, of_modes, samples)
    both = np.concatenate([_KEPT * of_modes, (1 - _KEPT) * of_modes])
    return Proposal.of(first.joined(latest), both, samples)


def spread(shares: Floats) -> Floats:
    """Shares (M,) of samples of modes, by their probabilities (M,) of any sum: less unequal."""
    even = np.full(len(shares), 1 / len(shares))
    if not np.sum(shares) > 0:
        return even  # all paths of the pilot left the state space
    flatter = shares**_FLATTER
    return np.asarray((1 - _EVEN) * flatter / np.sum(flatter) + _EVEN * even)


def flattened(draws: Draws, needed: int, allowed: Bools) -> Floats:
    """Weights (N,) for a refit, which add up to 1: of the goal or a wider one, as near to the true
    ones as leaves an effective number of samples; 0 for paths (N,) that are not allowed."""
    stays = allowed & (draws.log_weight > -np.inf)
    if not stays.any():
        return np.full(len(stays), 1 / len(stays))
    reach = max(1.0, float(np.quantile(draws.excess[stays], _IN_GOAL)))
    log_weight = np.where(stays & (draws.excess <= reach), draws.log_weight, -np.inf)
    needed = min(needed, int(np.sum(log_weight > -np.inf)) // 2)
    power = 1.0
    while effective_count(_power(log_weight, power)) < needed and power > 1e-3:
        power *= 0.8
    return np.asarray(scipy.special.softmax(_power(log_weight, power)))


def _power(log_weight: Floats, power: float) -> Floats:
    """Weights to a power, those of 0 left out."""
    return np.where(log_weight > -np.inf, power * log_weight, -np.inf)
