"""Tables of one point that show single trajectories beside single demonstrations."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from mlci.models import Model
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel

_TIE = 1e-9  # sums of probabilities closer than this are equal


def trial_that_shows_the_constraint(feasible: Bools, unconstrained: Floats, covered: Bools) -> int:
    """The feasible trial that is most likely to violate the truth where nobody forbids it.

    The first of equals; the first of all if none is feasible.

    Args:
        feasible: (N,) which trials the tabular agent can do under the truth.
        unconstrained: (N, C) violation probabilities without constraint.
        covered: (C,) which hypotheses lie inside the truth.
    """
    chance = np.where(feasible, np.sum(unconstrained[:, covered], axis=1), -1.0)
    return int(np.argmax(chance >= np.max(chance) - _TIE))


def trajectory_tables(
    model: Model,
    hypotheses: Bools,
    trajectories: Mapping[int, tuple[Ints, Ints]],
    violated: Mapping[int, Bools],
    example: int | None,
) -> dict[str, pd.DataFrame]:
    """Sampled trajectories, the hypotheses that they and the demonstrations violate, some moves.

    Args:
        model: the model; of one without cells there are no trajectories.
        hypotheses: (C',) mask over the model's regions.
        trajectories: cells (T+1,) and moves (T,) of one sampled trajectory, by trial.
        violated: (C,) hypotheses that a demonstration violates, by trial.
        example: the trial whose moves are listed.

    Returns:
        `sampled`, a row a step of a trajectory; `violations`, a row a hypothesis that a
        demonstration or a trajectory violates; and `moves`, a row an action and successor of the
        cells that the trajectory of `example` visits.
    """
    visits, crossed = [], []
    for trial, (cells, _) in trajectories.items():
        visits += [(trial, step, cell) for step, cell in enumerate(cells)]
    if trajectories and isinstance(model, TabularModel):
        cells, moves = map(np.stack, zip(*trajectories.values(), strict=True))
        regions = model.crossed(cells[:, :-1], moves)[:, hypotheses]
        for trial, row in zip(trajectories, regions, strict=True):
            crossed += [(trial, "sampled", i) for i in np.flatnonzero(row)]
    for trial, regions in violated.items():
        crossed += [(trial, "demonstration", i) for i in np.flatnonzero(regions)]
    rows = np.zeros((0, 3), dtype=np.int64)
    if example is not None and example in trajectories and isinstance(model, TabularModel):
        rows = _move_rows(model, np.unique(trajectories[example][0]).astype(np.int64))
    return {
        "sampled": pd.DataFrame(visits, columns=["trial", "step", "cell"]),
        "violations": pd.DataFrame(sorted(crossed), columns=["trial", "source", "hypothesis"]),
        "moves": pd.DataFrame(rows, columns=["cell", "action", "successor"]),
    }


def _move_rows(model: TabularModel, visited: Ints) -> Ints:
    """Cell, action and successor (R, 3) of the moves of some cells."""
    single = model.moves_of(visited)
    row, move = np.nonzero(single.allowed(model.truth))
    rows = np.stack([visited[row], model.action[move], single.successor[row, move]], axis=1)
    return np.unique(rows, axis=0)


def probability_table(
    trial: int | None, unconstrained: Floats, constrained: Floats
) -> pd.DataFrame:
    """Phi of one trial, a row a hypothesis, without the truth and under it; no row for no trial.

    Args:
        trial: its number.
        unconstrained: (C,) violation probabilities.
        constrained: (C,) the same under the truth.
    """
    table = pd.DataFrame(
        {
            "trial": -1 if trial is None else trial,
            "hypothesis": np.arange(len(unconstrained)),
            "unconstrained": unconstrained,
            "constrained": constrained,
        }
    )
    return table if trial is not None else table.head(0)
