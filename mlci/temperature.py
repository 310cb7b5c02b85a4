"""The temperature of demonstrators: by the likelihood of their paths, jointly with the constraint.

Without a constraint, (2) gives a path with reward R_j at temperature 1 the likelihood
e^(R_j / T) / Z_j(T) at temperature T. Under constraint i, (3) divides it by the probability
alpha_ij(T) of avoiding i, and excludes the path if it crosses i; with the rates of model error and
rule breaking it is multiplied by e^(L_ij(T)) instead (`mlci.evidence`). Summed over "none" and the
hypotheses with their prior pi, demonstrations have the log likelihood

    sum_j (R_j / T - log Z_j(T)) + log(pi_0 + sum_i pi_i e^(L_i(T))),    L_i = sum_j L_ij.

The estimate is where it is largest over T, with the interval of `mlci.likelihood_interval`. The
first part takes log Z at each T that is tried. The second is interpolated in log T between those of
a grid where it can matter: with M = log(pi_0 + ...) between log pi_0 and what N demonstrations can
bring at most, all others lie below the interval whatever their M.

A recorded path has no cells that the deterministic kernel allows, so its R_j is that of the
continuous path (`mlci.inverse_dynamics`), while Z sums over the tabular actions. A path that costs
less than every tabular path to its goal is colder than any temperature: then the estimate is the
lower end of the range.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import scipy  # loads scipy.interpolate when it is first used: most commands never do

from mlci.demonstrations import Demonstration
from mlci.evidence import DEFAULT_MODEL_ERROR, Rates, log_evidence, log_marginal, total_gain
from mlci.inference import Inference
from mlci.inverse_dynamics import path_reward
from mlci.likelihood_interval import DROP, likelihood_interval
from mlci.maxent import TrajectoryDistribution
from mlci.spaces import Bools, Floats
from mlci.tabular import TabularModel

RANGE = 100.0  # temperatures from a hundredth to a hundred times the model's are tried
_GRID = np.linspace(-np.log(RANGE), np.log(RANGE), 15)  # of log T, relative to the model's
_TOLERANCE = 1e-4  # of log T at the interval's ends
_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class TemperatureEstimate:
    """The temperature that demonstrations look like.

    Attributes:
        assumed: that of the tabular model.
        temperature: the most likely one.
        lower: lower end of the 95 % interval.
        upper: upper end.
        searched: the range that was tried; an end of the interval that equals one of it is open.
        used: names of the demonstrations that it is from: those that the tabular model can do.
    """

    assumed: float
    temperature: float
    lower: float
    upper: float
    searched: tuple[float, float]
    used: tuple[str, ...]

    @property
    def flat(self) -> bool:
        """Whether the interval reaches an end of the range."""
        return self.lower <= self.searched[0] or self.upper >= self.searched[1]

    def __str__(self) -> str:
        if not self.flat:
            return f"like {self.temperature:.3g} ({self.lower:.3g} to {self.upper:.3g})"
        if self.upper < self.searched[1]:
            return f"colder than {self.upper:.3g}"
        return f"warmer than {self.lower:.3g}" if self.lower > self.searched[0] else "like any"

    def summary(self) -> str:
        """What was found, in a phrase."""
        if not self.used:
            return "the tabular model can do none of the tasks"
        return f"the paths look {self}"

    def record(self) -> dict[str, Any]:
        """The estimate for programs, fit for JSON."""
        return {**asdict(self), "flat": self.flat}

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before believing the temperature."""
        if not self.used:
            return []
        if self.flat:
            return [
                f"the demonstrations do not bound their temperature: of {self.searched[0]:.3g} to "
                f"{self.searched[1]:.3g} they look {self}"
            ]
        if not self.lower <= self.assumed <= self.upper:
            return [
                f"by their temperature the demonstrations look {self}, and {self.assumed:g} is "
                "assumed: the model takes them for "
                + ("steadier" if self.assumed < self.lower else "more random")
                + " than they are"
            ]
        return []


