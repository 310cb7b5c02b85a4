"""What is asked of a constraint beside where it is: how soft it is, and whether it transfers."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.cells import Shape
from experiments.config.settings.kinds import (
    STRICT,
    Count,
    Strength,
    Weight,
    about,
)


@dataclass(frozen=True, config=STRICT)
class SoftSettings:
    """Can the weight of a soft constraint be told? For truths of one region."""

    sets: Annotated[
        Count,
        about(
            "sets of demonstrations drawn from the tabular model under each weight, whose weight "
            "is estimated"
        ),
    ]
    demonstrations: Annotated[Shape, about("so many demonstrations are in each set")]
    weights: Annotated[
        tuple[Weight, ...],
        about("costs of the time inside the truth; none asks nothing", "nat/s"),
    ]


@dataclass(frozen=True, config=STRICT)
class TransferSettings:
    """Does what was inferred hold where the controls are stronger or weaker?"""

    strengths: Annotated[
        tuple[Strength, ...],
        about(
            "the inferred region is kept out of by systems with so many times the control ranges; "
            "none asks nothing"
        ),
    ]
    trials: Annotated[Count, about("random controls that are let through by each filter")]
    states: Annotated[Count, about("random states of which it is asked whether they are safe")]
