"""Belief over sets of constraints: the prior, the posterior, and the posterior by enumeration.

How many regions are forbidden has a prior, and sets of one size are equally probable, but for
neighbours: of sets of one size, one with more pairs of neighbours is more probable, as in an Ising
model, since what is forbidden tends to hang together:

    P(B) ~ p_|B| / binomial(C, |B|) exp(J pairs(B)).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import comb, log
from typing import TYPE_CHECKING

import numpy as np
import scipy  # loads scipy.sparse and scipy.special when they are first used

from mlci.credible_sets import Area, joined_areas
from mlci.regions import Regions
from mlci.sets.chains import ChainCheck
from mlci.sets.evidence import SetEvidence
from mlci.spaces import Bools, Floats, Ints

if TYPE_CHECKING:
    import pandas as pd

# A recursion of each task gives all sets that have one region more than another, so that these are
# counted: all sets of 12 regions, or all pairs of 4000.
MOST_RECURSIONS = 1 << 12
_ROUNDING = 1e-12  # of a probability: sums may be this much short of a share


@dataclass(frozen=True, eq=False)
class SetPrior:
    """What is believed of sets of C regions before any demonstration.

    Attributes:
        sizes: (K+1,) probability that none, one, ... K regions are forbidden; larger sets are
            impossible. With `adjacency` it is that but for a factor, the mean of exp(J pairs) over
            the sets of a size, so that large sets are more probable than it says.
        adjacency: J [nat] for each pair of neighbours that are both forbidden.
        neighbours: (C, C) sparse symmetric mask of who are neighbours, as of
            `mlci.credible_sets.neighbours`; its diagonal does not count.

    Raises:
        ValueError: probabilities that do not add up to 1, or an adjacency without neighbours.
    """

    sizes: Sequence[float] = (0.5, 0.4, 0.1)
    adjacency: float = 0.0
    neighbours: scipy.sparse.csr_matrix | None = None

    def __post_init__(self) -> None:
        if not len(self.sizes) or min(self.sizes) < 0 or not np.isclose(sum(self.sizes), 1):
            raise ValueError(
                f"probabilities of none, one, two ... add up to 1, not {tuple(self.sizes)}"
            )
        if self.adjacency and self.neighbours is None:
            raise ValueError("an adjacency needs to be told who are neighbours")

    @classmethod
    def geometric(
        cls,
        none: float,
        further: float,
        largest: int,
        adjacency: float = 0.0,
        neighbours: scipy.sparse.csr_matrix | None = None,
    ) -> SetPrior:
        """None has a probability, and each further region after the first takes a factor."""
        shares = further ** np.arange(largest)
        sizes = (none, *((1 - none) * shares / np.sum(shares)).tolist())
        return cls(sizes, adjacency, neighbours)

    @classmethod
    def independent(
        cls,
        count: int,
        log_odds: float,
        adjacency: float = 0.0,
        neighbours: scipy.sparse.csr_matrix | None = None,
    ) -> SetPrior:
        """Each of some regions has these odds [nat] by itself: P(B) ~ e^(log_odds |B| + J pairs).

        Where C cells tile a plane, an adjacency J with log odds of -2 J makes a set as probable as
        the length of its border says, whatever it encloses.
        """
        size = np.arange(count + 1)
        number = scipy.special.gammaln(count + 1) - scipy.special.gammaln(size + 1)
        number -= scipy.special.gammaln(count - size + 1)
        weight = number + log_odds * size
        sizes = np.exp(weight - scipy.special.logsumexp(weight))
        return cls(tuple((sizes / np.sum(sizes)).tolist()), adjacency, neighbours)

    @property
    def largest(self) -> int:
        """K, the most regions of a set."""
        return len(self.sizes) - 1

    def log(self, members: Bools) -> float:
        """log P of a set, a mask (C,) [nat], but for a constant."""
        size, pairs = int(np.sum(members)), 0.0
        if self.neighbours is not None and self.adjacency:
            pairs = float(np.sum(self._degree(members)[members])) / 2
        return float(self._of_size(size, len(members)) + self.adjacency * pairs)

    def log_beside(self, members: Bools) -> Floats:
        """(C,) log P of a set together with each region [nat]; of a member, its own."""
        size, count = int(np.sum(members)), len(members)
        own = self.log(members)
        more = np.full(count, self._of_size(size + 1, count))
        if self.neighbours is not None and self.adjacency:
            more += own - self._of_size(size, count) + self.adjacency * self._degree(members)
        return np.where(members, own, more)

    def _degree(self, members: Bools) -> Floats:
        """(C,) how many neighbours of each region belong to a set, itself left out."""
        assert self.neighbours is not None
        return np.asarray(
            self.neighbours @ members.astype(float) - self.neighbours.diagonal() * members
        )

    def _of_size(self, size: int, count: int) -> float:
        """log P of a set of a size, neighbours left out."""
        if size > min(self.largest, count) or not self.sizes[size] > 0:
            return -np.inf
        return log(self.sizes[size]) - log(comb(count, size))  # of numbers of any length


@dataclass(frozen=True, eq=False)
class SetPosterior:
    """Probabilities of sets of C regions, by enumeration or from a sample.

    Attributes:
        members: (B, C) masks of the sets, the most probable first; others were not met, or have
            probability 0.
        probability: (B,) of each set; in a sample, its share.
        gain: (B,) log likelihood gain [nat]; -inf for a set that a violation excludes.
        weight: (B,) log of prior times likelihood, but for a constant [nat]: it orders sets, also
            of a sample, without its error.
        check: how far a sample can be trusted; None where probabilities are exact.
    """

    members: Bools
    probability: Floats
    gain: Floats
    weight: Floats
    check: ChainCheck | None = None

    @property
    def none(self) -> float:
        """Probability that there is no constraint."""
        return float(np.sum(self.probability[~np.any(self.members, axis=1)]))

    @property
    def marginal(self) -> Floats:
        """(C,) probability that a region is forbidden, alone or with others."""
        return self.probability @ self.members

    @property
    def sizes(self) -> Floats:
        """(C+1,) probability that so many regions are forbidden."""
        count = np.sum(self.members, axis=1)
        return np.asarray(np.bincount(count, self.probability, self.members.shape[1] + 1), float)

    def most_probable(self) -> tuple[int, ...]:
        """The numbers of the regions of the most probable set."""
        return tuple(np.flatnonzero(self.members[np.argmax(self.weight)]).tolist())

    def probability_of(self, members: Sequence[int]) -> float:
        """The probability of the set of some regions, by their numbers."""
        mask = np.isin(np.arange(self.members.shape[1]), members)
        return float(np.sum(self.probability[np.all(self.members == mask, axis=1)]))

    def credible_regions(self, share: float = 0.95) -> Ints:
        """Regions outside of which nothing is forbidden, with a probability of at least `share`.

        They are taken by their marginals, the largest first, and are as few as that order allows.
        """
        order = np.argsort(-self.marginal, kind="stable")
        place = np.empty(len(order), dtype=np.int64)
        place[order] = np.arange(len(order))
        # How many regions have to be taken until all of a set are.
        needed = np.max(np.where(self.members, place + 1, 0), axis=1, initial=0)
        held = np.cumsum(np.bincount(needed, self.probability, minlength=len(order) + 1))
        return order[: int(np.searchsorted(held, share - _ROUNDING))]

    def areas(self, hypotheses: Regions, share: float = 0.5) -> tuple[Area, ...]:
        """Regions whose marginal is at least a share of the largest, joined with their neighbours.

        The first is the most probable area: it holds the most probable region. The probability of
        an area is that some region of it is forbidden.

        Args:
            hypotheses: the C regions.
            share: of the largest marginal.
        """
        marginal = self.marginal
        if not np.any(marginal > 0):
            return ()
        best = int(np.argmax(marginal))
        numbers = np.flatnonzero(marginal >= share * marginal[best])
        areas = joined_areas(hypotheses, numbers, self._meets)
        return tuple(sorted(areas, key=lambda area: (best not in area.regions, -area.probability)))

    def _meets(self, regions: Ints) -> float:
        """Probability that one of some regions is forbidden."""
        return float(np.sum(self.probability[np.any(self.members[:, regions], axis=1)]))

    def to_frame(self, names: Sequence[str]) -> pd.DataFrame:
        """A row a set, the most probable first: `set`, the names of its regions, empty for none;
        `size`; `gain` [nat]; `probability`."""
        import pandas as pd

        labels = np.array(names, dtype=object)
        return pd.DataFrame(
            {
                "set": [", ".join(labels[mask]) for mask in self.members],
                "size": np.sum(self.members, axis=1),
                "gain": self.gain,
                "probability": self.probability,
            }
        )


def enumerate_sets(evidence: SetEvidence, prior: SetPrior) -> SetPosterior:
    """Exact posterior over all sets that the prior allows, by one recursion for each of them.

    Raises:
        ValueError: that takes more than `MOST_RECURSIONS` of each task.
    """
    feasible = np.flatnonzero(evidence.feasible)
    if not can_enumerate(evidence, prior):
        raise ValueError(
            f"sets of up to {prior.largest} of {len(feasible)} regions are too many to enumerate "
            f"with {MOST_RECURSIONS} recursions a task: sample them, or allow smaller ones alone"
        )
    nothing = np.zeros(evidence.regions, dtype=bool)
    sets, gains = [nothing], [0.0]
    for members, of_set in _larger(evidence, feasible, nothing, 0, prior.largest):
        sets.append(members)
        gains.append(of_set)
    gain: Floats = np.array(gains)
    log_prior = np.array([prior.log(members) for members in sets])
    likelihood = gain
    if np.any(certain := (gain == np.inf) & (log_prior > -np.inf)):
        likelihood = np.where(certain, 0.0, -np.inf)  # they take all the probability
    weight = log_prior + likelihood
    probability = np.exp(weight - scipy.special.logsumexp(weight))
    order = np.argsort(-probability, kind="stable")
    return SetPosterior(np.array(sets)[order], probability[order], gain[order], weight[order])


def can_enumerate(evidence: SetEvidence, prior: SetPrior) -> bool:
    """Whether all sets that are possible are few enough for `enumerate_sets`."""
    feasible = int(np.sum(evidence.feasible))
    smaller = range(min(prior.largest, feasible))  # sizes to which one region is added
    return sum(comb(feasible, size) for size in smaller) <= MOST_RECURSIONS


def _larger(
    evidence: SetEvidence, feasible: Ints, members: Bools, first: int, more: int
) -> Iterator[tuple[Bools, float]]:
    """Sets of a set and up to so many more feasible regions, from the first one on, with gains."""
    if more == 0 or first == len(feasible):
        return
    gain = evidence.beside(members)
    for place in range(first, len(feasible)):
        larger = members.copy()
        larger[feasible[place]] = True
        yield larger, float(gain[feasible[place]])
        yield from _larger(evidence, feasible, larger, place + 1, more - 1)
