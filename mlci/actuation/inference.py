"""Which controls are forbidden? The inference of regions, asked of what is applied.

Evidence, ranking and posterior are equations (4) to (6), as in `mlci.evidence`, with the
probability alpha of `mlci.actuation.moves`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mlci.actuation.hypotheses import ControlHypotheses
from mlci.actuation.moves import ControlledMoves
from mlci.demonstrations import Demonstration
from mlci.evidence import DEFAULT_MODEL_ERROR, Ranking, Rates, log_evidence, rank_evidence
from mlci.forecasts import ForecastMap, fit_map
from mlci.spaces import Bools, Floats
from mlci.systems import System
from mlci.tabular import TabularModel

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class ControlInference:
    """What N demonstrations say about C hypotheses about controls.

    Attributes:
        hypotheses: the C hypotheses.
        names: (N,) of the demonstrations.
        avoidance: (N, C) alpha, probability that the unconstrained agent keeps to a hypothesis; 1
            where the tabular model cannot do the task.
        applied: (N, C) which hypotheses a demonstration violates.
        shares: (C,) share of the model's moves that each forbids.
        prior_none: prior probability that nothing is forbidden.
        rates: model error and rule breaking.
        calibration: what maps alpha to what simulated demonstrators do; None takes it as it is.
    """

    hypotheses: ControlHypotheses
    names: tuple[str, ...]
    avoidance: Floats
    applied: Bools
    shares: Floats
    prior_none: float
    rates: Rates
    calibration: ForecastMap | None = None

    @cached_property
    def evidence(self) -> Floats:
        """(N, C) log evidence of each demonstration [nat], see `mlci.evidence.log_evidence`."""
        alpha, forecasts = self.avoidance, self.calibration
        if forecasts is not None:
            alpha = forecasts.avoidance(alpha, self.shares)
        return log_evidence(alpha, self.applied, self.rates)

    @cached_property
    def ranking(self) -> Ranking:
        """Gain, rank and posterior of each hypothesis."""
        return rank_evidence(self.evidence, self.applied, self.prior_none)

    def to_frame(self) -> pd.DataFrame:
        """A row a hypothesis, the most likely first: its `name`; `rank`; `gain` [nat];
        `posterior`; and `applied_by`, the number of demonstrations that violate it."""
        import pandas as pd

        columns = {
            "name": np.array(self.hypotheses.names, dtype=object),
            "rank": self.ranking.rank,
            "gain": self.ranking.gain,
            "posterior": self.ranking.posterior,
            "applied_by": np.sum(self.applied, axis=0),
        }
        return pd.DataFrame(columns).iloc[self.ranking.order].reset_index(drop=True)


def infer_controls(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    hypotheses: ControlHypotheses,
    *,
    tolerance: Floats | float = 0.0,
    prior_none: float = 0.5,
    rates: Rates | None = None,
    calibration: ForecastMap | None = None,
    exact_ends: bool = True,
    round_horizon: bool = False,
) -> ControlInference:
    """Rank hypotheses about controls by demonstrations, equations (4) to (6).

    Args:
        model: the tabular model, whose actions should lie on both sides of each border.
        demonstrations: N demonstrations, each with a task of its own.
        hypotheses: the C hypotheses, such as `ControlRanges` or `ControlPredicates`.
        tolerance: (m,) how far beyond a border a control must be to count as applied, as a mean
            over the model's time step; see `ControlHypotheses.applied_by`.
        prior_none: prior probability that nothing is forbidden.
        rates: as of `mlci.infer`.
        calibration: of `calibrate_controls`; as of `mlci.infer`.
        exact_ends: as of `mlci.infer`.
        round_horizon: likewise.

    Raises:
        TypeError: a model without cells.
        ValueError: hypotheses about another system, or one that forbids no move, so that the model
            cannot tell; a tolerance that is negative or of another number of controls.
    """
    reach = _checked_tolerance(model.system, tolerance)
    moves = ControlledMoves.of(model, hypotheses)
    alpha, applied = _evidence(moves, demonstrations, reach, exact_ends, round_horizon)
    default = Rates(DEFAULT_MODEL_ERROR if calibration is None else 0.0)
    return ControlInference(
        hypotheses,
        tuple(each.name or str(number) for number, each in enumerate(demonstrations)),
        alpha,
        applied,
        moves.shares,
        prior_none,
        default if rates is None else rates,
        calibration,
    )


def calibrate_controls(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    hypotheses: ControlHypotheses,
    *,
    tolerance: Floats | float = 0.0,
    exact_ends: bool = True,
    round_horizon: bool = False,
) -> ForecastMap | None:
    """The map of forecasts by demonstrators whom nothing limits, as `mlci.forecasts.fit_map`.

    Hypotheses that forbid like shares of the moves share a curve, as regions of like size do.

    Args:
        model: as of `infer_controls`, and so the others.
        demonstrations: of agents whom nothing limits.

    Returns:
        The map; None where no demonstration says anything of any hypothesis.

    Raises:
        TypeError, ValueError: as of `infer_controls`.
    """
    reach = _checked_tolerance(model.system, tolerance)
    moves = ControlledMoves.of(model, hypotheses)
    alpha, applied = _evidence(moves, demonstrations, reach, exact_ends, round_horizon)
    if not np.any(alpha < 1):
        return None
    return fit_map(alpha, applied, moves.shares)


def _checked_tolerance(system: System, tolerance: Floats | float) -> Floats:
    """A tolerance (m,).

    Raises:
        ValueError: a tolerance that is negative or of another number of controls.
    """
    reach, controls = np.asarray(tolerance, dtype=float), system.control_box.dimension
    if reach.shape not in ((), (controls,)) or not np.all((reach >= 0) & (reach < np.inf)):
        raise ValueError(
            f"a tolerance needs {controls} numbers of at least 0, one a control, not {tolerance}"
        )
    return np.broadcast_to(reach, (controls,))


def _evidence(
    moves: ControlledMoves,
    demonstrations: Sequence[Demonstration],
    tolerance: Floats,
    exact_ends: bool,
    round_horizon: bool,
) -> tuple[Floats, Bools]:
    """alpha (N, C), and which hypotheses each demonstration violates (N, C)."""
    model, hypotheses = moves.model, moves.hypotheses
    applied = [
        hypotheses.applied_by(model.system, each, min(model.dt, each.task.horizon), tolerance)
        for each in demonstrations
    ]
    tasks = [each.task for each in demonstrations]
    alpha = moves.avoidance(tasks, exact_ends=exact_ends, round_horizon=round_horizon)
    return alpha, np.array(applied, dtype=bool).reshape(alpha.shape)
