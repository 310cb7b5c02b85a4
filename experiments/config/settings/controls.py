"""Constraints on controls of a config: ranges that are forbidden, or that may be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator
from pydantic.dataclasses import dataclass

from experiments.config.settings.control_predicates import PredicateSettings, read_predicate
from experiments.config.settings.kinds import STRICT, Number, Probability, Share, about
from mlci.actuation.hypotheses import JoinedHypotheses
from mlci.actuation.predicates import ControlPredicates
from mlci.actuation.ranges import ControlRanges
from mlci.spaces import Floats
from mlci.systems import System


@dataclass(frozen=True, config=STRICT)
class ControlRange:
    """An open box of controls; None where it has no end."""

    lower: Annotated[
        tuple[Number | None, ...],
        about("lower ends, one a control; null where there is none", "of the control"),
    ]
    upper: Annotated[tuple[Number | None, ...], about("upper ends", "of the control")]


ForbiddenControls = Annotated[
    tuple[ControlRange, ...],
    about(
        "ranges of controls that demonstrators do not apply, null for no end, as in "
        "{lower: [1.0], upper: [null]}; each cuts off an end of one control",
        "of the control",
    ),
]


@dataclass(frozen=True, config=STRICT)
class ControlHypothesesSettings:
    """Ranges of controls that may be forbidden, ranked apart from the regions."""

    ranges: Annotated[
        tuple[ControlRange, ...],
        about(
            "ranges of controls that may be forbidden, null for no end, as in {lower: [1.0], "
            "upper: [null]}",
            "of the control",
        ),
    ]
    predicates: Annotated[
        tuple[Annotated[PredicateSettings, BeforeValidator(read_predicate)], ...],
        about(
            "and functions of states and controls of your own: `_target_` names a function that "
            "returns one and takes the other keys"
        ),
    ]
    shares: Annotated[
        tuple[Probability, ...],
        about(
            "and of each control all beyond these shares of the way from the middle of its range "
            "to its end, on either side"
        ),
    ]
    tolerance: Annotated[
        Share,
        about(
            "how far beyond a border the mean of a control over dt must be to count",
            "share of the control's range",
        ),
    ]

    both: Annotated[
        Share,
        about(
            "prior probability that a region and a range are forbidden at once, if anything is; "
            "above 0 regions and ranges compete in one belief, and what is left goes to a region "
            "alone and a range alone in equal parts"
        ),
    ]

    @property
    def is_asked(self) -> bool:
        """Whether there are hypotheses about controls."""
        return bool(self.ranges or self.shares or self.predicates)

    def hypotheses(self, system: System) -> JoinedHypotheses:
        """The hypotheses: the ranges, those of shares, then the predicates.

        Raises:
            ValueError: two that are the same.
        """
        functions = [each.function() for each in self.predicates]
        names = tuple(each.name for each in self.predicates)
        return JoinedHypotheses((self.all_ranges(system), ControlPredicates(functions, names)))

    def all_ranges(self, system: System) -> ControlRanges:
        """Those hypotheses that are ranges: the listed ones, then those of shares.

        Raises:
            ValueError: two that are the same.
        """
        listed, beyond = ranges_of(self.ranges, system), ControlRanges.beyond(system, self.shares)
        return ControlRanges(
            np.vstack([listed.lower, beyond.lower]), np.vstack([listed.upper, beyond.upper])
        )

    def reach(self, system: System) -> Floats:
        """(m,) the tolerance in the units of the controls."""
        return np.asarray(self.tolerance * system.control_box.widths)


def ranges_of(listed: Sequence[ControlRange], system: System) -> ControlRanges:
    """Ranges of a config, each of which has as many ends as the system has controls."""
    m = system.control_box.dimension
    lower = [[-np.inf if end is None else end for end in each.lower] for each in listed]
    upper = [[np.inf if end is None else end for end in each.upper] for each in listed]
    return ControlRanges(np.reshape(lower, (-1, m)), np.reshape(upper, (-1, m)))
