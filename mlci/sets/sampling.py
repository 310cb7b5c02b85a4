"""A sample of sets of constraints from their posterior, by Markov chains over inclusion.

With w(B) = P(B) e^gain(B), a chain at B moves in one of three ways, equally often:

* add: i outside of B with probability w(B+i) / W(B), where W(B) = sum_i w(B+i), which is accepted
  with probability min(1, W(B) / ((|B| + 1) w(B)));
* remove: a member i at random, accepted with min(1, |B| w(B-i) / W(B-i)), the reverse;
* swap: a member i at random goes, and one of all others, i included, comes in its place with
  probability w(B-i+k) / W(B-i), which is always accepted.

Each keeps detailed balance. All that a move needs is w of one set together with each region: one
recursion a task (`mlci.sets.evidence`), and most sets are met again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mlci.sets.chains import ChainCheck
from mlci.sets.evidence import SetGains
from mlci.sets.posterior import SetPosterior, SetPrior
from mlci.spaces import Bools, Floats


def sample_sets(
    evidence: SetGains,
    prior: SetPrior,
    rng: np.random.Generator,
    *,
    chains: int = 4,
    steps: int = 1000,
) -> SetPosterior:
    """Posterior over sets from chains that start apart; `check` says whether they agree.

    Args:
        evidence: of the demonstrations.
        prior: of sets.
        rng: of which each chain has a stream of its own.
        chains: M, at least two for the check to mean something.
        steps: T moves of each chain that count, after half as many that do not.

    Raises:
        ValueError: less than four steps or no chain, or a set whose gain is infinite.
    """
    if chains < 1 or steps < 4:
        raise ValueError(f"a sample needs a chain and four steps, not {chains} and {steps}")
    weights = _Weights(evidence, prior)
    warm_up = steps // 2
    draws = np.empty((chains, steps, evidence.regions), dtype=bool)
    accepted = 0
    for own, of_chain in zip(draws, rng.spawn(chains), strict=True):
        members = _start(weights, of_chain)
        for step in range(-warm_up, steps):
            members, moved = _moved(weights, members, of_chain)
            if step >= 0:
                own[step] = members
                accepted += moved
    flat = draws.reshape(-1, evidence.regions)
    members, counts = np.unique(flat, axis=0, return_counts=True)
    met = [weights.beside(each) for each in members]
    gain, weight = np.array([(each.gain, each.weight) for each in met]).T
    # Of equal shares the better set comes first.
    order = np.lexsort((-weight, -counts))
    sizes = np.sum(draws, axis=2, keepdims=True)
    check = ChainCheck.of(
        np.concatenate([draws, sizes], axis=2).astype(float), accepted / (chains * steps)
    )
    return SetPosterior(
        members[order], counts[order] / len(flat), gain[order], weight[order], check
    )


@dataclass(frozen=True, eq=False)
class _Beside:
    """A set together with each region i.

    Attributes:
        gain: gain of B alone [nat].
        weight: log w(B).
        total: log W(B), over the regions outside of B.
        cumulative: (C,) shares of W(B), summed; empty where W(B) is 0.
    """

    gain: float
    weight: float
    total: float
    cumulative: Floats

    def draw(self, rng: np.random.Generator) -> int:
        """A region outside of the set, with probability w(B+i) / W(B)."""
        place = rng.random() * self.cumulative[-1]
        return int(np.searchsorted(self.cumulative, place, side="right"))


@dataclass(frozen=True, eq=False)
class _Weights:
    """log w of sets, remembered."""

    evidence: SetGains
    prior: SetPrior
    known: dict[bytes, _Beside] = field(default_factory=dict)

    def beside(self, members: Bools) -> _Beside:
        """What there is to know of a set together with each region."""
        key = members.tobytes()
        if key not in self.known:
            gain = self.evidence.beside(members)
            if np.any(gain == np.inf):
                raise ValueError(
                    "a set that some demonstration avoids cannot be avoided by the tabular agent, "
                    "and is certain therefore: sample with a model error above 0"
                )
            # Of a member, gain and prior are those of the set itself.
            own = float(gain[members][0]) if members.any() else 0.0
            weight = own + self.prior.log(members)
            larger = np.where(members, -np.inf, gain + self.prior.log_beside(members))
            best = float(np.max(larger))
            if best == -np.inf:
                self.known[key] = _Beside(own, weight, best, np.empty(0))
            else:
                cumulative = np.cumsum(np.exp(larger - best))
                total = best + float(np.log(cumulative[-1]))
                self.known[key] = _Beside(own, weight, total, cumulative)
        return self.known[key]


def _start(weights: _Weights, rng: np.random.Generator) -> Bools:
    """A set of a size by the prior, of feasible regions at random; none if it is impossible."""
    sizes, feasible = weights.prior.sizes, np.flatnonzero(weights.evidence.feasible)
    size = min(int(rng.choice(len(sizes), p=sizes)), len(feasible))
    members = np.zeros(weights.evidence.regions, dtype=bool)
    members[rng.choice(feasible, size, replace=False)] = True
    if weights.beside(members).weight > -np.inf:
        return members
    return np.zeros(weights.evidence.regions, dtype=bool)


def _moved(weights: _Weights, members: Bools, rng: np.random.Generator) -> tuple[Bools, bool]:
    """A set after one move, and whether that changed it."""
    kind, log_chance = rng.integers(3), np.log(1 - rng.random())  # of a number in (0, 1]
    if kind == 0:  # add
        beside = weights.beside(members)
        ratio = beside.total - np.log(np.sum(members) + 1) - beside.weight
        if beside.total == -np.inf or log_chance >= ratio:
            return members, False
        return _changed(members, beside.draw(rng)), True
    inside = np.flatnonzero(members)
    if not len(inside):
        return members, False
    region = int(inside[rng.integers(len(inside))])
    rest = _changed(members, region)
    beside = weights.beside(rest)
    if kind == 1:  # remove
        ratio = np.log(len(inside)) + beside.weight - beside.total
        return (rest, True) if log_chance < ratio else (members, False)
    other = beside.draw(rng)
    return (members, False) if other == region else (_changed(rest, other), True)


def _changed(members: Bools, region: int) -> Bools:
    """A set with a region added, or removed if it is a member."""
    changed = members.copy()
    changed[region] ^= True
    return changed
