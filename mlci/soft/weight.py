"""Soft or hard? The weight of a soft constraint, by maximum likelihood, with its interval.

The likelihood is that of `mlci.soft.distribution`, which has both ends: weight 0 is no constraint,
an infinite weight is a wall. It is a function of u = w s / (1 + w s) in [0, 1], where s is the
model's time step, so that both are searched, and the interval (`mlci.likelihood_interval`) may end
in either. An interval that ends at 0 leaves open whether there is a constraint; one that ends at
infinity, whether it is a wall.

log A_j is taken at 128 weights, most of them from 0.001 / s to 1000 / s, and interpolated between
them in u by cubic splines: to 1e-3 of how far it falls.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # loads scipy.interpolate when it is first used: most commands never do
from numpy.typing import ArrayLike

from mlci.cells.protocol import check_has_cells
from mlci.demonstrations import Demonstration
from mlci.evidence import DEFAULT_MODEL_ERROR, PAPER, TIE, Rates
from mlci.inference import Inference
from mlci.likelihood_interval import likelihood_interval
from mlci.maxent import TrajectoryDistribution
from mlci.soft.distribution import SoftTask, soften
from mlci.soft.time_inside import time_inside
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel


def _to_unit(scaled: Floats) -> Floats:
    """u = w s / (1 + w s) of weights w s (Q,), 1 for an infinite one."""
    with np.errstate(divide="ignore"):
        return np.asarray(1 / (1 + 1 / scaled))


REGIONS = 3  # of a ranking, by default
_WEIGHTS = np.concatenate([[0.0, 1e-6], np.geomspace(1e-3, 1e3, 125), [np.inf]])  # times s
_UNIT = _to_unit(_WEIGHTS)
_TINY = float(np.log(np.finfo(float).tiny))  # log A of what is unavoidable but for rounding
_IMPOSSIBLE = -1e9  # nat: in place of -inf, between which no root is bracketed


@dataclass(frozen=True)
class WeightEstimate:
    """The weight of a soft constraint.

    Attributes:
        region: name of the region.
        weight: the most likely one [nat/s]; infinite for a wall.
        lower: lower end of the 95 % interval; 0 leaves open whether there is a constraint.
        upper: upper end; infinite leaves open whether it is a wall.
        gain: log likelihood ratio of that weight to none [nat].
        hard_to_soft: log likelihood ratio of the wall to that weight [nat], 0 or less; -inf if
            somebody is inside and nobody breaks rules.
        time_inside: mean time that the demonstrations are inside [s].
        expected_time: mean time without a constraint, by the model [s].
        demonstrations: how many say something.
    """

    region: str
    weight: float
    lower: float
    upper: float
    gain: float
    hard_to_soft: float
    time_inside: float
    expected_time: float
    demonstrations: int

    @property
    def verdict(self) -> str:
        """Soft or hard, as far as the interval tells."""
        if self.lower == 0:
            return "perhaps no constraint" if self.upper < np.inf else "undecided"
        return "soft" if self.upper < np.inf else "as a wall"

    def __str__(self) -> str:
        return (
            f"{self.verdict}: weight {self.weight:.3g} nat/s (95 %: {self.lower:.3g} to "
            f"{self.upper:.3g}); a wall is {abs(self.hard_to_soft):.3g} nat less likely; inside "
            f"for {self.time_inside:.3g} s, {self.expected_time:.3g} s without a constraint"
        )

    def record(self) -> dict[str, Any]:
        """The estimate for programs, fit for JSON: an infinite number is None."""
        numbers = asdict(self)
        finite = {
            name: value if isinstance(value, str) or np.isfinite(value) else None
            for name, value in numbers.items()
        }
        return {**finite, "verdict": self.verdict}


@dataclass(frozen=True, eq=False)
class SoftShares:
    """log A_j(w) of N tasks at any weight; `tabulate_shares` makes it.

    Attributes:
        scale: s [s].
        table: (N, Q) log A_j at weights _WEIGHTS / s [nat].
    """

    scale: float
    table: Floats

    @property
    def expected_times(self) -> Floats:
        """(N,) mean time inside without a constraint [s]: -dA/dw at 0, from the least weight."""
        return -np.expm1(self.table[:, 1]) * self.scale / _WEIGHTS[1]

    def log_share(self, weight: float) -> Floats:
        """(N,) log A_j at a weight [nat/s], which may be infinite."""
        return np.asarray(self._between(_to_unit(np.array(weight * self.scale))))

    @cached_property
    def _between(self) -> Callable[[float | Floats], Floats]:
        return scipy.interpolate.CubicSpline(_UNIT, self.table, axis=1)

    def of(self, tasks: ArrayLike) -> SoftShares:
        """Those of some tasks, by their numbers, which may come again."""
        return SoftShares(self.scale, self.table[np.asarray(tasks)])

    def estimate(self, times: ArrayLike, rates: Rates = PAPER, region: str = "") -> WeightEstimate:
        """The most likely weight of demonstrations that are inside for times (N,) [s].

        Args:
            times: how long each is inside the region.
            rates: model error and rule breaking of the demonstrators.
            region: name of the region.

        Raises:
            ValueError: not as many times as tasks, or one below 0.
        """
        inside = np.asarray(times, dtype=float)
        if inside.shape != (len(self.table),) or not np.all(inside >= 0):
            raise ValueError(f"{len(self.table)} tasks need as many times of at least 0 s")

        def log_likelihood(u: float) -> float:
            """sum_j l_j at u."""
            weight = _from_unit(u) / self.scale
            return float(np.sum(soft_evidence(weight, self._between(u), inside, rates)))

        def searched(u: float) -> float:
            """The same, finite."""
            return max(log_likelihood(u), _IMPOSSIBLE)

        each = soft_evidence(_WEIGHTS[:, None] / self.scale, self.table.T, inside, rates)
        values = np.maximum(np.sum(each, axis=1), _IMPOSSIBLE)
        best, lower, upper = likelihood_interval(searched, _UNIT, values, tolerance=1e-10)
        if log_likelihood(1.0) > log_likelihood(best) - TIE:  # where it is flat, a wall is simpler
            best = upper = 1.0
        return WeightEstimate(
            region=region,
            weight=_from_unit(best) / self.scale,
            lower=_from_unit(lower) / self.scale,
            upper=_from_unit(upper) / self.scale,
            gain=log_likelihood(best),
            hard_to_soft=min(0.0, log_likelihood(1.0) - log_likelihood(best)),
            time_inside=float(np.mean(inside)) if len(inside) else 0.0,
            expected_time=float(np.mean(self.expected_times)) if len(inside) else 0.0,
            demonstrations=len(inside),
        )


def soft_evidence(
    weight: float | Floats, log_share: Floats, inside: Floats, rates: Rates = PAPER
) -> Floats:
    """l_j (..., N) [nat]: log likelihood ratio of demonstrations under a weight and under none.

    Args:
        weight: w (..., 1) [nat/s], which may be infinite.
        log_share: (..., N) log A_j(w).
        inside: (N,) how long each demonstration is inside [s].
        rates: model error and rule breaking.
    """
    eta, eps = rates.model_error, rates.rule_breaking
    with np.errstate(divide="ignore", invalid="ignore"):
        cost = np.where(inside > 0, weight * inside, 0.0)
        log_a = np.logaddexp(np.log1p(-eta) + log_share, np.log(np.float64(eta)))
        return np.logaddexp(np.log1p(-eps) - cost - log_a, np.log(np.float64(eps)))


def tabulate_shares(tasks: Sequence[SoftTask]) -> SoftShares:
    """log A_j(w) of tasks, of one model and region, over the whole range of weights.

    Raises:
        ValueError: no task, or one that the model cannot do.
    """
    if not tasks:
        raise ValueError("a weight needs at least one task")
    scale = tasks[0].distribution.model.dt
    table = [[task.log_share(weight) for weight in _WEIGHTS / scale] for task in tasks]
    return SoftShares(scale, np.maximum(table, _TINY))


def estimate_weights(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    *,
    regions: ArrayLike | None = None,
    hypotheses: Bools | None = None,
    round_horizon: bool = False,
    exact_ends: bool = True,
) -> list[WeightEstimate]:
    """Soft or hard? The weights of some hypotheses.

    Args:
        model: the tabular model, small enough to keep its moves.
        demonstrations: the N that the inference is from.
        inference: what `infer` made of them, with the arguments below. Its rates count; in place of
            a calibration, the default model error. Pairs that a cell decides say nothing.
        regions: numbers of hypotheses; None takes the `best_forgiven`.
        hypotheses: (C',) mask over the model's regions; None takes all.
        round_horizon: as of `infer`.
        exact_ends: as of `infer`.

    Raises:
        TypeError: a model without cells that all tasks share.
        ValueError: the model keeps no moves.
    """
    check_has_cells(model)
    shape = len(demonstrations), len(inference.hypotheses)
    if inference.avoidance.shape != shape:
        raise ValueError(
            f"{shape[0]} demonstrations do not fit an inference from {inference.avoidance.shape[0]}"
        )
    chosen = best_forgiven(inference) if regions is None else np.atleast_1d(np.asarray(regions))
    of_numbers = chosen.ndim == 1 and (chosen.dtype.kind in "iu" or not chosen.size)
    if not of_numbers or np.any((chosen < 0) | (chosen >= shape[1])):
        raise ValueError(f"regions are numbers from 0 to {shape[1] - 1}, not {chosen.tolist()}")
    of_model = np.arange(len(model.regions)) if hypotheses is None else np.flatnonzero(hypotheses)
    rates = inference.rates
    if inference.calibration is not None:
        rates = Rates(DEFAULT_MODEL_ERROR, rates.rule_breaking)
    distributions = [
        TrajectoryDistribution.of_task(
            model, each.task, round_horizon=round_horizon, exact_ends=exact_ends
        )
        for each in demonstrations
    ]
    times = np.array(
        [time_inside(inference.hypotheses, each.states, each.times) for each in demonstrations]
    )
    estimates = []
    for region in chosen.tolist():
        says = np.flatnonzero(inference.reachable & ~inference.decided_by_cell[:, region])
        if not len(says):
            continue
        softened = soften(model, int(of_model[region]))
        shares = tabulate_shares([softened.task(distributions[j]) for j in says.tolist()])
        name = inference.hypotheses.names[region]
        estimates.append(shares.estimate(times[says, region], rates, name))
    return estimates


def best_forgiven(inference: Inference, count: int = REGIONS) -> Ints:
    """Numbers of the best hypotheses, the first of the ranking before all others.

    After it come the best if demonstrators may break rules at the rate that makes them most
    likely: a region that is entered seldom and briefly is soft, and no wall.
    """
    forgiven = inference.with_rule_breaking().order
    numbers = np.append(inference.order[:1], forgiven)
    return numbers[np.sort(np.unique(numbers, return_index=True)[1])][:count]


def _from_unit(u: float) -> float:
    """w s of u."""
    return np.inf if u >= 1 else u / (1 - u)
