"""What the figures of the studies of choices draw, against the tables that they were given."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pandas as pd
import pytest
from choice_studies import (
    FIRST_POINTS,
    KINDS,
    LIMITS,
    SUCCESS_CASES,
    belief_tables,
    choice_effect_tables,
    forecast_tables,
    start_point_tables,
)
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, PolyCollection
from matplotlib.colors import to_hex
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure

from paper_figures import (
    calibration_diagram,
    choice_effects,
    forecast_diagram,
    start_points,
    success,
    success_cases,
)
from paper_figures.rows import Unsuited
from paper_figures.style import CELL_COLOURS, CELL_MARKS, DEMONSTRATION, SAMPLED, STEP_MARKS, TRUTH

Drawn = Callable[[ModuleType], Figure]
TablesFor = Callable[[ModuleType], dict[str, pd.DataFrame]]

MEAN = ["mean", "low", "high"]


def bars(axes: Axes, label: str) -> np.ndarray:
    """Marks (x, y) and ends (low, high) of the error bars of a label, in the axes' first sense."""
    return marks_and_ends(bars_of(axes, label))


def bars_of(axes: Axes, label: str) -> ErrorbarContainer:
    (container,) = (each for each in axes.containers if each.get_label() == label)
    return container


def marks_and_ends(container: ErrorbarContainer) -> np.ndarray:
    line, _, (lines,) = container
    ends = np.array(lines.get_segments(), dtype=float)
    along = 0 if np.ptp(ends[0, :, 0]) > 0 else 1
    marks = [np.asarray(data, dtype=float) for data in (line.get_xdata(), line.get_ydata())]
    return np.column_stack([*marks, ends[:, 0, along], ends[:, 1, along]])


def test_choice_effects_draw_each_case_with_its_interval(drawn: Drawn) -> None:
    tables, figure = choice_effect_tables(), drawn(choice_effects)
    rank, top, error, distance = figure.axes
    assert [text.get_text() for text in rank.get_yticklabels()] == [
        "default",
        "more",
        "temperature: 2",
    ]
    curve = tables["rank_curve"].query("demonstrations == 9")
    measures = tables["measures"]
    checked = 0
    for cells, dt in ((100, 0.25), (400, 0.25), (400, 0.5)):
        label = f"{cells} cells, $\\Delta t$ = {dt:g} s"
        of_series = [(1, cells, 0), (2, cells, 2)]
        if (cells, dt) == (400, 0.25):  # the case on 420 cells takes their place
            of_series.insert(1, (1, 420, 1))
        key = "temperature == {} and cells == {} and dt == {}"
        for axes, table, columns, factor in (
            (rank, curve, ["median", "median_low", "median_high"], 1),
            (top, curve, [f"share_top_5{end}" for end in LIMITS], 100),
            (error, measures.query("measure == 'final_state_error'"), MEAN, 1),
            (
                distance,
                measures.query("measure == 'violation_distance'"),
                MEAN,
                1,
            ),
        ):
            dots = bars(axes, label)
            dots = dots[np.argsort(dots[:, 1])]
            expected = [
                factor * table.query(key.format(t, c, dt))[columns].to_numpy()[0]
                for t, c, _ in of_series
            ]
            np.testing.assert_allclose(dots[:, [0, 2, 3]], expected)
            np.testing.assert_array_equal(np.round(dots[:, 1]), [line for *_, line in of_series])
            checked += len(expected)
        for axes, name in zip(figure.axes, ("median", "top", "error", "distance"), strict=True):
            colour = bars_of(axes, label)[0].get_color()
            dotted = [line for line in axes.lines if line.get_linestyle() == ":"]
            (x,) = {line.get_xdata()[0] for line in dotted if line.get_color() == colour}
            default = bars(axes, label)[np.round(bars(axes, label)[:, 1]) == 0]
            assert x == default[0, 0], name
    assert checked == 4 * 7
    assert [(axes.get_title(), axes.get_xlabel()) for axes in figure.axes] == [
        ("median rank", "rank of truth"),
        ("truth in the top 5", "subsets [%]"),
        ("final-state error", "error [of the ranges]"),
        ("violation distance", "distance [regions]"),
    ]
    styles = {each.get_label(): each[0] for each in rank.containers}
    first = styles["100 cells, $\\Delta t$ = 0.25 s"]
    assert (first.get_marker(), to_hex(first.get_color())) == (CELL_MARKS[100], CELL_COLOURS[100])
    assert len({line.get_marker() for line in styles.values()}) == 3


