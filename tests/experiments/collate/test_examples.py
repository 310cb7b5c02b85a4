"""The small tables of examples: which points and which trial they show, and what of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hand_made import hand_made

from experiments.collate.examples import FIRST, example_tables
from experiments.collate.finished import CollateError, FinishedPoint
from experiments.point import tables as point_tables
from mlci.grids import Grid
from mlci.spaces import Box, StateSpace

TRIALS = (0, 3, 4, 7, 8, 9, 12)  # of the demonstrations that were kept
TIMES = np.arange(8) * 0.15
SPACE = StateSpace(
    Box(np.array([0.0, -3.0]), np.array([2 * np.pi, 3.0])),
    periodic=np.array([True, False]),
    names=("angle", "speed"),
    units=("rad", "rad/s"),
)


def tables(feasible: Sequence[int] = TRIALS, trial: int | None = 4) -> dict[str, pd.DataFrame]:
    """What a point writes, with two hypotheses; `trial` is the one of `probabilities`."""
    hypotheses = pd.DataFrame({"hypothesis": [0, 1], "lower_angle": [0.0, np.pi]})
    hypotheses = hypotheses.assign(
        lower_speed=-np.inf, upper_angle=[np.pi, 2 * np.pi], upper_speed=np.inf, rank=[2.0, 1.0]
    )
    times, count = np.tile(TIMES, len(TRIALS)), len(TIMES) * len(TRIALS)
    return {
        "trials": pd.DataFrame({"trial": TRIALS, "feasible": [t in feasible for t in TRIALS]}),
        "hypotheses": hypotheses,
        "first": hypotheses.assign(rank=[1.0, 2.0]),
        "probabilities": pd.DataFrame(
            {
                "trial": [] if trial is None else [trial] * 2,
                "hypothesis": [] if trial is None else [1, 0],
                "unconstrained": [] if trial is None else [0.1, 1 / 3],
                "constrained": [] if trial is None else [0.2, 0.4],
            }
        ),
        "sampled": pd.DataFrame(
            {
                "trial": np.repeat(list(feasible), 3),
                "step": [0, 1, 2] * len(feasible),
                "cell": [5, 6, 11] * len(feasible),
            }
        ),
        "violations": pd.DataFrame(
            {
                "trial": np.repeat(TRIALS, 2),
                "source": ["demonstration", "sampled"] * len(TRIALS),
                "hypothesis": [1, 0] * len(TRIALS),
            }
        ),
        "moves": pd.DataFrame({"cell": [5, 6], "action": [0, 1], "successor": [6, 11]}),
        "paths": pd.DataFrame(
            {
                "demonstration": np.repeat(TRIALS, len(TIMES)),
                "time": times,
                "angle": np.arange(count) / 7,
                "speed": -1 / 3,
            }
        ),
        "dimensions": pd.DataFrame(
            {
                "name": SPACE.names,
                "unit": SPACE.units,
                "lower": SPACE.bounds.lower,
                "upper": SPACE.bounds.upper,
                "periodic": SPACE.periodic,
            }
        ),
        "regions": pd.DataFrame({"region": [0], "lower_angle": [0.0], "upper_angle": [1.0]}),
    }


def point(results: Path, feasible: Sequence[int] = TRIALS, **values: Any) -> FinishedPoint:
    return FinishedPoint.read(hand_made(results, tables(feasible), **values))


def examples_of(
    points: Sequence[FinishedPoint],
    examples: dict[str, list[dict[str, Any]]],
    cases: dict[str, str] | None = None,
) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """The tables, and what is said of those that are missing."""
    messages: list[str] = []
    return example_tables(points, examples, cases or {}, messages.append), messages


def identities(table: pd.DataFrame) -> list[str]:
    return table["point"].unique().tolist()


@pytest.fixture
def points(tmp_path: Path) -> list[FinishedPoint]:
    """Two truths, two time steps."""
    return [
        point(tmp_path, truth__name=truth, dt=dt) for truth in ("c1", "c2") for dt in (0.25, 0.5)
    ]


@pytest.mark.parametrize(
    ("entry", "places"),
    [
        ({}, [0, 2]),
        ({"dt": 0.5}, [1, 3]),
        ({"dt": [0.5, 1.0]}, [1, 3]),
        ({"dt": 0.5, "cells": 12, "actions": 3, "samples": 1, "seed": 0}, [1, 3]),
        ({"temperature": 1, "tasks.crossing": False}, [0, 2]),
        ({"truth": "c2"}, [2]),
        ({"truth": ["c1", "c2"], "dt": 0.5}, [1, 3]),
        ({"case": "slow"}, [1, 3]),
    ],
)
def test_an_entry_chooses_a_point_a_truth(
    entry: dict[str, Any], places: list[int], points: list[FinishedPoint]
) -> None:
    cases = {points[1].identity: "slow", points[3].identity: "slow"}
    found, messages = examples_of(points, {"ranking": [entry]}, cases)
    assert identities(found["example_ranking"]) == [points[i].identity for i in places]
    assert not messages


def test_the_first_entry_with_a_point_counts(points: list[FinishedPoint]) -> None:
    entries: list[dict[str, Any]] = [{"dt": 2.0}, {"dt": 0.5, "truth": "c2"}, {"dt": 0.25}]
    found, messages = examples_of(points, {"ranking": entries})
    assert identities(found["example_ranking"]) == [points[0].identity, points[3].identity]
    assert not messages


@pytest.mark.parametrize(
    "entry", [{"dt": 2.0}, {"sed": 0}, {"temperature": "warm"}, {"actions": "3x3"}, {"case": "no"}]
)
def test_an_example_that_is_missing_is_told(
    entry: dict[str, Any], points: list[FinishedPoint]
) -> None:
    found, messages = examples_of(points, {"ranking": [entry, {"dt": 0.5, "truth": "c2"}]})
    assert identities(found["example_ranking"]) == [points[3].identity]
    assert messages == ["examples.ranking: no point of truth c1 is as named, so it shows none"]
    found, messages = examples_of(points, {"ranking": [entry]})
    assert not found
    assert len(messages) == 2


def test_an_unknown_kind_is_refused(points: list[FinishedPoint]) -> None:
    with pytest.raises(CollateError, match="examples: rankings: there are ranking, compared, fir"):
        examples_of(points, {"rankings": [{}]})


def test_ranking_shows_one_trial(points: list[FinishedPoint]) -> None:
    found, _ = examples_of(points[:1], {"ranking": [{}]})
    assert set(found) == {
        f"example_{name}"
        for name in ("ranking", "paths", "cells", "moves", "regions", "dimensions")
    }
    ranking = found["example_ranking"]
    assert ranking["rank"].tolist() == ["2.0", "1.0"]
    assert ranking["trial"].tolist() == ["4", "4"]
    assert ranking["unconstrained"].tolist() == [str(1 / 3), "0.1"]
    assert ranking["constrained"].tolist() == ["0.4", "0.2"]
    cells = found["example_cells"]
    assert cells[["trial", "cell"]].to_numpy().tolist() == [["4", "5"], ["4", "6"], ["4", "11"]]
    assert found["example_regions"]["upper_angle"].tolist() == ["1.0"]
    assert found["example_dimensions"]["name"].tolist() == ["angle", "speed"]


def test_ranking_without_a_trial_has_no_cells(tmp_path: Path) -> None:
    lonely = FinishedPoint.read(hand_made(tmp_path, tables(trial=None)))
    found, messages = examples_of([lonely], {"ranking": [{}]})
    assert not messages
    assert not len(found["example_cells"])
    assert found["example_ranking"]["unconstrained"].isna().all()


def test_paths_of_an_example_are_thinned_and_keep_their_ends(points: list[FinishedPoint]) -> None:
    found, _ = examples_of(points[:1], {"ranking": [{}]})
    paths = found["example_paths"]
    assert paths["demonstration"].unique().tolist() == [str(trial) for trial in TRIALS]
    one = paths[paths["demonstration"] == "3"]
    assert one["time"].tolist() == [0.0, 0.3, 0.6, 0.9, 1.05]
    assert one["angle"].tolist() == [round(i / 7, 4) for i in (8, 10, 12, 14, 15)]
    assert set(one["speed"]) == {-0.3333}


@pytest.mark.parametrize("offset", [None, [0.25, 0.0]])
def test_corners_of_cells_are_those_of_the_grid(offset: list[float] | None, tmp_path: Path) -> None:
    shifted = point(tmp_path, grid__offset=offset)
    moves = examples_of([shifted], {"ranking": [{}]})[0]["example_moves"]
    lower, upper = Grid(SPACE, (4, 3), tuple(offset or ())).corners
    for prefix, cells in (("", [5, 6]), ("successor_", [6, 11])):
        for side, corners in (("lower", lower), ("upper", upper)):
            names = [f"{prefix}{side}_{name}" for name in SPACE.names]
            np.testing.assert_array_equal(moves[names], corners[cells].round(6))


def test_compared_shows_one_trial_in_several_points(tmp_path: Path) -> None:
    coarse = point(tmp_path, feasible=(0, 4, 7))
    fine = point(tmp_path, feasible=(3, 4, 7), grid__shape=[6, 4])
    entry = {"cells": [12, 24]}
    for trial, shown in ((None, "4"), (7, "7"), ({"wall": 7}, "7"), ({"c1": 7}, "4")):
        found, messages = examples_of([coarse, fine], {"compared": [{**entry, "trial": trial}]})
        assert not messages
        assert identities(found["compared_cells"]) == [coarse.identity, fine.identity]
        assert found["compared_cells"]["cells"].unique().tolist() == ["12", "24"]
        assert set(found["compared_cells"]["trial"]) == {shown}
        assert set(found["compared_paths"]["demonstration"]) == {shown}
        assert len(found["compared_paths"]) == len(TIMES)
        violations = found["compared_violations"]
        assert violations["source"].tolist() == ["demonstration", "sampled"] * 2
        assert violations["lower_angle"].tolist() == [3.141593, 0.0] * 2
    # Neither can be followed in both.
    for trial in (0, 3):
        found, messages = examples_of([coarse, fine], {"compared": [{**entry, "trial": trial}]})
        assert not found
        assert messages == [
            "examples.compared: no point of truth wall is as named, so it shows none"
        ]


def test_compared_falls_back_where_no_trial_can_be_followed(tmp_path: Path) -> None:
    coarse = point(tmp_path, feasible=(0, 4))
    fine = point(tmp_path, feasible=(3, 7), grid__shape=[6, 4])
    found, _ = examples_of([coarse, fine], {"compared": [{}, {"cells": 24}]})
    assert identities(found["compared_cells"]) == [fine.identity]
    assert set(found["compared_cells"]["trial"]) == {"3"}


def test_first_shows_the_first_demonstrations_of_each_kind_of_tasks(tmp_path: Path) -> None:
    both = [point(tmp_path, tasks__crossing=crossing) for crossing in (False, True)]
    found, messages = examples_of(both[::-1], {"first": [{"seed": 0}]})
    assert not messages
    ranking = found["first_ranking"]
    assert ranking.columns[:2].tolist() == ["tasks.crossing", "point"]
    assert identities(ranking) == [one.identity for one in both]
    assert ranking["tasks.crossing"].tolist() == [False, False, True, True]
    assert ranking["rank"].tolist() == ["1.0", "2.0"] * 2
    first = ["0", "3", "4", "7", "8"]
    paths = found["first_paths"]
    assert paths["demonstration"].unique().tolist() == first
    assert len(paths) == 2 * 5 * len(TIMES)
    violations = found["first_violations"]
    assert violations["trial"].tolist() == first * 2
    assert set(violations["source"]) == {"demonstration"}
    assert set(violations["upper_angle"]) == {6.283185}
    found, messages = examples_of(both, {"first": [{"tasks.crossing": True}]})
    assert identities(found["first_ranking"]) == [both[1].identity]
    assert not messages


def test_first_demonstrations_are_those_that_points_rank() -> None:
    assert FIRST == point_tables.FIRST
