"""What each figure of the paper draws and says, against tables whose numbers are known."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from figure_study import POINTS, study_tables
from matplotlib.axes import Axes
from matplotlib.collections import Collection, PatchCollection
from matplotlib.colors import to_hex
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from paper_figures import (
    final_state_error,
    hypothesis_map,
    overview,
    rank_curve,
    sampled_trajectories,
    state_space,
    violation_distance,
)
from paper_figures.rows import Unsuited
from paper_figures.style import CELL_COLOURS, CELL_MARKS, DEMONSTRATION, GOAL, SAMPLED, START, TRUTH

Drawn = Callable[[ModuleType], Figure]
TablesFor = Callable[[ModuleType], dict[str, pd.DataFrame]]


def corners(boxes: pd.DataFrame, prefix: str = "") -> np.ndarray:
    """(N, 4) lower and upper corners of the first two dimensions of a table."""
    names = [
        name.removeprefix(f"{prefix}lower_") for name in boxes if name.startswith(f"{prefix}l")
    ]
    return boxes[
        [f"{prefix}{side}_{d}" for side in ("lower", "upper") for d in names[:2]]
    ].to_numpy()


def extent(collection: Collection) -> np.ndarray:
    """(N, 4) lower and upper corners of the boxes of a collection."""
    vertices = [path.vertices for path in collection.get_paths()]
    return np.array([[*each.min(axis=0), *each.max(axis=0)] for each in vertices]).reshape(-1, 4)


def boxes(axes: Axes) -> list[PatchCollection]:
    return [each for each in axes.collections if isinstance(each, PatchCollection)]


def assert_curves(axes: Axes, rows: pd.DataFrame) -> None:
    """A panel's bars, marks and colours are those of a measure's rows."""
    bars = [each for each in axes.containers if isinstance(each, ErrorbarContainer)]
    seen = []
    for bar in bars:
        line, _, (segments,) = bar.lines
        colour = to_hex(line.get_color())
        (cells,) = (cells for cells, each in CELL_COLOURS.items() if each == colour)
        assert line.get_marker() == CELL_MARKS[cells]
        for x, y, segment in zip(*line.get_data(), segments.get_segments(), strict=True):
            near = rows[(rows["cells"] == cells) & (np.abs(rows["dt"] / x - 1) < 0.05)]
            (row,) = near.itertuples()
            seen.append(row.Index)
            assert y == pytest.approx(row.mean, nan_ok=True)
            there = [row.low, row.high] if not np.isnan(row.mean) else []
            assert segment.reshape(-1, 2)[:, 1].tolist() == pytest.approx(there)
            assert (line.get_alpha() < 1) == (row.reachable < 0.5)
        low, high = axes.get_ylim()
        assert low == 0
        assert high > rows["high"][rows["cells"] == cells].max()
    assert sorted(seen) == sorted(rows.index)
    for line in axes.lines:
        if line.get_label().endswith(" cells"):
            of_line = rows[rows["cells"] == int(line.get_label().split()[0])]
            joined = of_line["mean"].where(of_line["reachable"] >= 0.5)
            np.testing.assert_allclose(line.get_ydata(), joined)


def rows_of(measure: str) -> pd.DataFrame:
    """Rows of one measure with 9 actions, and the share of goals reached beside them."""
    table = study_tables()["measures"]
    table = table[(table["actions"] == 9) & (table["samples"] == 1)]
    share = table[table["measure"] == "reachable"].rename(columns={"mean": "reachable"})
    keys = ["truth", "cells", "dt"]
    return table[table["measure"] == measure].merge(share[[*keys, "reachable"]], on=keys)


def test_final_state_error_is_the_measure_with_its_interval(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    figure, rows = drawn(final_state_error), rows_of("final_state_error")
    for axes, (truth, part) in zip(figure.axes, rows.groupby("truth"), strict=True):
        assert axes.get_title(loc="left") == f"truth {truth.upper()}"
        assert_curves(axes, part)
    assert figure.get_supylabel() == "final-state error [share of the ranges]"
    assert figure.axes[-1].get_xlabel() == "$\\Delta t$ [s]"
    said = final_state_error.facts(**tables_for(final_state_error)).splitlines()
    for row in rows.itertuples():
        start = f"  {row.truth.upper()}, {row.cells} cells, dt {row.dt:g} s: "
        (line,) = (line for line in said if line.startswith(start))
        value = f"{row.mean:.3g} of the ranges ({row.low:.3g} to {row.high:.3g})"
        expected = "no value" if np.isnan(row.mean) else value
        assert line == f"{start}{expected}; goals reached {100 * row.reachable:.0f} %"


def test_violation_distance_floor_and_pooled_have_panels(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    figure = drawn(violation_distance)
    panels = iter(figure.axes)
    said = violation_distance.facts(**tables_for(violation_distance))
    for measure in ("violation_distance", "violation_floor", "violation_distance_pooled"):
        rows = rows_of(measure)
        for truth, part in rows.groupby("truth"):
            axes = next(panels)
            assert axes.get_title(loc="left").startswith(f"truth {truth.upper()}, ")
            assert_curves(axes, part)
        last = rows.dropna(subset="mean").iloc[-1]
        assert f"{last['mean']:.3g} ({last['low']:.3g} to {last['high']:.3g})" in said
    assert next(panels, None) is None
    assert figure.axes[0].get_ylabel() == "distance [regions]"


def test_rank_curves_are_the_medians_and_bands_of_the_table(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    table = study_tables()["rank_curve"]
    wanted = table[(table["actions"] == 9) & (table["samples"] == 1)]
    figure = drawn(rank_curve)
    truths, dts = sorted(set(wanted["truth"])), sorted(set(wanted["dt"]))
    grid = np.array(figure.axes).reshape(len(truths), len(dts))
    for (truth, dt), part in wanted.groupby(["truth", "dt"]):
        axes = grid[truths.index(truth), dts.index(dt)]
        assert axes.get_title(loc="left") == f"{truth.upper()}, $\\Delta t$ = {dt:g} s"
        assert axes.get_yscale() == "log"
        for place, (cells, rows) in enumerate(part.groupby("cells")):
            curve = axes.lines[place]
            np.testing.assert_allclose(curve.get_ydata(), rows["median"])
            np.testing.assert_allclose(curve.get_xdata(), rows["demonstrations"])
            assert curve.get_marker() == CELL_MARKS[cells]
            assert to_hex(curve.get_color()) == CELL_COLOURS[cells]
            edges = axes.collections[place].get_paths()[0].vertices
            ends = zip(rows["demonstrations"], rows["q25"], rows["q75"], strict=True)
            for x, least, most in ends:
                at = edges[edges[:, 0] == x, 1]
                assert (at.min(), at.max()) == pytest.approx((least, most))
    assert {axes.get_ylabel() for axes in grid[:, 0]} == {"rank of truth"}
    assert {axes.get_xlabel() for axes in grid[-1]} == {"demonstrations"}
    said = f"{rank_curve.facts(table)}\n"
    at = min(9, wanted["demonstrations"].max())
    for row in wanted[wanted["demonstrations"] == at].itertuples():
        assert (
            f"{row.truth.upper()}, {row.cells} cells, dt {row.dt:g} s: median rank "
            f"{row.median:.3g} ({row.median_low:.3g} to {row.median_high:.3g}), in the top 5 "
            f"{100 * row.share_top_5:.0f} % ({100 * row.share_top_5_low:.0f} to "
            f"{100 * row.share_top_5_high:.0f})\n"
        ) in said


def test_rank_curves_have_at_most_ten_panels_and_name_the_time_steps_that_have_none(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    table = study_tables()["rank_curve"]
    table = table[(table["actions"] == 9) & (table["samples"] == 1)]
    one = table[table["dt"] == table["dt"].min()]
    steps = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    many = pd.concat([one.assign(dt=dt) for dt in steps])
    figure = rank_curve.draw(many)
    plt.close(figure)
    titles = [axes.get_title(loc="left").rpartition("= ")[2] for axes in figure.axes]
    assert titles == 2 * ["0.1 s", "0.3 s", "0.4 s", "0.5 s", "0.7 s"]
    assert "No panel has room for dt 0.2, 0.6 s." in rank_curve.facts(many)
    assert "No panel" not in rank_curve.facts(table)


def test_state_space_has_all_hypotheses_and_both_truths(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables, figure = tables_for(state_space), drawn(state_space)
    axes = figure.axes[0]
    one = tables["example_ranking"][tables["example_ranking"]["truth"] == "c1"]
    (hypotheses,) = boxes(axes)
    np.testing.assert_allclose(extent(hypotheses), corners(one))
    found = {text.get_text(): text.get_position() for text in axes.texts}
    for row, box in zip(
        tables["example_regions"].itertuples(), corners(tables["example_regions"]), strict=True
    ):
        inside = [
            patch for patch in axes.patches if patch.get_xy() == pytest.approx(tuple(box[:2]))
        ]
        assert inside[0].get_width() == pytest.approx(box[2] - box[0])
        assert row.truth.upper() in found
    assert set(axes.get_xlim()) == set(tables["example_dimensions"].iloc[0][["lower", "upper"]])
    said = state_space.facts(**tables)
    assert f"Hypotheses: {len(one)}." in said
    low, high = corners(tables["example_regions"])[0].reshape(2, 2)
    assert f"{low[0]:.6g} to {high[0]:.6g} rad, " in said
    assert f"{low[1]:.6g} to {high[1]:.6g} rad/s." in said


def test_a_truth_that_leaves_the_circle_comes_back_on_the_other_side(drawn: Drawn) -> None:
    patches = drawn(state_space).axes[0].patches
    lefts = sorted(patch.get_x() for patch in patches if patch.get_height() == 1.0)
    assert lefts == pytest.approx([5.5 - 2 * np.pi, 5.5])


def test_trajectories_show_visited_cells_and_violations(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables, figure = tables_for(sampled_trajectories), drawn(sampled_trajectories)
    visits, violations = tables["compared_cells"], tables["compared_violations"]
    panels = visits.groupby(["truth", "cells"])
    said = sampled_trajectories.facts(**tables)
    for axes, ((truth, cells), visited) in zip(figure.axes, panels, strict=True):
        title = f"{truth.upper()}, {cells} cells, $\\Delta t$ = {visited['dt'].iloc[0]:g} s"
        assert axes.get_title(loc="left") == title
        _, shaded, *hatched = boxes(axes)
        assert to_hex(shaded.get_facecolor()[0]) == SAMPLED
        np.testing.assert_allclose(extent(shaded), corners(visited.drop_duplicates("cell")))
        of_panel = violations[(violations["truth"] == truth) & (violations["cells"] == cells)]
        for source, colour, collection in zip(
            ("demonstration", "sampled"), (DEMONSTRATION, SAMPLED), hatched, strict=True
        ):
            expected = of_panel[of_panel["source"] == source]
            np.testing.assert_allclose(extent(collection), corners(expected))
            assert collection.get_hatch()
            assert to_hex(collection.get_edgecolor()[0]) == colour
        assert hatched[0].get_hatch() != hatched[1].get_hatch()
        path = tables["compared_paths"][tables["compared_paths"]["truth"] == truth]
        line = axes.lines[0].get_xydata()
        names = tables["example_dimensions"]["name"].iloc[:2]
        there = line[~np.isnan(line).any(axis=1)]
        np.testing.assert_allclose(there[:, 0], path[names[0]] % (2 * np.pi), atol=1e-12)
        np.testing.assert_allclose(there[:, 1], path[names[1]])
        ends = visited.sort_values("step").iloc[[0, -1]]
        outlines = {to_hex(patch.get_edgecolor()): patch.get_xy() for patch in axes.patches}
        assert outlines[START] == pytest.approx(corners(ends)[0, :2])
        assert outlines[GOAL] == pytest.approx(corners(ends)[1, :2])
        assert f"{visited['cell'].nunique()} cells visited" in said


def test_facts_count_the_violations_of_each_and_of_both(tables_for: TablesFor) -> None:
    said = sampled_trajectories.facts(**tables_for(sampled_trajectories))
    assert (
        "C2, 1600 cells, 9 actions, dt 0.5 s, trial 1: 3 cells visited; hypotheses violated by the "
        f"demonstration 2, by the trajectory 2, by both 1 (point {'3' * 32})."
    ) in said


def test_no_trial_that_all_grids_can_follow_makes_no_figure(tables_for: TablesFor) -> None:
    tables = tables_for(sampled_trajectories)
    tables["compared_cells"] = tables["compared_cells"].head(0)
    with pytest.raises(Unsuited, match="no demonstration is feasible in all grids"):
        sampled_trajectories.draw(**tables)
    tables = tables_for(overview)
    tables["example_cells"] = tables["example_cells"].head(0)
    with pytest.raises(Unsuited, match="no demonstration of the example is feasible"):
        overview.draw(**tables)


def test_overview_is_one_run_from_demonstrations_to_ranks(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables, figure = tables_for(overview), drawn(overview)
    shown, moves, chances, ranks = figure.axes[:4]
    of_c1 = {name: table[table["truth"] == "c1"] for name, table in tables.items()}
    ranking, visits = of_c1["example_ranking"], of_c1["example_cells"]
    count = of_c1["example_paths"]["demonstration"].nunique()
    assert len(shown.lines) == min(15, count) + 1  # and the trial once more
    trial = visits["trial"].iloc[0]
    path = (
        of_c1["example_paths"]
        .query(f"demonstration == {trial}")[["angle", "speed"]]
        .to_numpy(copy=True)
    )
    path[:, 0] %= 2 * np.pi
    thick = shown.lines[-1].get_xydata()
    np.testing.assert_allclose(thick[~np.isnan(thick).any(axis=1)], path)
    ends = [line.get_xydata()[0] for line in chances.lines]
    np.testing.assert_allclose(ends, path[[0, -1]])
    assert [line.get_marker() for line in chances.lines] == ["o", "s"]
    for axes in figure.axes[:4]:
        assert axes.get_xlabel() == "angle [rad]"
    assert [axes.get_ylabel() for axes in figure.axes[:4]] == ["speed [rad/s]"] * 2 + [""] * 2
    bars = [(bar.get_xlabel(), bar.get_xticklabels()) for bar in figure.axes[4:]]
    assert [(label, [tick.get_text() for tick in ticks]) for label, ticks in bars] == [
        ("$\\Phi_i$ of one trial", ["0", "0.5", "1"]),
        ("gain $L_i$,\nsquare-root scale [nat]", ["0", "1.5", "6"]),
    ]
    (legend,) = figure.legends
    meanings = {"demonstration of the trial", "start", "goal", "true constraint"}
    assert meanings < {text.get_text() for text in legend.get_texts()}
    (coloured,) = boxes(chances)
    np.testing.assert_allclose(coloured.get_array(), ranking["unconstrained"])
    np.testing.assert_allclose(extent(coloured), corners(ranking))
    assert coloured.get_clim() == (0, 1)
    _, gains = boxes(ranks)
    feasible = ranking[ranking["feasible"]]
    np.testing.assert_allclose(np.square(gains.get_array()), feasible["gain"], rtol=1e-12)
    np.testing.assert_allclose(extent(gains), corners(feasible))
    best = feasible[(feasible["rank"] <= 5) & (feasible["gain"] > 0)]
    assert [text.get_text() for text in ranks.texts] == [f"{rank:g}" for rank in best["rank"]]
    first = visits.sort_values("step").head(6)
    shaded = [patch for patch in moves.patches if to_hex(patch.get_facecolor()) == SAMPLED]
    assert len(shaded) == first["cell"].nunique()
    every = of_c1["example_moves"]
    away = every[every["cell"].isin(first["cell"]) & (every["cell"] != every["successor"])]
    taken = (first["cell"].to_numpy()[1:] != first["cell"].to_numpy()[:-1]).sum()
    arrows = len(away.drop_duplicates(["cell", "successor"])) + taken
    assert len(moves.texts) == arrows
    said = overview.facts(**tables)
    truth = ranking[ranking["covered_by_truth"]].iloc[0]
    assert f"Rank of hypothesis {truth['hypothesis']}, inside the truth: {truth['rank']:g}" in said
    assert f"Phi in panel 3 {truth['unconstrained']:.3g}" in said


def test_moves_past_a_whole_turn_stay_short(drawn: Drawn) -> None:
    moves = drawn(overview).axes[1]
    columns = np.array([(arrow.xyann[0], arrow.xy[0]) for arrow in moves.texts]) / (np.pi / 2)
    # Four columns make a turn; 13 to 14, 14 to 2, and 2 to 6 and 7 go from the last to the second.
    expected = [[3.5, 3.5]] * 2 + [[3.5, 4.5]] * 2 + [[4.5, 5.5]] * 2
    np.testing.assert_allclose(sorted(columns.tolist()), expected)
    assert np.array(moves.get_xlim()) / (np.pi / 2) == pytest.approx([2.5, 6.5])


def test_hypothesis_map_shows_what_the_table_says(drawn: Drawn, tables_for: TablesFor) -> None:
    tables, figure = tables_for(hypothesis_map), drawn(hypothesis_map)
    ranking = tables["example_ranking"]
    axes, bar = figure.axes
    assert bar.get_ylabel() == "likelihood gain $L_i$, square-root scale [nat]"
    np.testing.assert_allclose(bar.get_yticks() ** 2, [0, 6 / 16, 6 / 4, 6 * 9 / 16, 6])
    ticks = [float(text.get_text()) for text in bar.get_yticklabels()]
    np.testing.assert_allclose(ticks, bar.get_yticks() ** 2, rtol=0.05)
    feasible, violated = boxes(axes)
    kept = ranking[ranking["feasible"]]
    np.testing.assert_allclose(np.square(feasible.get_array()), kept["gain"], rtol=1e-12)
    np.testing.assert_allclose(extent(feasible), corners(kept))
    np.testing.assert_allclose(extent(violated), corners(ranking[~ranking["feasible"]]))
    outlines = {to_hex(patch.get_edgecolor()): patch.get_xy() for patch in axes.patches}
    (truth,) = corners(ranking[ranking["covered_by_truth"]])
    assert outlines[TRUTH] == pytest.approx(tuple(truth[:2]))
    best = kept[(kept["rank"] <= 5) & (kept["gain"] > 0)]
    assert [text.get_text() for text in axes.texts] == [f"{rank:g}" for rank in best["rank"]]
    x, y = tables["example_dimensions"].iloc[:2].itertuples()
    assert axes.get_xlabel() == f"{x.name.replace('_', ' ')} [{x.unit}]"
    assert axes.get_ylabel() == f"{y.name.replace('_', ' ')} [{y.unit}]"
    said = hypothesis_map.facts(**tables)
    assert f"violates {(~ranking['feasible']).sum()}." in said
    assert f"Demonstrations: {tables['example_paths']['demonstration'].nunique()}." in said
    first = ranking.sort_values("rank").iloc[0]
    assert f"Rank 1: hypothesis {first['hypothesis']}, gain {first['gain']:.3g} nat" in said


def test_map_names_what_is_unavoidable(tables_for: TablesFor) -> None:
    tables = tables_for(hypothesis_map)
    ranking = tables["example_ranking"]
    infinite = ranking["rank"] == 1
    missing = ranking.assign(gain=ranking["gain"].mask(infinite))
    figure = hypothesis_map.draw(**{**tables, "example_ranking": missing})
    _, _, unavoidable = boxes(figure.axes[0])
    np.testing.assert_allclose(extent(unavoidable), corners(ranking[infinite]))
    assert "unavoidable" in [text.get_text() for text in figure.legends[0].get_texts()]
    said = hypothesis_map.facts(**{**tables, "example_ranking": missing})
    assert f"Rank 1: hypothesis {ranking['hypothesis'][infinite].iloc[0]}, unavoidable" in said


def test_map_says_which_point_it_is() -> None:
    tables = {name: study_tables()[name].query("truth == 'c2'") for name in hypothesis_map.TABLES}
    point = f"Point {POINTS['c2']}: truth C2, 400 cells, 9 actions, dt = 0.25 s."
    assert point in hypothesis_map.facts(**tables)