def test_choice_effects_say_every_number() -> None:
    tables = choice_effect_tables()
    lines = choice_effects.facts(**tables).splitlines()
    row = choice_effects.case_rows(**tables).iloc[-1]
    assert lines[-1].startswith("  temperature: 2, 400 cells, dt 0.5 s: ")
    numbers = {"rank": 1, "top": 100, "final_state_error": 1, "violation_distance": 1}
    for name, factor in numbers.items():
        values = [f"{factor * row[name + end]:.3g}" for end in LIMITS]
        assert "{} ({} to {})".format(*values) in lines[-1]
    assert len([line for line in lines if line.startswith("  ")]) == len(tables["cases"])


def test_choice_effects_need_a_default_and_one_row_a_case() -> None:
    tables = choice_effect_tables()
    other = {**tables, "cases": tables["cases"].assign(case="mine")}
    with pytest.raises(Unsuited, match="rows of one case differ in more than"):
        choice_effects.draw(**{**other, "cases": other["cases"].assign(case="default")})
    with pytest.raises(Unsuited, match="no case is named default"):
        choice_effects.draw(**other)


def test_start_points_draw_each_setting_with_its_interval(drawn: Drawn) -> None:
    tables, figure = start_point_tables(), drawn(start_points)
    panels = np.reshape(figure.axes, (2, 5))
    curve = tables["rank_curve"].query("demonstrations == 9")
    measures = tables["measures"]
    for row, truth in zip(panels, ("c1", "c2"), strict=True):
        sources = [
            (measures.query("measure == 'reachable'"), MEAN, 100),
            (measures.query("measure == 'final_state_error'"), MEAN, 1),
            (measures.query("measure == 'violation_distance'"), MEAN, 1),
            (curve, ["median", "median_low", "median_high"], 1),
            (curve, [f"share_top_5{end}" for end in LIMITS], 100),
        ]
        for axes, (table, columns, factor) in zip(row, sources, strict=True):
            assert axes.get_title().startswith(f"{truth.upper()}: ")
            for cells, samples in ((100, 1), (100, 3), (400, 1)):
                points = "points" if samples > 1 else "point"
                dots = bars(axes, f"{cells} cells, {samples} start {points} a dimension")
                rows = table.query(
                    f"truth == '{truth}' and cells == {cells} and samples == {samples}"
                )
                np.testing.assert_allclose(dots[:, 1:], factor * rows[columns].to_numpy())
                np.testing.assert_allclose(dots[:, 0], rows["dt"], rtol=0.05)
    titles = [axes.get_title().removeprefix("C1: ") for axes in panels[0]]
    assert titles == [
        *("reachable goals [%]", "final-state error", "violation distance"),
        *("rank of truth", "in top 5 [%]"),
    ]
    assert {axes.get_xlabel() for axes in panels[-1]} == {"$\\Delta t$ [s]"}


def test_start_points_say_every_number() -> None:
    tables = start_point_tables()
    lines = start_points.facts(**tables).splitlines()
    assert len([line for line in lines if line.startswith("  C")]) == 12
    key = "truth == 'c2' and cells == 100 and samples == 3 and dt == 0.5"
    means = tables["measures"].query(key).set_index("measure")["mean"]
    (row,) = tables["rank_curve"].query(f"{key} and demonstrations == 9").to_dict("records")
    rank = [row[f"median{end}"] for end in LIMITS]
    top = [100 * row[f"share_top_5{end}"] for end in LIMITS]
    assert (
        "  C2, 100 cells, 3 start points a dimension, dt 0.5 s: "
        f"{100 * means['reachable']:.0f} % of the goals reachable, final-state error "
        f"{means['final_state_error']:.3g}, violation distance {means['violation_distance']:.3g}, "
        "median rank {:.3g} ({:.3g} to {:.3g}), ".format(*rank)
        + "in the top 5 {:.0f} % ({:.0f} to {:.0f})".format(*top)
    ) in lines


def test_start_points_need_several_samples_and_nothing_else() -> None:
    tables = start_point_tables()
    with pytest.raises(Unsuited, match="the same number of start points"):
        start_points.draw(**{name: table.query("samples == 1") for name, table in tables.items()})
    twice = {name: pd.concat([table, table]) for name, table in tables.items()}
    with pytest.raises(Unsuited, match="rows differ in more than truth, cells, samples, dt"):
        start_points.draw(**twice)


