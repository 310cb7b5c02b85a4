"""The figure of time and memory against its table, and this against what is measured."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from figure_study import growth_rows, scale_rows

from experiments.config.paths import CHECKOUT
from paper_figures import time_and_memory


def test_the_figure_shows_the_table() -> None:
    left, right, *below = time_and_memory.draw(scale_rows(), growth_rows()).axes
    assert (left.get_ylabel(), right.get_ylabel()) == ("processor time [s]", "memory [MB]")
    table = scale_rows()
    (legend,) = left.figure.legends
    signs = {"slope 1", "the paper's 2500 states", "four angles", "hypotheses", "actions"}
    assert signs < {text.get_text() for text in legend.get_texts()}
    for axes, columns in ((left, ["discretise_s", "infer_s"]), (right, ["peak_mb"])):
        lines = [line for line in axes.lines if line.get_marker() != "None"]
        curves = [line.get_xydata() for line in lines]
        expected = [
            table.loc[table["system"] == system, ["states", column]].to_numpy(dtype=float)
            for system in ("telescope", "torus")
            for column in columns
        ]
        assert len(curves) == len(expected)
        for curve, values in zip(curves, expected, strict=True):
            np.testing.assert_allclose(curve, values)
        assert axes.get_xscale() == axes.get_yscale() == "log"
        assert axes.get_xlabel() == "states"
        assert [line.get_markerfacecolor() == "white" for line in lines] == [False] * len(
            columns
        ) + [True] * len(columns)
        (guide,) = (line for line in axes.lines if line.get_linestyle() == ":")
        x, y = np.log(np.array(guide.get_xydata())).T
        np.testing.assert_allclose(np.diff(y), np.diff(x))
        assert guide.get_xydata()[-1].tolist() == [4000.0, table[columns[0]].iloc[2]]

    growth = growth_rows()
    for axes, column in zip(below, ["discretise_s", "infer_s"], strict=True):
        lines = [line for line in axes.lines if line.get_marker() != "None"]
        assert [line.get_label() for line in lines] == ["hypotheses", "actions"]
        for line, rows in zip(lines, (growth[:3], growth[3:]), strict=True):
            times = (rows[column] / rows[column].iloc[0]).tolist()
            expected = np.column_stack([[1, 10, 100], times])
            np.testing.assert_allclose(line.get_xydata(), expected)


def test_the_facts_are_the_tables() -> None:
    lines = time_and_memory.facts(scale_rows(), growth_rows()).splitlines()
    expected = "  telescope, 2000 states: 0.2 s and 0.02 s, 110 MB, at most 20 % of the cells"
    assert lines[4].startswith(expected)
    slope = np.log(0.44 / 0.11) / np.log(4)
    assert f"the time grows with the power {slope:.2f}" in "\n".join(lines)
    assert sum("time grows with the power" in line for line in lines) == 1
    assert (
        "  hypotheses from 10 to 1000: discretising grows with the power 1.00, inference with 2.00"
    ) in lines
    assert any(
        line.startswith("  actions from 3 to 300:") and line.endswith("0.50") for line in lines
    )


@pytest.mark.long
def test_the_benchmark_measures_what_the_figure_needs() -> None:
    command = [sys.executable, "-m", "tests.benchmark.growth", "states", "1000"]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    row = json.loads(done.stdout)
    for columns in time_and_memory.TABLES.values():
        assert set(columns) <= set(row)
    assert (row["states"], row["actions"], row["hypotheses"], row["steps"]) == (1000, 15, 100, 20)
    assert 0 < row["largest_active_share"] <= 1
    parts = row["discretise_s"] + row["infer_s"]
    assert row["total_s"] == pytest.approx(parts, abs=1e-3)
    assert 30 < row["imports_mb"] <= row["floor_mb"] < row["peak_mb"] + 20 < 1000
