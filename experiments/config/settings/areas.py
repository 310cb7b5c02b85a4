"""How well sets of hypotheses cover the truth: what is compared."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.cells import Shape
from experiments.config.settings.kinds import STRICT, CountOrNone, NotNegative, Number, about


@dataclass(frozen=True, config=STRICT)
class AreaSettings:
    """How well sets of hypotheses cover the truth; for hypotheses that tile the state space."""

    subsets: Annotated[
        CountOrNone,
        about("random subsets of the demonstrations from which areas are inferred; 0 asks nothing"),
    ]
    demonstrations: Annotated[Shape, about("so many demonstrations a subset")]
    adjacency: Annotated[
        NotNegative,
        about("how much more probable a set is for each pair of neighbours in it", "nat"),
    ]
    log_odds: Annotated[
        Number, about("prior log odds of a hypothesis without neighbours in the set", "nat")
    ]