def test_calibration_draws_what_is_probable_and_of_enough_beliefs(drawn: Drawn) -> None:
    (table,) = belief_tables().values()
    panels = np.reshape(drawn(calibration_diagram).axes, (2, 4))
    for row, source in zip(panels, ("model", "demonstrator"), strict=True):
        for axes, belief in zip(row, ("each", "selected", "corrected", "printed"), strict=True):
            rows = table.query(f"source == '{source}' and belief == '{belief}'")
            said = " ".join(text.get_text() for text in axes.texts)
            if belief == "printed":
                right = np.average(rows["observed"], weights=rows["weight"])
                assert said == f"100% of them are\nno probability\n({right:.0%} of these right)"
                continue
            assert said == ""
            for count, mark in ((1, STEP_MARKS[0]), (10, STEP_MARKS[1])):
                label = f"{count} demonstration{'s' if count > 1 else ''}"
                bins = rows.query(f"demonstrations == {count} and count >= 20")
                assert len(bins) == 2
                dots = bars(axes, label)
                columns = ["predicted", "observed", "low", "high"]
                np.testing.assert_allclose(dots, 100 * bins[columns].to_numpy())
                assert bars_of(axes, label)[0].get_marker() == mark
        assert row[0].get_ylabel().endswith("\n\nright [%]")
        assert source in row[0].get_ylabel().replace("tabular model", "model")
    assert {axes.get_xlabel() for axes in panels[-1]} == {"probability [%]"}


def test_calibration_says_what_is_right() -> None:
    (table,) = belief_tables().values()
    lines = calibration_diagram.facts(table).splitlines()
    rows = table.query("source == 'model' and belief == 'selected' and demonstrations == 10")
    means = [np.average(rows[name], weights=rows["weight"]) for name in ("predicted", "observed")]
    assert "  model, selected, 10: {:.3f} probable, {:.3f} right".format(*means) in lines
    rows = table.query("source == 'model' and belief == 'printed' and demonstrations == 1")
    share, right = rows["weight"].sum(), rows["observed"].mean()
    said = f"{share:.0%} of them are no probability, of which {right:.3f} right"
    assert f"  model, printed, 1: {said}" in lines
    with pytest.raises(Unsuited, match="rows differ in more than source, demonstrations, belief"):
        calibration_diagram.draw(pd.concat([table, table]))


def test_forecasts_are_drawn_before_and_after_the_map(drawn: Drawn) -> None:
    (table,) = forecast_tables().values()
    (axes,) = drawn(forecast_diagram).axes
    for kind, label in ((0, "Phi of the tabular model"), (1, "calibrated, other tasks")):
        bins = table.query(f"map == {kind} and count >= 20")
        assert len(bins) == 3
        expected = 100 * bins[["forecast", "crossed", "low", "high"]].to_numpy()
        np.testing.assert_allclose(bars(axes, label), expected)
    said = forecast_diagram.facts(table).splitlines()[-1]
    assert "calibrated, other tasks: 599 pairs, off by 0.010, Brier score 0.1100" in said
    with pytest.raises(Unsuited, match="could not do enough tasks"):
        forecast_diagram.draw(table.iloc[:0])
    with pytest.raises(Unsuited, match="more than map, lower"):
        forecast_diagram.draw(pd.concat([table, table]))


def of_default(table: pd.DataFrame, crossing: bool) -> pd.DataFrame:
    """The rows of the settings that the default case has."""
    key = "dt == 0.5 and samples == 3 and cells == 2500 and temperature == 1"
    return table.query(key)[lambda rows: rows["tasks.crossing"] == crossing]


def signs(figure: Figure) -> dict[str, tuple[str, str]]:
    """Colour and mark of each line in the legend."""
    (legend,) = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    return {
        word: (to_hex(line.get_color()), line.get_marker())
        for word, line in zip(words, legend.legend_handles, strict=True)
        if hasattr(line, "get_marker")
    }


def corners(table: pd.DataFrame) -> np.ndarray:
    """(N, 4) lower and upper corners of boxes."""
    sides = [f"{side}_{name}" for side in ("lower", "upper") for name in ("angle", "speed")]
    return table[sides].to_numpy(dtype=float)


