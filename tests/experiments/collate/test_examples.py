"""The small tables of examples: which points and which trial they show, and what of them."""

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest
from tiny_point import computed, planned

from experiments.collate import examples
from experiments.collate.examples import example_tables
from experiments.collate.settings_of import settings_of
from experiments.config.settings import GridSettings, Region, Settings, TruthSettings
from experiments.tracking.points import Point
from mlci.grids import Grid

SHAPES = [(12, 8), (24, 12), (30, 30)]


def grid_of(settings: Settings, shape: tuple[int, ...]) -> GridSettings:
    return dataclasses.replace(settings.grid, shape=shape)


@pytest.fixture(scope="module")
def points(settings: Settings, tmp_path_factory: pytest.TempPathFactory) -> list[Point]:
    """Two time steps in three grids, and another seed in one of them."""
    results = tmp_path_factory.mktemp("results")
    more = dataclasses.replace(settings.demonstrations, pairs=20, keep=8)
    settings = dataclasses.replace(settings, horizon=4.0, demonstrations=more)
    found = [
        computed(
            dataclasses.replace(settings, grid=grid_of(settings, shape), dt=dt, seed=seed), results
        )
        for shape in SHAPES
        for dt in (0.25, 0.5)
        for seed in ((0, 1) if shape == (24, 12) else (0,))
    ]
    return found


def values(point: Point) -> tuple[tuple[int, ...], float, int]:
    """Grid, time step and seed of a point."""
    settings = settings_of(point)
    return settings.grid.shape, settings.dt, settings.seed


def table_of(point: Point, name: str) -> pd.DataFrame:
    return pd.read_csv(point.folder / f"{name}.csv")


