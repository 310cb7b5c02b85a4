"""What demonstrations say about hypotheses: evidence, ranking, posterior, and how to read them."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mlci.credible_sets import CredibleSet, counted, credible_set
from mlci.crossings import ANY, Crossing
from mlci.demonstrations import Demonstration
from mlci.evidence import PAPER, Ranking, Rates, log_evidence, rank_constraints
from mlci.forecasts import ForecastMap, is_possible
from mlci.region_sizes import region_sizes, weights_by_size
from mlci.regions import Regions
from mlci.rule_breaking import RateEstimate, estimate_rule_breaking
from mlci.sampling_errors import SamplingErrors
from mlci.spaces import Bools, Floats, Ints

if TYPE_CHECKING:
    import pandas as pd

_ROWS_OF_REPR, _ROWS_OF_SUMMARY = 5, 10

# What became of a hypothesis, see `Inference.outcomes`.
FEASIBLE, VIOLATED, UNAVOIDABLE, UNREACHABLE = "feasible", "violated", "unavoidable", "unreachable"


@dataclass(frozen=True, eq=False)
class Inference:
    """What N demonstrations say about C hypotheses.

    Attributes:
        hypotheses: the C regions.
        names: (N,) names of the demonstrations.
        avoidance: (N, C) alpha, probability that the task's unconstrained agent avoids a
            hypothesis; 1 where avoiding it says nothing, as where the task cannot be done.
        violated: (N, C) which hypotheses a demonstration violates.
        reachable: (N,) whether the tabular model can do the task.
        prior_none: prior probability that there is no constraint.
        rates: model error and rule breaking of the demonstrators.
        calibration: what maps alpha to what simulated demonstrators do; None leaves it as it is.
        rule_breaking: the rate of rule breaking with its interval, where it is estimated from these
            demonstrations, see `with_rule_breaking`.
        decided_by_cell: (N, C) pairs that are no evidence, since the cell of a start or goal alone
            decides, see `mlci.evidence.decided_by_cell`; none by default.
        crossing: what counted as violating a hypothesis.
        sampling: how far `avoidance` may be off; None where nothing is sampled.
        size_prior: prior weights are sizes to the power of minus this, see `mlci.region_sizes`.

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
    calibration: ForecastMap | None = None
    rule_breaking: RateEstimate | None = None
    decided_by_cell: Bools = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    crossing: Crossing = ANY
    sampling: SamplingErrors | None = None
    size_prior: float = 0.0

    def __post_init__(self) -> None:
        shape = len(self.names), len(self.hypotheses)
        if not self.decided_by_cell.size:
            object.__setattr__(self, "decided_by_cell", np.zeros(shape, dtype=bool))
        arrays = (self.avoidance, self.violated, self.decided_by_cell)
        if any(array.shape != shape for array in arrays) or self.reachable.shape != shape[:1]:
            raise ValueError(
                f"{shape[0]} demonstrations and {shape[1]} hypotheses do not fit avoidance "
                f"{self.avoidance.shape}, violated {self.violated.shape}, decided_by_cell "
                f"{self.decided_by_cell.shape}, reachable {self.reachable.shape}"
            )

    @cached_property
    def ranking(self) -> Ranking:
        """Gain, rank and posterior of each hypothesis, equations (4) to (6)."""
        weights = weights_by_size(self.hypotheses, self.size_prior)
        return rank_constraints(self.forecast, self.violated, self.prior_none, weights, self.rates)

    @property
    def phi(self) -> Floats:
        """(N, C) probability that the unconstrained agent violates a hypothesis."""
        return 1.0 - self.avoidance

    @cached_property
    def forecast(self) -> Floats:
        """(N, C) probability of avoiding, as it counts for evidence: calibrated, if it can be, and
        1 where a cell decides."""
        return self.forecast_of(self.avoidance, self.decided_by_cell)

    def forecast_of(self, avoidance: Floats, decided_by_cell: Bools) -> Floats:
        """The same of tasks that nobody did yet, from alpha (N', C) and what cells decide."""
        alpha = avoidance
        if self.calibration is not None:
            alpha = self.calibration.avoidance(alpha, region_sizes(self.hypotheses))
        return np.where(decided_by_cell, 1.0, alpha)

    def with_rule_breaking(self) -> Inference:
        """The same with the rate of rule breaking that makes the demonstrations most likely."""
        estimate = estimate_rule_breaking(
            self.forecast, self.violated, self.rates.model_error, self.prior_none
        )
        rates = replace(self.rates, rule_breaking=estimate.rate)
        return replace(self, rates=rates, rule_breaking=estimate)

    @cached_property
    def evidence(self) -> Floats:
        """(N, C) log evidence of each demonstration for each hypothesis [nat]."""
        return log_evidence(self.forecast, self.violated, self.rates)

    @cached_property
    def outcomes(self) -> np.ndarray:
        """(C,) what became of each hypothesis.

        `violated`: a demonstration enters it. `unavoidable`: none does, although the tabular agent
        cannot but enter it in one of the tasks; without model error its gain is infinite.
        `unreachable`: no demonstration enters it, nor could the tabular agent in any task, so that
        nothing speaks for it. `feasible`: none of these.
        """
        cases = [
            (VIOLATED, np.any(self.violated, axis=0)),
            (UNAVOIDABLE, self.gain == np.inf),
            (UNREACHABLE, ~np.any(is_possible(self.avoidance), axis=0)),
        ]
        return np.select([case for _, case in cases], [name for name, _ in cases], FEASIBLE)

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
        """The inference from some of the demonstrations, by their numbers.

        A rate of rule breaking that is estimated is so from these alone.
        """
        part = demonstrations if isinstance(demonstrations, slice) else np.asarray(demonstrations)
        some = replace(
            self,
            names=tuple(np.array(self.names, dtype=object)[part]),
            avoidance=self.avoidance[part],
            violated=self.violated[part],
            reachable=self.reachable[part],
            decided_by_cell=self.decided_by_cell[part],
            sampling=self.sampling and self.sampling.of(part),
        )
        return some if self.rule_breaking is None else some.with_rule_breaking()

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before believing the ranking."""
        found = [] if self.sampling is None else self.sampling.warnings(self.names)
        if lost := [name for name, can in zip(self.names, self.reachable, strict=True) if not can]:
            found.append(
                f"the model cannot reach the goal of {', '.join(lost)}: evidence against "
                "what they violate, and for nothing"
            )
        regions = np.array(self.hypotheses.names)
        if (unavoidable := self.outcomes == UNAVOIDABLE).any():
            found.append(
                f"unavoidable: {', '.join(regions[unavoidable])}; the tabular agent cannot but "
                "enter, which no demonstration does, so that nothing else has any probability"
            )
        pairs = self.decided_by_cell & ~self.violated
        if (decided := pairs.any(axis=0)).any():
            whose = (
                f"{region} ({', '.join(np.array(self.names)[pairs[:, i]])})"
                for i, region in zip(np.flatnonzero(decided), regions[decided], strict=True)
            )
            found.append(
                "no evidence, since a start's or goal's cell alone makes it certain to be entered: "
                + ", ".join(whose)
            )
        return found

    def to_frame(self) -> pd.DataFrame:
        """A row a hypothesis, the most likely first: its bounds with units, and what is inferred.

        Returns:
            `hypothesis`, its name; for each dimension that some hypothesis bounds, `<name> from
            [unit]` and `<name> to [unit]`; `outcome`, see `outcomes`; `rank`, `gain` [nat], missing
            where it is unavoidable; `posterior`; and `violated_by`, the number of demonstrations.
        """
        import pandas as pd

        space, columns = self.hypotheses.space, {"hypothesis": np.array(self.hypotheses.names)}
        for d, (name, unit) in enumerate(zip(space.names, space.units, strict=True)):
            lower, upper = self.hypotheses.lower[:, d], self.hypotheses.upper[:, d]
            if np.any(np.isfinite(lower)):
                in_unit = f" [{unit}]" if unit else ""
                columns |= {f"{name} from{in_unit}": lower, f"{name} to{in_unit}": upper}
        columns |= {
            "outcome": self.outcomes,
            "rank": self.ranking.rank,
            "gain": np.where(self.outcomes == UNAVOIDABLE, np.nan, self.gain),
            "posterior": self.posterior,
            "violated_by": np.sum(self.violated, axis=0),
        }
        return pd.DataFrame(columns).iloc[self.order].reset_index(drop=True)

    @cached_property
    def credible(self) -> CredibleSet:
        """The 95 % credible set: the fewest regions, and perhaps "no constraint", that hold it."""
        return credible_set(self.hypotheses, self.posterior, self.posterior_none)

    def summary(self, rows: int = _ROWS_OF_SUMMARY) -> str:
        """What was inferred, in a few lines: the first hypotheses, credible set, warnings."""
        table = self.to_frame().head(rows).to_string(index=False, float_format="{:.3g}".format)
        return "\n".join(
            [
                f"{counted(len(self.names), 'demonstration')}, {len(self.hypotheses)} hypotheses; "
                f"probability of no constraint {self.posterior_none:.3g}",
                table,
                f"{100 * self.credible.share:g} % credible: {self.credible}",
                *(f"warning: {warning}" for warning in self.warnings),
            ]
        )

    def evidence_frame(self) -> pd.DataFrame:
        """A row a pair: `probability`, Phi; `forecast`, as it counts; `violated`; `evidence`."""
        import pandas as pd

        pairs = [np.array(names, dtype=object) for names in (self.names, self.hypotheses.names)]
        demonstrations, hypotheses = np.meshgrid(*pairs, indexing="ij")
        columns = {
            "demonstration": demonstrations,
            "hypothesis": hypotheses,
            "probability": self.phi,
            "forecast": 1 - self.forecast,
            "violated": self.violated,
            "evidence": self.evidence,
        }
        return pd.DataFrame({name: column.ravel() for name, column in columns.items()})

    def plot(self, demonstrations: Sequence[Demonstration] = (), **options: Any) -> Any:
        """Draw the hypotheses in the colour of their gain, and the paths of demonstrations.

        Args:
            demonstrations: those whose paths are drawn.
            options: `axes` and `dimensions`, as of `mlci.plot.draw_map`.

        Returns:
            Axes of matplotlib; `axes.figure.savefig` writes the picture.
        """
        return _plot().draw_map(self, demonstrations, **options)

    def save(self, folder: str | Path, demonstrations: Sequence[Demonstration] = ()) -> Path:
        """Write hypotheses.csv (`to_frame`), evidence.csv (`evidence_frame`) and map.png (`plot`).

        Returns:
            The folder, which is made if it is not there.
        """
        path = Path(folder)
        path.mkdir(parents=True, exist_ok=True)
        self.to_frame().to_csv(path / "hypotheses.csv", index=False)
        self.evidence_frame().to_csv(path / "evidence.csv", index=False)
        (path / "map.png").write_bytes(_plot().png(self.plot(demonstrations)))
        return path

    def __repr__(self) -> str:
        return self.summary(_ROWS_OF_REPR)

    def _repr_html_(self) -> str:
        """What a notebook shows: the summary, and the map."""
        import html

        return f"<pre>{html.escape(repr(self))}</pre>{_plot().html_image(self.plot())}"


def _plot() -> Any:
    """The module that draws: by its name, as no result depends on what a picture looks like."""
    return importlib.import_module("mlci.plot")