def extent(boxes: PatchCollection) -> np.ndarray:
    vertices = [path.vertices for path in boxes.get_paths()]
    return np.array([[*each.min(axis=0), *each.max(axis=0)] for each in vertices])


def wrapped(path: np.ndarray) -> np.ndarray:
    """Points whose angle is in the first turn."""
    return np.column_stack([path[:, 0] % (2 * np.pi), path[:, 1]])


def test_success_curves_are_the_shares_of_the_default_case(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables = tables_for(success)
    usual = tables["cases"].query("case == 'default'").merge(tables["rank_curve"])
    figure = drawn(success)
    styles = signs(figure)
    for row, crossing in zip(np.reshape(figure.axes, (2, 3)), KINDS, strict=True):
        rows = usual[usual["tasks.crossing"] == crossing]
        assert rows["demonstrations"].tolist() == list(range(1, 21))
        for axes, name in zip(row[1:], ("overlap", "inside"), strict=True):
            assert name in axes.get_title(loc="left")
            lines = {(to_hex(line.get_color()), line.get_marker()): line for line in axes.lines}
            bands = {
                to_hex(band.get_facecolor()[0]): band.get_paths()[0].vertices
                for band in axes.collections
                if isinstance(band, PolyCollection)
            }
            assert len(bands) == 2
            for top, words in ((1, "the best"), (2, "both of the best two")):
                sign = styles[words]
                middle, low, high = (100 * rows[f"top_{top}_{name}{end}"] for end in LIMITS)
                x, y = lines[sign].get_data()
                np.testing.assert_array_equal(x, rows["demonstrations"])
                np.testing.assert_allclose(y, middle)
                for number, ends in zip(x, zip(low, high, strict=True), strict=True):
                    there = bands[sign[0]][:, 0] == number
                    of_number = bands[sign[0]][there, 1]
                    assert (of_number.min(), of_number.max()) == pytest.approx(ends)
            (paper,) = (line for line in axes.lines if len(line.get_xdata()) == 2)
            assert paper.get_xdata() == [5, 5]
            assert axes.get_xlabel() == "demonstrations"
            assert axes.get_ylabel() == "sets of demonstrations [%]"


def test_success_shows_the_first_demonstrations_and_the_best(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables, figure = tables_for(success), drawn(success)
    for (axes, *_), (crossing, words) in zip(
        np.reshape(figure.axes, (2, 3)), KINDS.items(), strict=True
    ):
        ranking, paths, violations = (
            tables[f"first_{name}"][lambda rows, kind=crossing: rows["tasks.crossing"] == kind]
            for name in ("ranking", "paths", "violations")
        )
        assert axes.get_title(loc="left") == f"{words}: 3 shown"
        every, *hatched = axes.collections
        np.testing.assert_allclose(extent(every), corners(ranking))
        colours = [to_hex(boxes.get_edgecolor()[0]) for boxes in hatched]
        assert colours == [DEMONSTRATION, SAMPLED]
        assert len({boxes.get_hatch() for boxes in hatched}) == 2
        lines = {to_hex(line.get_color()): line for line in axes.lines if len(line.get_xdata()) > 1}
        for boxes, colour, trial in zip(hatched, colours, (3, 4), strict=True):
            expected = violations[violations["trial"] == trial]
            np.testing.assert_allclose(extent(boxes), corners(expected))
            line = lines[colour].get_xydata()
            path = paths.loc[paths["demonstration"] == trial, ["angle", "speed"]].to_numpy()
            np.testing.assert_allclose(line[~np.isnan(line).any(axis=1)], wrapped(path))
            ends = [each for each in axes.lines if len(each.get_xdata()) == 1]
            ends = [each for each in ends if to_hex(each.get_color()) == colour]
            assert [end.get_marker() for end in ends] == ["o", "s"]
            np.testing.assert_allclose(
                [end.get_xydata()[0] for end in ends], wrapped(path)[[0, -1]]
            )
        assert len(lines) == 2
        filled = {to_hex(patch.get_facecolor()): patch for patch in axes.patches}
        truth = filled[TRUTH].get_bbox()
        np.testing.assert_allclose(truth.extents, corners(tables["example_regions"])[0])
        outlined = [patch for patch in axes.patches if not patch.get_fill()]
        best = [2, 4] if crossing else [8, 5]
        np.testing.assert_allclose(
            [patch.get_bbox().extents for patch in outlined],
            corners(ranking.set_index("hypothesis").loc[best]),
        )
        assert [text.get_text() for text in axes.texts] == ["1", "2"]
        for text, patch in zip(axes.texts, outlined, strict=True):
            assert patch.get_bbox().contains(*text.get_position())


def test_success_outlines_none_that_gains_nothing(tables_for: TablesFor) -> None:
    tables = tables_for(success)
    ranking = tables["first_ranking"]
    poor = ranking.assign(gain=ranking["gain"].where(ranking["hypothesis"] == 5, 0.0))
    poor = poor.assign(rank=np.where(poor["hypothesis"] == 5, 1.0, 5.5))
    poor.loc[poor["tasks.crossing"], "gain"] = 0.0
    figure = success.draw(**{**tables, "first_ranking": poor})
    planes = np.reshape(figure.axes, (2, 3))[:, 0]
    assert [[text.get_text() for text in axes.texts] for axes in planes] == [["1"], []]


def test_success_says_the_numbers(tables_for: TablesFor) -> None:
    tables = tables_for(success)
    lines = success.facts(**tables).splitlines()
    best = {False: [(8, "inside"), (5, "across")], True: [(2, "off"), (4, "across")]}
    for crossing, words in KINDS.items():
        (start,) = (k for k, line in enumerate(lines) if line.startswith(f"{words}: point "))
        assert f"point {FIRST_POINTS[crossing]}, truth C1, 2500 cells, 9 actions" in lines[start]
        assert lines[start].endswith("dt = 0.5 s.")
        ranking = tables["first_ranking"][lambda t, kind=crossing: t["tasks.crossing"] == kind]
        ranking = ranking.set_index("hypothesis")
        for place, (number, where) in enumerate(best[crossing], start=1):
            gain, posterior = ranking.loc[number, ["gain", "posterior"]]
            said = f"gain {gain:.3g} nat, posterior {posterior:.3g}, {where} the truth"
            assert lines[start + place] == f"  {place}: hypothesis {number}, {said}"
        rows = of_default(tables["rank_curve"], crossing).set_index("demonstrations")
        for line, count in zip(lines[start + 3 : start + 8], (1, 3, 5, 10, 20), strict=True):
            shown = "demonstration" if count == 1 else "demonstrations"
            assert line.startswith(f"  {count} {shown}, 3 seeds: the best overlap ")
            for top, which in ((1, "the best"), (2, "both of the best two")):
                for name in ("overlap", "inside"):
                    values = [100 * rows[f"top_{top}_{name}{end}"][count] for end in LIMITS]
                    assert (
                        f"{which} {name} " + "{:.0f} % ({:.0f} to {:.0f})".format(*values) in line
                    )


def test_success_cases_draws_each_case_with_its_interval(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables = tables_for(success_cases)
    figure = drawn(success_cases)
    *panels, _ = figure.axes
    shares = [(name, count) for name in ("overlap", "inside") for count in (5, 10)]
    styles = signs(figure)
    assert list(styles) == list(KINDS.values())
    names = [text.get_text() for text in panels[0].get_yticklabels()]
    assert names == list(tables["cases"]["case"].drop_duplicates())
    assert len(names) == len(SUCCESS_CASES)
    rows = tables["cases"].merge(tables["rank_curve"])
    for axes, (name, count) in zip(panels, shares, strict=True):
        assert axes.get_title().split() == [f"{name},", str(count), "shown"]
        assert axes.yaxis_inverted()
        for container, (crossing, words) in zip(axes.containers, KINDS.items(), strict=True):
            assert (to_hex(container[0].get_color()), container[0].get_marker()) == styles[words]
            after = rows[(rows["demonstrations"] == count) & (rows["tasks.crossing"] == crossing)]
            after = after.set_index("case").loc[names]
            expected = 100 * after[[f"top_2_{name}{end}" for end in LIMITS]].to_numpy()
            dots = marks_and_ends(container)
            np.testing.assert_array_equal(np.round(dots[:, 1]), range(len(names)))
            np.testing.assert_allclose(dots[:, [0, 2, 3]], expected)
        first, second = (marks_and_ends(container)[:, 1] for container in axes.containers)
        assert (first < second).all()


def test_success_cases_draws_every_share_over_the_evidence(
    drawn: Drawn, tables_for: TablesFor
) -> None:
    tables, figure = tables_for(success_cases), drawn(success_cases)
    axes, styles = figure.axes[-1], signs(figure)
    lines = [line for line in axes.lines if len(line.get_xdata()) > 2]
    assert len(lines) == len(SUCCESS_CASES) * len(KINDS)
    assert axes.get_xlabel() == "evidence\n[violations expected]"
    assert axes.get_ylabel() == "sets [%]"
    measures = tables["measures"].query("measure == 'truth_probability'")
    for crossing, words in KINDS.items():
        of_kind = [line for line in lines if to_hex(line.get_color()) == styles[words][0]]
        for line, (case, change) in zip(of_kind, SUCCESS_CASES.items(), strict=True):
            settings = {"temperature": 1.0, "cells": 2500, "dt": 0.5, "samples": 3, **change}
            curve, chance = (
                table.query(" and ".join(f"{key} == {value}" for key, value in settings.items()))[
                    lambda rows, kind=crossing: rows["tasks.crossing"] == kind
                ]
                for table in (tables["rank_curve"], measures)
            )
            (mean,) = chance["mean"]
            np.testing.assert_allclose(line.get_xdata(), mean * np.arange(1, 21))
            np.testing.assert_allclose(line.get_ydata(), 100 * curve["top_2_overlap"])
            filled = to_hex(line.get_markerfacecolor()) == styles[words][0]
            assert filled == (case == "default"), case
            assert line.get_marker() == styles[words][1]


@pytest.mark.parametrize("module", [success, success_cases])
def test_a_study_of_one_kind_of_tasks_has_no_column_for_it(
    module: ModuleType, drawn: Drawn, tables_for: TablesFor
) -> None:
    tables = tables_for(module)
    kind = {name: t[~t["tasks.crossing"]] for name, t in tables.items() if "tasks.crossing" in t}
    ranking = kind.pop("first_ranking")
    alone = {name: t if name.startswith("first") else t.drop(columns="tasks.crossing")
             for name, t in kind.items()}  # fmt: skip
    one = {**tables, **alone, "first_ranking": ranking}
    both = drawn(module)
    figure = module.draw(**one)
    assert len(figure.axes) == (len(both.axes) // 2 if module is success else len(both.axes))
    words = "random tasks" if module is success else "all tasks"
    assert any(line.strip().startswith(words) for line in module.facts(**one).splitlines())


def test_success_cases_show_what_there_is(tables_for: TablesFor) -> None:
    tables = tables_for(success_cases)
    few = tables["rank_curve"].query("demonstrations < 4")
    figure = success_cases.draw(**{**tables, "rank_curve": few})
    titles = [" ".join(axes.get_title().split()) for axes in figure.axes]
    assert titles == ["overlap, 3 shown", "inside, 3 shown", "overlap, all cases"]


def test_success_cases_says_the_numbers(tables_for: TablesFor) -> None:
    tables = tables_for(success_cases)
    lines = success_cases.facts(**tables).splitlines()
    assert "1 to 20 demonstrations" in lines[1]
    values = [line for line in lines if line.startswith("  ")]
    assert len(values) == 2 * len(KINDS) * len(SUCCESS_CASES)
    for crossing, words in KINDS.items():
        row = of_default(tables["rank_curve"], crossing).query("demonstrations == 10").iloc[0]
        chance = of_default(tables["measures"], crossing).query("measure == 'truth_probability'")
        said = [
            f"{name} "
            + "{:.0f} % ({:.0f} to {:.0f})".format(
                *(100 * row[f"top_2_{name}{end}"] for end in LIMITS)
            )
            for name in ("overlap", "inside")
        ]
        evidence = f"evidence {10 * chance['mean'].iloc[0]:.3g}"
        assert f"  {words}, default, 10 demonstrations: {', '.join(said)}; {evidence}" in values


@pytest.mark.parametrize("module", [success, success_cases])
def test_success_needs_a_truth_across_hypotheses_and_a_default(
    module: ModuleType, tables_for: TablesFor
) -> None:
    tables = tables_for(module)
    ranking = tables["first_ranking"]
    whole = ranking.assign(overlaps_truth=ranking["covered_by_truth"])
    with pytest.raises(Unsuited, match="the truth is made of whole hypotheses"):
        module.draw(**{**tables, "first_ranking": whole})
    unnamed = tables["cases"].assign(case="mine")
    for make in (module.draw, module.facts):
        with pytest.raises(Unsuited, match="no case is named default"):
            make(**{**tables, "cases": unnamed})
