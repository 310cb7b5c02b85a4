"""What demonstrations say about hypotheses: evidence, ranking, posterior, and how to read them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from mlci.evidence import PAPER, Ranking, Rates, log_evidence, rank_constraints
from mlci.regions import Regions
from mlci.spaces import Bools, Floats, Ints

_ROWS_OF_REPR, _ROWS_OF_SUMMARY = 5, 10


@dataclass(frozen=True, eq=False)
class Inference:
    """What N demonstrations say about C hypotheses.

    Attributes:
        hypotheses: the C regions.
        names: (N,) names of the demonstrations.
        avoidance: (N, C) alpha, probability that the task's unconstrained agent avoids a
            hypothesis; 1 where the demonstration says nothing by avoiding it, as where the tabular
            model cannot do the task.
        violated: (N, C) which hypotheses a demonstration violates.
        reachable: (N,) whether the tabular model can do the task.
        prior_none: prior probability that there is no constraint.
        rates: model error and rule breaking of the demonstrators.

    Raises:
        ValueError: shapes that disagree.
    """

    hypotheses: Regions
    names: tuple[str, ...]
    avoidance: Floats
    violated: Bools
    reachable: Bools
    prior_none: float = 0.5
    rates: Rates = PAPER

    def __post_init__(self) -> None:
        shape = len(self.names), len(self.hypotheses)
        if not (
            self.phi.shape == self.violated.shape == shape == (*self.reachable.shape, shape[1])
        ):
            raise ValueError(
                f"{shape[0]} demonstrations and {shape[1]} hypotheses do not fit avoidance "
                f"{self.avoidance.shape}, violated {self.violated.shape}, reachable "
                f"{self.reachable.shape}"
            )

    @cached_property
    def ranking(self) -> Ranking:
        """Gain, rank and posterior of each hypothesis, equations (4) to (6)."""
        return rank_constraints(self.avoidance, self.violated, self.prior_none, rates=self.rates)

    @property
    def phi(self) -> Floats:
        """(N, C) probability that the unconstrained agent violates a hypothesis."""
        return 1.0 - self.avoidance

    @cached_property
    def evidence(self) -> Floats:
        """(N, C) log evidence of each demonstration for each hypothesis [nat]."""
        return log_evidence(self.avoidance, self.violated, self.rates)

    @property
    def gain(self) -> Floats:
        """(C,) log likelihood gain [nat]; -inf for a hypothesis that a demonstration violates."""
        return self.ranking.gain

    @property
    def order(self) -> Ints:
        """(C,) hypotheses from the most likely to the least."""
        return self.ranking.order

    @property
    def posterior(self) -> Floats:
        """(C,) probability of each being the one constraint."""
        return self.ranking.posterior

    @property
    def posterior_none(self) -> float:
        """Probability that there is no constraint."""
        return self.ranking.posterior_none

    def of(self, demonstrations: ArrayLike | slice) -> Inference:
        """The inference from some of the demonstrations, by their numbers."""
        part = demonstrations if isinstance(demonstrations, slice) else np.asarray(demonstrations)
        return replace(
            self,
            names=tuple(np.array(self.names, dtype=object)[part]),
            avoidance=self.avoidance[part],
            violated=self.violated[part],
            reachable=self.reachable[part],
        )

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before believing the ranking."""
        found = []
        if lost := [name for name, can in zip(self.names, self.reachable, strict=True) if not can]:
            found.append(
                f"the tabular model cannot reach the goal of {', '.join(lost)}: evidence against "
                "what they violate, and for nothing"
            )
        if unavoidable := np.flatnonzero(self.gain == np.inf).tolist():
            names = ", ".join(self.hypotheses.names[i] for i in unavoidable)
            found.append(f"some tabular agent cannot avoid {names}: their gain is infinite")
        return found

    def to_frame(self) -> pd.DataFrame:
        """A row a hypothesis, the most likely first: its bounds with units, and what is inferred.

        Returns:
            `hypothesis`, its name; for each dimension that some hypothesis bounds, `<name> from
            [unit]` and `<name> to [unit]`; `rank`, `gain` [nat], `posterior`, and `violated_by`,
            the number of demonstrations.
        """
        space, columns = self.hypotheses.space, {"hypothesis": np.array(self.hypotheses.names)}
        for d, (name, unit) in enumerate(zip(space.names, space.units, strict=True)):
            lower, upper = self.hypotheses.lower[:, d], self.hypotheses.upper[:, d]
            if np.any(np.isfinite(lower)):
                in_unit = f" [{unit}]" if unit else ""
                columns |= {f"{name} from{in_unit}": lower, f"{name} to{in_unit}": upper}
        columns |= {
            "rank": self.ranking.rank,
            "gain": self.gain,
            "posterior": self.posterior,
            "violated_by": np.sum(self.violated, axis=0),
        }
        return pd.DataFrame(columns).iloc[self.order].reset_index(drop=True)

    def summary(self, rows: int = _ROWS_OF_SUMMARY) -> str:
        """What was inferred, in a few lines: the most likely hypotheses, and warnings."""
        table = self.to_frame().head(rows).to_string(index=False, float_format="{:.3g}".format)
        return "\n".join(
            [
                f"{len(self.names)} demonstrations, {len(self.hypotheses)} hypotheses; probability "
                f"of no constraint {self.posterior_none:.3g}",
                table,
                *(f"warning: {warning}" for warning in self.warnings),
            ]
        )

    def __repr__(self) -> str:
        return self.summary(_ROWS_OF_REPR)
