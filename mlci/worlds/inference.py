"""What paths through a table say about single hypotheses: evidence, ranking, posterior.

The evidence of a path xi for hypothesis i is the log likelihood ratio

    l = log p(xi | i) - log p(xi | no constraint),

of the distribution that the world has (`Trajectories` or `CausalEntropy`). They are two models:

* Where moves are certain, p(xi | i) = e^R / Z_i if xi keeps out of i, so that l = log Z - log Z_i =
  -log alpha_i, the same for every path from one start: (4) to (6).
* Where chance decides, l compares two policies, action by action, at the states where the path was.
  It depends on the whole path, and may be negative: under i the agent also keeps away from what may
  lead to i by chance.

The rates are those of `mlci.evidence`: with probability eta a path would be the same without
the constraint, and with probability eps the demonstrator ignores it, so that the ratio counts as

    (1 - eps) / ((1 - eta) e^(-l) + eta) + eps,

at most 1 / eta and at least eps. With e^(-l) = alpha_i that is what `log_evidence` computes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mlci.evidence import DEFAULT_MODEL_ERROR, PAPER, Ranking, Rates, rank_evidence
from mlci.spaces import Bools, Floats
from mlci.worlds.causal_entropy import CausalEntropy
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table, TablePath

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class TableInference:
    """What N paths say about the C hypotheses of a table.

    Attributes:
        hypotheses: (C,) names of the hypotheses.
        names: (N,) names of the paths.
        log_ratio: (N, C) l [nat]; -inf where a path violates a hypothesis, or where chance may
            force the agent into it whatever it does.
        violated: (N, C) which hypotheses a path violates.
        prior_none: prior probability that there is no constraint.
        rates: model error and rule breaking.

    Raises:
        ValueError: shapes that disagree.
    """

    hypotheses: tuple[str, ...]
    names: tuple[str, ...]
    log_ratio: Floats
    violated: Bools
    prior_none: float = 0.5
    rates: Rates = PAPER

    def __post_init__(self) -> None:
        shape = len(self.names), len(self.hypotheses)
        if not self.log_ratio.shape == self.violated.shape == shape:
            raise ValueError(
                f"log_ratio {self.log_ratio.shape} and violated {self.violated.shape} do not fit "
                f"{shape[0]} paths and {shape[1]} hypotheses"
            )

    @cached_property
    def evidence(self) -> Floats:
        """(N, C) log evidence of each path for each hypothesis [nat]."""
        eta, eps = self.rates.model_error, self.rates.rule_breaking
        with np.errstate(divide="ignore"):
            inverse = np.logaddexp(np.log1p(-eta) - self.log_ratio, np.log(eta))
            return np.asarray(np.logaddexp(np.log1p(-eps) - inverse, np.log(eps)))

    @cached_property
    def ranking(self) -> Ranking:
        """The hypotheses by likelihood."""
        return rank_evidence(self.evidence, self.violated, self.prior_none)

    def to_frame(self) -> pd.DataFrame:
        """A row a hypothesis, the most likely first.

        Returns:
            `hypothesis`, `rank`, `gain` [nat], `posterior`, and `violated_by`, the number of paths.
        """
        import pandas as pd

        frame = pd.DataFrame(
            {
                "hypothesis": self.hypotheses,
                "rank": self.ranking.rank,
                "gain": self.ranking.gain,
                "posterior": self.ranking.posterior,
                "violated_by": np.sum(self.violated, axis=0),
            }
        )
        return frame.iloc[self.ranking.order].reset_index(drop=True)


def infer_table(
    table: Table,
    paths: Sequence[TablePath],
    *,
    steps: int | None = None,
    discount: float = 1.0,
    prior_none: float = 0.5,
    rates: Rates | None = None,
) -> TableInference:
    """Rank the hypotheses of a table by paths through it.

    Args:
        table: the world, with hypotheses. Where `is_certain(table, discount)`, trajectories have
            the distribution of `FirstExit` or `FixedHorizon`; else the policy is `CausalEntropy`'s.
        paths: N paths of the table, each from a start and, where there are goals, to one of them.
        steps: the horizon; None takes paths of any length.
        discount: what a reward one step later counts.
        prior_none: prior probability that there is no constraint.
        rates: as of `infer`; None takes the default model error.

    Raises:
        ValueError: no hypotheses, a path that the table does not have, or no distribution.
    """
    if not table.regions:
        raise ValueError("a ranking needs hypotheses: give the table regions")
    crossed = [table.crossed_by(path) for path in paths]
    violated = np.array(crossed, dtype=bool).reshape(len(paths), len(table.regions))
    log_ratios = _of_trajectories if is_certain(table, discount) else _of_policies
    ratio = log_ratios(table, paths, steps, discount) if len(paths) else np.zeros(violated.shape)
    return TableInference(
        tuple(table.regions),
        tuple(path.name or str(j) for j, path in enumerate(paths)),
        np.where(violated, -np.inf, ratio),
        violated,
        prior_none,
        Rates(DEFAULT_MODEL_ERROR) if rates is None else rates,
    )


def is_certain(table: Table, discount: float = 1.0) -> bool:
    """Whether trajectories have probability e^R / Z: moves are certain, and nothing discounted."""
    return discount == 1 and bool(np.all(np.diff(table.transitions.indptr) <= 1))


def _of_trajectories(
    table: Table, paths: Sequence[TablePath], steps: int | None, _: float
) -> Floats:
    """(N, C) log Z - log Z_i from the start of each path."""
    starts, places = np.unique([path.states[0] for path in paths], return_inverse=True)
    if steps is None:
        everything = np.arange(len(table.regions))
        return np.asarray(-FirstExit(table).log_avoidance(starts, everything)[places])
    distribution = FixedHorizon(table, steps)
    alpha = np.array([distribution.avoidance_probabilities(start) for start in starts.tolist()])
    with np.errstate(divide="ignore"):
        return np.asarray(-np.log(alpha[places]))


def _of_policies(
    table: Table, paths: Sequence[TablePath], steps: int | None, discount: float
) -> Floats:
    """(N, C) log probability under each hypothesis, less that under none."""
    agent = CausalEntropy(table, steps, discount)
    nominal = np.array([agent.log_probability(path) for path in paths])
    if np.any(lost := nominal == -np.inf):
        raise ValueError(
            f"{paths[int(np.argmax(lost))].title} goes where the agent cannot but come, by chance, "
            "to a state without moves that is no goal; give that state a move, or make it a goal"
        )
    ratio = np.full((len(paths), len(table.regions)), -np.inf)
    for i, one in enumerate(_constrained(table)):
        constrained = CausalEntropy(one, steps, discount)
        for j, path in enumerate(paths):
            if np.all(one.allowed[path.states[:-1], path.actions]):
                ratio[j, i] = constrained.log_probability(path) - nominal[j]
    return ratio


def _constrained(table: Table) -> list[Table]:
    """The table under each hypothesis alone."""
    return [table.under(mask) for mask in np.eye(len(table.regions), dtype=bool)]
