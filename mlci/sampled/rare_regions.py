"""Regions that paths hardly ever cross: proposals that are led into them.

Cross-entropy by levels (Rubinstein 1999). Of paths that are drawn, those that come nearest to the
region are kept, by their weights, and the policies are refitted to them; so the next ones come
nearer, round by round, until enough of them cross. The last are drawn from these policies and from
the task's own proposal, and weighted by the density of that whole mixture: so the integral of the
paths that cross is exact but for its standard error, and over Z it is Phi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mlci.regions import Regions
from mlci.sampled import weights
from mlci.sampled.adaptation import NEEDED, flattened, spread
from mlci.sampled.distribution import SampledDistribution
from mlci.sampled.local_policies import refit
from mlci.sampled.proposals import Proposal, draw
from mlci.spaces import Bools, Floats, Ints

_PILOT = 1000  # paths of a round
_ROUNDS, _ACROSS = 20, 4  # at most, and in so many of them enough paths cross
_NEAREST = 0.15  # of a pilot's paths to the goal, to which policies are refitted
_OWN = 0.2  # of the last paths comes from the task's own proposal, so that weights are bounded
_EFFECTIVE, _PARETO = 50.0, 0.7  # what a probability needs to be believed
_LIMIT = 1.645  # standard errors of an upper 95 % limit
_GUIDED = 7  # of the generators of a task, beside those of its distribution


@dataclass(frozen=True, eq=False)
class RareViolations:
    """Phi of R rare regions; made by `rare_violations`.

    Attributes:
        regions: (R,) their numbers.
        phi: (R,) Phi.
        error: (R,) its standard error.
        effective: (R,) effective samples of the paths that cross.
        pareto_k: (R,) shape of the tail of their weights.
        upper: (R,) upper 95 % limit; where Phi is not resolved, at least that of the task's own
            samples: what none of E effective ones shows is below 3 / E.
    """

    regions: Ints
    phi: Floats
    error: Floats
    effective: Floats
    pareto_k: Floats
    upper: Floats

    @property
    def resolved(self) -> Bools:
        """(R,) whether Phi is to be believed; of others the limit is."""
        return _resolved(self.effective, self.pareto_k)


def rare_violations(
    distribution: SampledDistribution, regions: Sequence[int], *, samples: int = 4000
) -> RareViolations:
    """Phi of regions that paths hardly ever cross, below a thousandth or so.

    Of others the distribution's own samples tell more. Each region takes as long as a task.

    Args:
        distribution: the distribution of a task, under a truth or none.
        regions: numbers of R of its regions.
        samples: paths that are drawn for each at last.

    Raises:
        ValueError: a number that no region has, too few samples, no path that reaches the goal, or
            a region that knows no distance.
    """
    numbers = np.asarray(regions, dtype=np.int64)
    count = len(distribution.regions)
    if not np.all((numbers >= 0) & (numbers < count)):
        raise ValueError(f"regions are numbered 0 to {count - 1}, not {numbers.tolist()}")
    if samples < 100:
        raise ValueError(f"a rare region needs at least 100 samples, not {samples}")
    if not distribution.is_possible:
        raise ValueError("no sampled path reaches the goal: probabilities are not defined")
    for number in numbers.tolist():
        if not distribution.regions.shape(number).has_distance:
            raise ValueError(
                f"region {distribution.regions.names[number]} knows what is inside, but not how "
                "far away it is, by which paths are led there: give its `steepness`"
            )
    found = [_of_region(distribution, number, samples) for number in numbers.tolist()]
    phi, error, effective, pareto_k = np.reshape(found, (len(numbers), 4)).T
    own = min(1.0, 3 / distribution.diagnosis.effective)
    phi, upper = np.minimum([phi, phi + _LIMIT * error], 1.0)  # sums of weights may be more
    upper = np.where(_resolved(effective, pareto_k), upper, np.maximum(upper, own))
    return RareViolations(numbers, phi, error, effective, pareto_k, upper)


def _resolved(effective: Floats, pareto_k: Floats) -> Bools:
    """Which probabilities are to be believed."""
    return (effective >= _EFFECTIVE) & (pareto_k <= _PARETO)


def _of_region(
    distribution: SampledDistribution, number: int, samples: int
) -> tuple[float, float, float, float]:
    """Phi of a region, its error, effective samples and the shape of the weights' tail."""
    passage = distribution.passage
    region = distribution.regions.select(np.arange(len(distribution.regions)) == number)
    rng = np.random.default_rng([*distribution.key, _GUIDED, number])
    proposal = _led(distribution, region, samples, rng)
    draws = draw(passage, proposal, rng)
    counts = draws.reached & (_nearness(distribution, region, draws.paths) == np.inf)
    log_weight = np.where(counts, draws.log_weight, -np.inf)
    share = np.exp(log_weight - np.log(len(counts)) - distribution.log_z)
    phi = float(np.sum(share))
    own = float(weights.sum_error(weights.deviations(share, draws.component)))
    error = float(np.hypot(own, phi * distribution.log_z_error))
    return phi, error, weights.effective_count(log_weight), weights.pareto_shape(log_weight)