def estimate_temperature(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    *,
    hypotheses: Bools | None = None,
    round_horizon: bool = False,
    exact_ends: bool = True,
) -> TemperatureEstimate:
    """The temperature that demonstrations look like, jointly with the constraint.

    Args:
        model: the tabular model.
        demonstrations: the N that the inference is from.
        inference: what `infer` made of them, with the arguments below. Its prior and rates count;
            in place of a calibration, which belongs to one temperature, the default model error.
        hypotheses: (C',) mask over the model's regions; None takes all.
        round_horizon: as of `infer`.
        exact_ends: as of `infer`.
    """
    distributions = [
        TrajectoryDistribution.of_task(
            model, each.task, round_horizon=round_horizon, exact_ends=exact_ends
        )
        for each in demonstrations
    ]
    rewards = [
        path_reward(model.system, each, distribution.steps)
        for each, distribution in zip(demonstrations, distributions, strict=True)
    ]
    return temperature_of_rewards(distributions, np.array(rewards), inference, hypotheses)


def temperature_of_rewards(
    distributions: Sequence[TrajectoryDistribution],
    rewards: Floats,
    inference: Inference,
    hypotheses: Bools | None = None,
) -> TemperatureEstimate:
    """The temperature of paths whose rewards are known.

    Args:
        distributions: N, of the demonstrations' tasks.
        rewards: (N,) reward of each path at temperature 1 [nat].
        inference: as of `estimate_temperature`.
        hypotheses: likewise.
    """
    can = np.flatnonzero(inference.reachable)
    assumed = distributions[0].model.temperature if distributions else 1.0
    grid = np.log(assumed) + _GRID
    searched = float(np.exp(grid[0])), float(np.exp(grid[-1]))
    if not len(can):
        return TemperatureEstimate(assumed, assumed, *searched, searched, ())
    paths = _Paths(
        [distributions[j] for j in can.tolist()], rewards[can], inference.of(can), hypotheses
    )
    free = np.array([paths.without_constraint(log_t) for log_t in grid])
    least, most = paths.bounds
    near = np.flatnonzero(free + most >= np.max(free) + least - DROP)
    nodes = grid[max(near[0] - 1, 0) : near[-1] + 2]
    between = scipy.interpolate.PchipInterpolator(
        nodes, [paths.by_constraint(log_t) for log_t in nodes]
    )

    def by_constraint(log_t: Floats) -> Floats:
        """What constraints add, between the nodes."""
        return np.asarray(between(np.clip(log_t, nodes[0], nodes[-1])))

    best, lower, upper = likelihood_interval(
        lambda log_t: paths.without_constraint(log_t) + float(by_constraint(np.array(log_t))),
        grid,
        free + by_constraint(grid),
        _TOLERANCE,
    )
    ends = float(np.exp(best)), float(np.exp(lower)), float(np.exp(upper))
    return TemperatureEstimate(assumed, *ends, searched, paths.inference.names)


@dataclass(frozen=True, eq=False)
class _Paths:
    """Demonstrations of tasks that the tabular model can do; attributes as of the above."""

    distributions: Sequence[TrajectoryDistribution]
    rewards: Floats
    inference: Inference
    hypotheses: Bools | None

    def without_constraint(self, log_t: float) -> float:
        """sum_j R_j / T - log Z_j(T)."""
        log_z = [each.log_z[0, each.start] for each in self._at(log_t)]
        return float(np.sum(self.rewards) * np.exp(-log_t) - np.sum(log_z))

    def by_constraint(self, log_t: float) -> float:
        """log(pi_0 + sum_i pi_i e^(L_i(T)))."""
        alpha = np.array([each.avoidance_probabilities() for each in self._at(log_t)])
        if self.hypotheses is not None:
            alpha = alpha[:, self.hypotheses]
        # What is unavoidable has the gain of what is so but for rounding: finite, to be compared.
        alpha = np.where(self.inference.decided_by_cell, 1.0, np.maximum(alpha, _TINY))
        gain = total_gain(log_evidence(alpha, self.inference.violated, self.rates))
        return float(log_marginal(gain, self.inference.prior_none))

    @property
    def rates(self) -> Rates:
        """Of model error and rule breaking, without a calibration."""
        rates = self.inference.rates
        return (
            rates
            if self.inference.calibration is None
            else replace(rates, model_error=DEFAULT_MODEL_ERROR)
        )

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the most that `by_constraint` can be."""
        with np.errstate(divide="ignore"):
            each = float(-np.log(np.float64(self.rates.model_error)))
        return float(np.log(self.inference.prior_none)), max(0.0, len(self.rewards) * each)

    def _at(self, log_t: float) -> Iterator[TrajectoryDistribution]:
        """The distributions at a temperature."""
        model = self.distributions[0].model.with_temperature(float(np.exp(log_t)))
        return (each.with_temperature_of(model) for each in self.distributions)
