"""The groups of a config, such as `grid` and `truth`: one dataclass each."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from experiments.config.settings.area_shapes import AreaShapeSettings
from experiments.config.settings.cells import Shape
from experiments.config.settings.kinds import (
    STRICT,
    Count,
    CountOrNone,
    Flag,
    NotNegative,
    Number,
    Positive,
    Probability,
    Share,
    ShareOrEstimate,
    SizePower,
    Weight,
    about,
)
from experiments.config.settings.shapes import Region
from mlci.evidence import Rates
from mlci.spaces import Box, StateSpace


@dataclass(frozen=True, config=STRICT)
class TaskBoxSettings(Region):
    """Where starts and goals are drawn."""

    lower: Annotated[
        tuple[Number | None, ...],
        about(
            "lower ends of the box that starts and goals are drawn from; null, at both ends, is "
            "the whole dimension",
            "of the state",
        ),
    ]
    upper: Annotated[tuple[Number | None, ...], about("upper ends of that box", "of the state")]
    goal: Annotated[
        tuple[NotNegative | None, ...] | None,
        about(
            "how far a goal reaches around its state in each dimension, null if free; null alone "
            "makes it a point",
            "of the state",
        ),
    ]

    def start_box(self, space: StateSpace) -> Box:
        """Where starts and goals are drawn; a free dimension spans the state space."""
        box, bounds = self.box(), space.bounds
        return Box(
            np.where(np.isfinite(box.lower), box.lower, bounds.lower),
            np.where(np.isfinite(box.upper), box.upper, bounds.upper),
        )

    @property
    def goal_offsets(self) -> Box | None:
        """The goal region relative to its middle; None for a point."""
        if self.goal is None:
            return None
        reach = np.array([np.inf if side is None else side for side in self.goal])
        return Box(-reach, reach)


@dataclass(frozen=True, config=STRICT)
class TaskSettings(TaskBoxSettings):
    """Where starts and goals are drawn, and which of the tasks count."""

    crossing: Annotated[
        Flag, about("only tasks whose optimum, were there no constraint, would enter the truth")
    ]


@dataclass(frozen=True, config=STRICT)
class DemonstrationSettings:
    """How demonstrations are generated."""

    pairs: Annotated[Count, about("start and goal pairs that are tried")]
    keep: Annotated[Count, about("the first survivors that make the study")]
    dt: Annotated[Positive, about("time step; it divides the horizon", "s")]
    goal_tolerance: Annotated[
        Positive, about("largest final distance to the goal, Euclidean", "of the state")
    ]
    restarts: Annotated[Count, about("random first controls that are tried for a pair")]
    iterations: Annotated[Count, about("iterations of iLQR from each of them")]
    goal_weight: Annotated[Positive, about("price of the squared final distance to the goal")]
    hold: Annotated[Positive, about("the random first controls change this often", "s")]
    clip: Annotated[
        Flag, about("whether the demonstrator is limited to the control range of the system")
    ]
    wind: Annotated[
        Flag,
        about("any number of turns may lead to a goal; false: only the way of at most half a turn"),
    ]
    integrator: Annotated[
        Literal["euler", "rk4"],
        about("steps of the simulation: `euler`, as the paper's recordings, or `rk4`, Runge-Kutta"),
    ]
    rule_breaking: Annotated[
        Share, about("probability that a trial's demonstrator ignores the constraint")
    ]


@dataclass(frozen=True, config=STRICT)
class SetSettings:
    """Belief over sets of hypotheses, beside the ranking of each alone."""

    largest: Annotated[
        CountOrNone,
        about(
            "hypotheses that may be forbidden at once, 2 for pairs; 0 asks nothing of sets. More "
            "than are enumerated (any set of 12, or all pairs) are sampled by Markov chains"
        ),
    ]
    further: Annotated[
        Probability,
        about("factor of the prior for each further hypothesis of a set, after the first"),
    ]
    adjacency: Annotated[
        Weight,
        about("how much more probable a set is for each pair of neighbours in it", "nat"),
    ]
    steps: Annotated[
        Count, Field(ge=4), about("moves of each of four chains, where sets are sampled")
    ]


@dataclass(frozen=True, config=STRICT)
class InferenceSettings:
    """What is believed before any demonstration, and how much each of them says."""

    prior: Annotated[Probability, about("probability that there is no constraint at all")]
    size_prior: Annotated[
        SizePower,
        about(
            "a hypothesis has a prior weight of its size to the power of minus this: 0 makes all "
            "equal, 1 a region of half the size twice as probable"
        ),
    ]
    exact_ends: Annotated[
        Flag, about("trajectories of the tabular model begin and end at states, not at cells")
    ]
    calibrate: Annotated[
        Flag,
        about(
            "whether probabilities of the tabular model are mapped to what simulated "
            "demonstrators do; `model_error` is for where they are not"
        ),
    ]
    model_error: Annotated[
        Share, about("share of demonstrations that say nothing by what they avoid")
    ]
    rule_breaking: Annotated[
        ShareOrEstimate,
        about(
            "share of demonstrations that ignore the constraint; `estimate` takes the one that "
            "makes them most likely"
        ),
    ]
    sets: SetSettings
    shapes: AreaShapeSettings

    def rates(self, *, calibrated: bool) -> Rates:
        """The rates; that of rule breaking is 0 where it is still to be estimated."""
        breaking = self.rule_breaking if isinstance(self.rule_breaking, float) else 0.0
        return Rates(0.0 if calibrated else self.model_error, breaking)


@dataclass(frozen=True, config=STRICT)
class RankSettings:
    """Ranks of the truth over random subsets of the demonstrations."""

    demonstrations: Annotated[
        Count, about("ranks of the truth after 1 up to this many demonstrations")
    ]
    subsets: Annotated[Count, about("random subsets of each size")]
    top: Annotated[Count, about("the share of subsets that put the truth among this many")]


@dataclass(frozen=True, config=STRICT)
class CalibrationSettings:
    """Are beliefs as often right as they are probable? For truth=cell and truth=none."""

    sets: Annotated[
        CountOrNone,
        about("sets of demonstrations drawn from the tabular model; 0 asks nothing"),
    ]
    demonstrations: Annotated[Shape, about("so many demonstrations of each set are seen")]


@dataclass(frozen=True, config=STRICT)
class NextTaskSettings:
    """How many demonstrations it takes if tasks are chosen for what they teach."""

    repetitions: Annotated[
        CountOrNone,
        about(
            "pools of kept tasks from which tasks are chosen, or taken at random; 0 asks nothing"
        ),
    ]
    pool: Annotated[Count, about("kept tasks that are drawn for a pool, at most")]
    most: Annotated[Count, about("demonstrations after which a repetition ends")]
    samples: Annotated[
        Count, about("trajectories drawn for each task, to tell what it is expected to teach")
    ]
