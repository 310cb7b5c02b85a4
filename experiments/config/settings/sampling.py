"""The distribution of a task from sampled paths, and what is asked of a model, cells or none."""

from __future__ import annotations

from typing import Annotated

from pydantic.dataclasses import dataclass

from experiments.config.settings.kinds import (
    STRICT,
    Count,
    CountOrNone,
    Flag,
    Positive,
    Restarts,
    about,
)


@dataclass(frozen=True, config=STRICT)
class SampledSettings:
    """Whether and how paths are sampled: `mlci.SampledModel`."""

    use: Annotated[
        Flag,
        about(
            "paths are sampled, so that `grid`, `actions` and `transition` play no part; false "
            "takes cells"
        ),
    ]
    samples: Annotated[Count, about("paths that are drawn for a task")]
    settle: Annotated[
        CountOrNone,
        about(
            "so many of the first ranks are to be settled at 95 %: samples are doubled until they "
            "are; 0 leaves them as they come"
        ),
    ]
    most: Annotated[Count, about("samples of a task that are not exceeded for that")]
    restarts: Annotated[
        Restarts, about("first guesses of the search for locally optimal ways, for each winding")
    ]
    substeps: Annotated[
        Count, about("integrator steps of a time step, between which paths are straight")
    ]
    tolerance: Annotated[
        Positive,
        about("half width of a goal in dimensions in which it is a point", "of the state"),
    ]
    limited: Annotated[
        Flag,
        about("controls stay within the range of the actions; false leaves them to the reward"),
    ]


@dataclass(frozen=True, config=STRICT)
class ModelsSettings:
    """How good is a model? Asked alike of cells and of sampled paths, to compare them."""

    trials: Annotated[
        CountOrNone,
        about(
            "tasks that simulated demonstrators do without a constraint, by which forecasts of "
            "the model are scored, at most demonstrations.keep; 0 asks nothing"
        ),
    ]
    seeded: Annotated[
        Flag,
        about("those tasks are drawn for each seed anew; false takes the same for all, to compare"),
    ]
    steps: Annotated[
        tuple[Positive, ...],
        about("time steps, of each two of which it is asked how far Phi differs; none asks", "s"),
    ]
    tasks: Annotated[Count, about("of so many demonstrations, at most, for the time steps")]
