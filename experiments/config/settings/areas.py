"""How well sets of hypotheses cover the truth: what is compared."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.cells import Shape
from experiments.config.settings.kinds import STRICT, CountOrNone, LogOdds, Weight, about


@dataclass(frozen=True, config=STRICT)
class AreaSettings:
    """How well sets of hypotheses cover the truth; for hypotheses that tile the state space."""

    subsets: Annotated[
        CountOrNone,
        about("random subsets of the demonstrations from which areas are inferred; 0 asks nothing"),
    ]
    demonstrations: Annotated[Shape, about("so many demonstrations a subset")]
    adjacency: Annotated[
        Weight,
        about("how much more probable a set is for each pair of neighbours in it", "nat"),
    ]
    log_odds: Annotated[
        LogOdds, about("prior log odds of a hypothesis without neighbours in the set", "nat")
    ]