def _led(
    distribution: SampledDistribution, region: Regions, samples: int, rng: np.random.Generator
) -> Proposal:
    """The proposal of the last paths of a region."""
    own, passage = distribution.proposal, distribution.passage
    assert own is not None  # as the task is possible
    needed = NEEDED * (1 + len(passage.start))
    latest, proposal = own.policies.of(slice(-len(distribution.modes), None)), own.resized(_PILOT)
    across: int = 0  # rounds in which enough paths cross
    for _ in range(_ROUNDS):
        draws = draw(passage, proposal, rng)
        near = _nearness(distribution, region, draws.paths)
        nearest = _nearest(near, draws.reached)
        weight = flattened(draws, needed, nearest)
        states = draws.paths[:, : -1 : passage.substeps]
        density = draws.mode_share * weight[:, None]
        latest = refit(latest, states, draws.controls, density, passage.limits)
        shares = spread(np.sum(density, axis=0))
        proposal = Proposal.of(latest, shares, _PILOT)
        across += int(np.all(near[nearest] == np.inf))
        if across == _ACROSS:
            break
    return own.resized(round(_OWN * samples)).joined(Proposal.of(latest, shares, samples))


def _nearest(near: Floats, reached: Bools) -> Bools:
    """(N,) which paths are kept: a share of those that reach the goal, by how near (N,) they come.

    Where more are as near as each other, such as those that are nearest at their start, only those
    that come nearer still are kept, if there are any.
    """
    if not reached.any():
        return np.ones(len(near), dtype=bool)
    level = np.quantile(near[reached], 1 - _NEAREST, method="lower")
    kept, nearer = near >= level, near > level
    is_tied = np.sum(kept & reached) > 2 * _NEAREST * np.sum(reached)
    return nearer if is_tied and np.any(nearer & reached) else kept


def _nearness(distribution: SampledDistribution, region: Regions, paths: Floats) -> Floats:
    """(N,) how near paths (N, K+1, n) come to a region: minus the least level; inf where they cross
    it, -inf where they enter the truth or diverge."""
    finite = np.isfinite(paths).all(axis=(1, 2)) & ~_entered(distribution, paths)
    near = np.full(len(paths), -np.inf)
    near[finite] = -np.min(region.signed_distance(paths[finite]), axis=1)
    near[finite] = np.where(region.violated_by(paths[finite])[:, 0], np.inf, near[finite])
    return near


def _entered(distribution: SampledDistribution, paths: Floats) -> Bools:
    """(N,) which paths (N, K+1, n) enter the truth."""
    if not distribution.truth.any():
        return np.zeros(len(paths), dtype=bool)
    truth = distribution.regions.select(distribution.truth)
    return np.any(truth.violated_by(paths), axis=1)