def test_example_is_the_point_nearest_to_the_papers(
    points: list[Point], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(examples, "_PATH_EVERY", 3)  # leaves out the last of 17 samples
    tables = example_tables(points)
    (example,) = (p for p in points if values(p) == ((24, 12), 0.25, 0))
    ranking = tables["example_ranking"]
    assert set(ranking["point"]) == {example.identity}
    own = table_of(example, "hypotheses")
    pd.testing.assert_frame_equal(ranking[list(own.columns)], own)
    phi = table_of(example, "probabilities")
    np.testing.assert_array_equal(ranking["unconstrained"], phi["unconstrained"])
    assert set(ranking["trial"]) == set(phi["trial"])
    visits = table_of(example, "sampled")
    visits = visits[visits["trial"] == phi["trial"].iloc[0]]
    assert tables["example_cells"]["cell"].tolist() == visits["cell"].tolist()
    assert set(tables["example_moves"]["cell"]) == set(visits["cell"])
    paths, shown = table_of(example, "paths"), tables["example_paths"]
    ends = [(path["time"].min(), path["time"].max()) for _, path in paths.groupby("demonstration")]
    assert ends == [(p["time"].min(), p["time"].max()) for _, p in shown.groupby("demonstration")]
    assert len(shown) / len(paths) == 7 / 17
    every = paths.merge(shown, on=["demonstration", "time"], suffixes=("", "_shown"))
    assert len(every) == len(shown)
    np.testing.assert_allclose(every["position"], every["position_shown"], atol=5.1e-5)


def test_cells_and_moves_have_their_corners(points: list[Point]) -> None:
    tables = example_tables(points)
    space = settings_of(points[0]).model.space
    cells = tables["example_cells"]
    grid = Grid(space, (24, 12))
    sides = [[f"{side}_{name}" for name in space.names] for side in ("lower", "upper")]
    centres = (cells[sides[0]].to_numpy() + cells[sides[1]].to_numpy()) / 2
    np.testing.assert_array_equal(grid.index(centres), cells["cell"])
    moves = tables["example_moves"]
    sides = [[f"successor_{name}" for name in names] for names in sides]
    centres = (moves[sides[0]].to_numpy() + moves[sides[1]].to_numpy()) / 2
    np.testing.assert_array_equal(grid.index(centres), moves["successor"])


def test_compared_trial_is_feasible_in_all_grids_and_passes_nearest(points: list[Point]) -> None:
    tables = example_tables(points)
    visits = tables["compared_cells"]
    alike = [point for point in points if point.identity in set(visits["point"])]
    assert [settings_of(point).grid.shape for point in alike] == [SHAPES[0], SHAPES[2]]
    assert {settings_of(point).seed for point in alike} == {0}
    assert visits["cells"].unique().tolist() == [
        math.prod(settings_of(p).grid.shape) for p in alike
    ]
    feasible = set.intersection(
        *(set(t["trial"][t["feasible"]]) for t in (table_of(p, "trials") for p in alike))
    )
    (trial,) = visits["trial"].unique()
    assert trial in feasible
    paths = table_of(alike[0], "paths")
    # The wall is a band of positions: how far a path stays away from its nearer side.
    gaps = {
        number: np.maximum(0.6 - path["position"], path["position"] - 1.2).min()
        for number, path in paths.groupby("demonstration")
        if number in feasible
    }
    assert len(gaps) > 1
    assert min(gaps, key=lambda number: gaps[number]) == trial
    assert set(tables["compared_paths"]["demonstration"]) == {trial}
    violations = tables["compared_violations"]
    for point in alike:
        own = table_of(point, "violations")
        shown = violations[violations["cells"] == math.prod(settings_of(point).grid.shape)]
        columns = ["trial", "source", "hypothesis"]
        expected = own[own["trial"] == trial][columns].to_numpy().tolist()
        assert expected
        assert shown[columns].to_numpy().tolist() == expected


def test_time_step_is_one_at_which_nearly_all_can_be_followed(
    points: list[Point], monkeypatch: pytest.MonkeyPatch
) -> None:
    def dts() -> set[float]:
        return set(example_tables(points)["compared_cells"]["dt"])

    counts = {
        dt: min(
            int(table_of(p, "trials")["feasible"].sum())
            for p in points
            if settings_of(p).dt == dt and settings_of(p).grid.shape != SHAPES[1]
        )
        for dt in (0.25, 0.5)
    }
    assert 0 < counts[0.25] < counts[0.5]
    assert dts() == {0.5}
    monkeypatch.setattr(examples, "_ENOUGH", 0.0)
    assert dts() == {0.25}
    (trial,) = example_tables(points)["compared_cells"]["trial"].unique()
    for point in points:
        if settings_of(point).dt == 0.25 and settings_of(point).grid.shape != SHAPES[1]:
            trials = table_of(point, "trials").set_index("trial")
            assert trials["feasible"][trial]


def test_order_of_points_does_not_matter_and_truths_stand_apart(points: list[Point]) -> None:
    one, two = example_tables(points), example_tables(points[::-1])
    for name, table in one.items():
        pd.testing.assert_frame_equal(table, two[name])


def test_example_has_the_settings_of_most_points(points: list[Point]) -> None:
    own, results = settings_of(points[0]), points[0].results
    cold = computed(dataclasses.replace(own, temperature=0.5), results)
    often = computed(dataclasses.replace(own, rollouts=2), results)
    # All are equally near; temperature 0.5 comes first in tables.
    for order in ([cold, points[0], often], [often, points[0], cold]):
        assert set(example_tables(order)["example_ranking"]["point"]) == {points[0].identity}


def test_first_are_those_of_the_point_with_the_settings_of_most(points: list[Point]) -> None:
    def point(dt: float) -> Point:
        wanted = SHAPES[1], dt, 0
        (found,) = (p for p in points if values(p) == wanted)
        return found

    near, usual = point(0.25), point(0.5)
    most = [p for p in points if settings_of(p).dt == 0.5 or settings_of(p).seed == 1]
    tables = example_tables([near, *most])
    assert set(tables["example_ranking"]["point"]) == {near.identity}
    ranking = tables["first_ranking"]
    assert ranking.columns[:2].tolist() == ["tasks.crossing", "point"]
    assert set(ranking["point"]) == {usual.identity}
    assert set(ranking["tasks.crossing"]) == {False}
    own = table_of(usual, "first")
    pd.testing.assert_frame_equal(ranking[list(own.columns)], own)
    trials = table_of(usual, "trials")["trial"]
    assert len(trials) > 5
    first = sorted(trials)[:5]
    paths = table_of(usual, "paths")
    paths = paths[paths["demonstration"].isin(first)].reset_index(drop=True)
    assert paths["demonstration"].unique().tolist() == first
    found = tables["first_paths"].drop(columns="tasks.crossing")
    pd.testing.assert_frame_equal(found, paths, check_exact=False, atol=5.1e-5, rtol=0)


def test_first_violations_are_those_of_demonstrations_with_corners(points: list[Point]) -> None:
    tables = example_tables([point for point in points if settings_of(point).dt == 0.5])
    violations, shown = tables["first_violations"], set(tables["first_ranking"]["point"])
    (usual,) = (point for point in points if point.identity in shown)
    own = table_of(usual, "violations")
    first = sorted(table_of(usual, "trials")["trial"])[:5]
    of_first = own[own["trial"].isin(first)]
    assert set(of_first["source"]) == {"demonstration", "sampled"}
    kept = of_first[of_first["source"] == "demonstration"]
    assert set(kept["trial"]) == set(first)
    columns = ["trial", "source", "hypothesis"]
    assert violations[columns].to_numpy().tolist() == kept[columns].to_numpy().tolist()
    # Ten hypotheses of 0.6 m from -3 m on.
    np.testing.assert_allclose(violations["lower_position"], 0.6 * violations["hypothesis"] - 3)
    np.testing.assert_allclose(violations["upper_position"], 0.6 * violations["hypothesis"] - 2.4)
    counts = kept.groupby("hypothesis").size()
    ranking = table_of(usual, "first").set_index("hypothesis")["violating_demonstrations"]
    assert counts.to_dict() == ranking[ranking > 0].to_dict()


def test_each_kind_of_tasks_has_a_first_ranking(points: list[Point]) -> None:
    settings, results = settings_of(points[0]), points[0].results
    box = Region((-0.6, -0.2), (0.0, 0.6))  # a mass can pass it on either side
    plain = dataclasses.replace(settings, truth=TruthSettings("box", (box,), None))
    tasks = dataclasses.replace(plain.tasks, crossing=True)
    crossing = dataclasses.replace(plain, tasks=tasks)
    cold = dataclasses.replace(crossing, temperature=0.5)
    made = [computed(each, results) for each in (plain, crossing, cold)]
    kept = [sorted(table_of(point, "trials")["trial"]) for point in made[:2]]
    assert kept[0] != kept[1]
    for order in (made, made[::-1]):
        tables = example_tables(order)
        parts = [tables[f"first_{name}"] for name in ("ranking", "paths", "violations")]
        for point, trials, kind in zip(made, kept, (False, True), strict=False):
            ranking, paths, violations = (part[part["tasks.crossing"] == kind] for part in parts)
            assert set(ranking["point"]) == {point.identity}
            assert paths["demonstration"].unique().tolist() == trials[:5]
            assert set(violations["trial"]) == set(trials[:5])


def test_many_truths_have_no_examples(points: list[Point]) -> None:
    settings = settings_of(points[0])
    named = [
        planned(
            dataclasses.replace(settings, truth=dataclasses.replace(settings.truth, name=name)),
            points[0].results,
        )
        for name in "abcde"
    ]
    assert example_tables(named) == {}
