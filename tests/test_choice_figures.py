"""What the figures of the studies of choices draw, against the tables that they were given."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from choice_studies import LIMITS, calibration_tables, in_cell_tables, sensitivity_tables
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from paper_figures import calibration, in_cell, sensitivity
from paper_figures.selection import Unsuited
from paper_figures.style import CELL_COLOURS, CELL_MARKS, STEP_MARKS

MEAN = ["mean", "low", "high"]


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    """Nothing stays open."""
    yield
    plt.close("all")


def bars(axes: Axes, label: str) -> np.ndarray:
    """Marks (x, y) and ends (low, high) of the error bars of a label, in the axes' first sense."""
    (container,) = (each for each in axes.containers if each.get_label() == label)
    line, _, (lines,) = container
    ends = np.array(lines.get_segments(), dtype=float)
    along = 0 if np.ptp(ends[0, :, 0]) > 0 else 1
    marks = [np.asarray(data, dtype=float) for data in (line.get_xdata(), line.get_ydata())]
    return np.column_stack([*marks, ends[:, 0, along], ends[:, 1, along]])


def test_sensitivity_draws_each_case_with_its_interval() -> None:
    tables = sensitivity_tables()
    figure = sensitivity.draw(**tables)
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
            drawn = bars(axes, label)
            drawn = drawn[np.argsort(drawn[:, 1])]
            expected = [
                factor * table.query(key.format(t, c, dt))[columns].to_numpy()[0]
                for t, c, _ in of_series
            ]
            np.testing.assert_allclose(drawn[:, [0, 2, 3]], expected)
            np.testing.assert_array_equal(np.round(drawn[:, 1]), [line for *_, line in of_series])
            checked += len(expected)
    assert checked == 4 * 7
    styles = {each.get_label(): each[0] for each in rank.containers}
    first = styles["100 cells, $\\Delta t$ = 0.25 s"]
    assert (first.get_marker(), to_hex(first.get_color())) == (CELL_MARKS[100], CELL_COLOURS[100])
    assert len({line.get_marker() for line in styles.values()}) == 3


def test_sensitivity_says_every_number() -> None:
    tables = sensitivity_tables()
    lines = sensitivity.facts(**tables).splitlines()
    row = sensitivity.rows(**tables).iloc[-1]
    assert lines[-1].startswith("  temperature: 2, 400 cells, dt 0.5 s: ")
    for name, factor in (("rank", 1), ("top", 100), ("final_state_error", 1)):
        values = [f"{factor * row[name + end]:.3g}" for end in LIMITS]
        assert "{} ({} to {})".format(*values) in lines[-1]
    assert len([line for line in lines if line.startswith("  ")]) == len(tables["cases"])


def test_sensitivity_needs_a_default_and_one_row_a_case() -> None:
    tables = sensitivity_tables()
    other = {**tables, "cases": tables["cases"].assign(case="mine")}
    with pytest.raises(Unsuited, match="rows of one case differ in more than"):
        sensitivity.draw(**{**other, "cases": other["cases"].assign(case="default")})
    with pytest.raises(Unsuited, match="no case is named default"):
        sensitivity.draw(**other)


def test_in_cell_draws_each_setting_with_its_interval() -> None:
    tables = in_cell_tables()
    figure = in_cell.draw(**tables)
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
            assert axes.get_title().startswith(truth.upper())
            for cells, samples in ((100, 1), (100, 3), (400, 1)):
                points = "points" if samples > 1 else "point"
                drawn = bars(axes, f"{cells} cells, {samples} start {points} a dimension")
                chosen = table.query(
                    f"truth == '{truth}' and cells == {cells} and samples == {samples}"
                )
                np.testing.assert_allclose(drawn[:, 1:], factor * chosen[columns].to_numpy())
                np.testing.assert_allclose(drawn[:, 0], chosen["dt"], rtol=0.05)
    said = in_cell.facts(**tables).splitlines()
    assert len([line for line in said if line.startswith("  C")]) == 12


def test_in_cell_needs_several_samples_and_nothing_else() -> None:
    tables = in_cell_tables()
    with pytest.raises(Unsuited, match="the same number of start points"):
        in_cell.draw(**{name: table.query("samples == 1") for name, table in tables.items()})
    twice = {name: pd.concat([table, table]) for name, table in tables.items()}
    with pytest.raises(Unsuited, match="rows differ in more than truth, cells, samples, dt"):
        in_cell.draw(**twice)


def test_calibration_draws_what_is_probable_and_of_enough_beliefs() -> None:
    (table,) = calibration_tables().values()
    panels = np.reshape(calibration.draw(table).axes, (2, 4))
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
                chosen = rows.query(f"demonstrations == {count} and count >= 20")
                assert len(chosen) == 2
                drawn = bars(axes, label)
                columns = ["predicted", "observed", "low", "high"]
                np.testing.assert_allclose(drawn, 100 * chosen[columns].to_numpy())
                (line,) = (each[0] for each in axes.containers if each.get_label() == label)
                assert line.get_marker() == mark


def test_calibration_says_what_is_right() -> None:
    (table,) = calibration_tables().values()
    lines = calibration.facts(table).splitlines()
    rows = table.query("source == 'model' and belief == 'selected' and demonstrations == 10")
    means = [np.average(rows[name], weights=rows["weight"]) for name in ("predicted", "observed")]
    assert "  model, selected, 10: {:.3f} probable, {:.3f} right".format(*means) in lines
    rows = table.query("source == 'model' and belief == 'printed' and demonstrations == 1")
    share, right = rows["weight"].sum(), rows["observed"].mean()
    said = f"{share:.0%} of them are no probability, of which {right:.3f} right"
    assert f"  model, printed, 1: {said}" in lines
    with pytest.raises(Unsuited, match="rows differ in more than source, demonstrations, belief"):
        calibration.draw(pd.concat([table, table]))
