"""The maximum entropy distribution of a task without cells, by importance sampling.

`Passage` states the distribution. Its modes are found by the demonstrator's optimiser (`modes`),
Gaussian policies round them (`local_policies`) propose whole paths, and each path has the weight
that corrects for its proposal (`proposals`). The probability of avoiding a region, of any shape and
number, is the weighted share of the paths that do, with a standard error.

No cells: trajectories begin at the start and end in the goal region, a point's with a tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy  # loads scipy.special when it is first used
from numpy.typing import ArrayLike

from mlci.regions import Regions, as_mask
from mlci.sampled import weights
from mlci.sampled.adaptation import adapted_proposal
from mlci.sampled.detours import Detours, find_detours, softened
from mlci.sampled.diagnosis import SamplingDiagnosis
from mlci.sampled.modes import Modes
from mlci.sampled.passage import Passage
from mlci.sampled.proposals import Proposal, draw
from mlci.spaces import Bools, Floats, Ints

SEARCH, _DRAWS, _REPLICATES, _ROUND = range(4)  # a generator each, so that none depends on another
_PILOT = 1000  # samples of a pilot at least, if there are so many of the task
_BLOCKED = 0.5  # of the probability keeps out of a truth, below which paths are drawn anew
_PAIRS_AT_ONCE = 4_000_000  # of paths and regions


@dataclass(frozen=True, eq=False)
class SampledDistribution:
    """Weighted paths of a task; made by `mlci.SampledModel.distribution`.

    Attributes:
        passage: what they are paths of.
        regions: the C regions.
        modes: the modes that were found.
        proposal: what the paths were drawn from; None without a mode.
        paths: (B, K+1, n) states of the paths that count, not wrapped.
        weight: (B,) weight of each; they add up to 1 if there is any.
        reached: (N,) which of all the paths that were drawn are these: the others have no weight.
        strata: (N,) component of the proposal that each of all comes from.
        log_z: log of the integral Z [nat]; -inf where no path reaches the goal.
        log_z_error: its standard error.
        diagnosis: whether to believe it.
        key: what its generators are seeded with.
        truth: (C,) regions that paths keep out of.
    """

    passage: Passage
    regions: Regions
    modes: Modes
    proposal: Proposal | None
    paths: Floats
    weight: Floats
    reached: Bools
    strata: Ints
    log_z: float
    log_z_error: float
    diagnosis: SamplingDiagnosis
    key: tuple[int, ...]
    truth: Bools

    @property
    def is_possible(self) -> bool:
        """Whether any path reaches the goal: else there is no distribution."""
        return len(self.weight) > 0

    @cached_property
    def avoided(self) -> Bools:
        """(B, C) which regions each path avoids."""
        blocks = max(1, self.weight.size * len(self.regions) // _PAIRS_AT_ONCE)
        parts = np.array_split(self.paths, blocks)
        return ~np.concatenate([self.regions.violated_by(part) for part in parts])

    def avoidance_probabilities(self) -> Floats:
        """alpha_i (C,): the probability that a path does not cross region i.

        Raises:
            ValueError: no path reaches the goal.
        """
        self._require_possible()
        alpha = np.clip(self.weight @ self.avoided, 0.0, 1.0)
        return np.where(np.all(self.avoided, axis=0), 1.0, alpha)  # else rounding moves it

    def violation_probabilities(self) -> Floats:
        """Phi_i = 1 - alpha_i (C,)."""
        return 1.0 - self.avoidance_probabilities()

    def influences(self) -> Floats:
        """(N, C) how much each path moves alpha: the variance of alpha is the sum of squares.

        Raises:
            ValueError: no path reaches the goal.
        """
        alpha = self.avoidance_probabilities()
        moved = np.zeros((len(self.strata), len(alpha)))
        moved[self.reached] = self.weight[:, None] * (self.avoided - alpha)
        return weights.deviations(moved, self.strata)

    def avoidance_errors(self) -> Floats:
        """(C,) standard errors of alpha.

        No less than one effective sample's share: what no sample shows may be so rare.
        """
        return np.hypot(weights.sum_error(self.influences()), 1 / self.diagnosis.effective)

    def avoidance_replicates(self, count: int) -> Floats:
        """(count, C) alpha as other samples of the same number might give it; the same each time.

        Regions that a path avoids together err together, if they are neither all nor none.
        """
        rng = np.random.default_rng([*self.key, _REPLICATES])
        alpha, errors = self.avoidance_probabilities(), self.avoidance_errors()
        return weights.replicates(alpha, errors, self.influences(), self.least, count, rng)

    @property
    def least(self) -> float:
        """What stands for the probability of what no sample shows: half an effective sample."""
        return 0.5 / self.diagnosis.effective

    def sample(self, count: int, rng: np.random.Generator) -> Floats:
        """Paths (count, K+1, n), drawn anew from the weighted ones.

        Raises:
            ValueError: no path reaches the goal.
        """
        return np.asarray(self.paths[self._draw(count, rng)])

    def crossings(self, count: int, rng: np.random.Generator) -> Bools:
        """(count, C) which regions paths cross, drawn anew from the weighted ones.

        Raises:
            ValueError: no path reaches the goal.
        """
        return ~self.avoided[self._draw(count, rng)]

    def log_avoidance_beside(self, members: Bools) -> Floats:
        """(C,) log probability of avoiding a set, a mask (C,) of regions, together with each.

        Raises:
            ValueError: no path reaches the goal.
        """
        self._require_possible()
        free = np.all(self.avoided[:, members], axis=1)
        with np.errstate(divide="ignore"):
            return np.log(np.clip((self.weight * free) @ self.avoided, 0.0, 1.0))

    def under(self, truth: ArrayLike) -> SampledDistribution:
        """The distribution under constraints, equation (3): paths that cross the truth weigh 0.

        Its diagnosis tells how few paths are left. Nothing is drawn anew: `SampledModel.under` is
        for a truth that is in the way.

        Args:
            truth: (C,) mask over the regions.
        """
        mask = as_mask(truth, len(self.regions))
        kept = np.all(self.avoided[:, mask], axis=1)
        alpha = float(np.sum(self.weight[kept]))
        weight = self.weight[kept] / alpha if alpha > 0 else np.zeros(int(np.sum(kept)))
        square = float(weight @ weight)
        reached = np.zeros_like(self.reached)
        reached[np.flatnonzero(self.reached)[kept]] = True
        moved = np.zeros(len(reached))
        moved[reached] = weight
        error = float(weights.sum_error(weights.deviations(moved, self.strata)))
        constrained = replace(
            self,
            paths=self.paths[kept],
            weight=weight,
            reached=reached,
            log_z=self.log_z + (float(np.log(alpha)) if alpha > 0 else -np.inf),
            log_z_error=error if alpha > 0 else np.inf,
            diagnosis=replace(self.diagnosis, effective=1 / square if square > 0 else 0.0),
            truth=self.truth | mask,
        )
        vars(constrained)["avoided"] = self.avoided[kept]
        return constrained

    def _draw(self, count: int, rng: np.random.Generator) -> Ints:
        """(count,) numbers of paths, by their weights."""
        self._require_possible()
        return rng.choice(len(self.weight), size=count, p=self.weight)

    def _require_possible(self) -> None:
        """Raise where there is no distribution."""
        if not self.is_possible:
            raise ValueError(f"no sampled path reaches the goal: {self.diagnosis.complaints[0]}")


def sample_passage(
    passage: Passage,
    regions: Regions,
    modes: Modes,
    samples: int,
    key: tuple[int, ...],
    detours: Detours | None = None,
) -> SampledDistribution:
    """Weighted paths of a passage, from policies round its modes; the key seeds the draws.

    With detours only those that keep out of their truth have weight, equation (3).
    """
    rng = np.random.default_rng([*key, _DRAWS])
    truth = np.zeros(len(regions), dtype=bool)
    if not len(modes):
        nothing, paths = np.zeros(0), np.zeros((0, 2, len(passage.start)))
        none = nothing, nothing.astype(bool), nothing.astype(np.int64)
        diagnosis = SamplingDiagnosis(0, 0.0, 0.0, np.inf, nothing, 0.0, 0)
        of_nothing = paths, *none, -np.inf, np.inf, diagnosis, key, truth
        return SampledDistribution(passage, regions, modes, None, *of_nothing)
    pilot = max(min(samples, _PILOT), samples // 3)
    proposal, rounds = adapted_proposal(passage, modes, samples, pilot, rng, detours)
    draws = draw(passage, proposal, rng)
    reached = draws.reached
    if detours:
        reached = reached & (detours.depth(draws.paths) == 0)
    log_weight, count = np.where(reached, draws.log_weight, -np.inf), len(reached)
    log_total = float(scipy.special.logsumexp(log_weight))
    weight = np.exp(log_weight - log_total) if reached.any() else np.zeros(count)
    probability = weight @ draws.mode_share
    diagnosis = SamplingDiagnosis(
        samples=count,
        reached=float(np.mean(reached)),
        effective=weights.effective_count(log_weight),
        pareto_k=weights.pareto_shape(log_weight),
        mode_probability=probability,
        late=float(probability @ modes.late),
        rounds=rounds,
    )
    error = float(weights.sum_error(weights.deviations(weight, draws.component)))
    return SampledDistribution(
        *(passage, regions, modes, proposal, draws.paths[reached], weight[reached], reached),
        *(draws.component, log_total - np.log(count), error, diagnosis, key, truth),
    )


def under_truth(
    free: SampledDistribution, truth: Bools, samples: int, restarts: int
) -> SampledDistribution:
    """The distribution under a truth (C,), equation (3), drawn anew where the truth is in the way.

    Where it is not, the paths that keep out are enough: their density is at most 1 / alpha times
    the one that they are drawn by.

    Args:
        free: the distribution without the truth.
        truth: (C,) mask; where one of its regions knows no distance nothing is drawn anew.
        samples: paths that are drawn.
        restarts: first guesses of the optimiser for each winding.
    """
    under = free.under(truth)
    if free.proposal is None or not free.is_possible:
        return under
    if not all(free.regions.shape(i).has_distance for i in np.flatnonzero(truth).tolist()):
        return under
    regions = free.regions.select(truth)
    is_blocked = under.log_z - free.log_z < np.log(_BLOCKED)
    if not is_blocked or regions.signed_distance(free.passage.start) < 0:
        return under
    key = (*free.key, _ROUND)
    rng = np.random.default_rng([*key, SEARCH])
    soft = softened(free.passage, regions, free.paths, free.weight)
    modes, policies = find_detours(free.passage, free.modes, free.proposal, soft, restarts, rng)
    detours = Detours(regions, policies)
    anew = sample_passage(free.passage, free.regions, modes, samples, key, detours)
    return replace(anew, truth=truth)
