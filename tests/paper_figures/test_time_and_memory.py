"""The figure of time and memory against its table, and this against what is measured."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from figure_study import scale_rows

from experiments.config.paths import CHECKOUT
from paper_figures import time_and_memory


def test_the_figure_shows_the_table() -> None:
    left, right = time_and_memory.draw(scale_rows()).axes
    assert (left.get_ylabel(), right.get_ylabel()) == ("processor time [s]", "memory [MB]")
    table = scale_rows()
    (legend,) = left.figure.legends
    signs = {"slope 1", "the paper's 2500 states", "four angles"}
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


def test_the_facts_are_the_tables() -> None:
    lines = time_and_memory.facts(scale_rows()).splitlines()
    expected = "  telescope, 2000 states: 0.2 s and 0.02 s, 110 MB, at most 20 % of the cells"
    assert lines[4].startswith(expected)
    slope = np.log(0.44 / 0.11) / np.log(4)
    assert f"the time grows with the power {slope:.2f}" in "\n".join(lines)
    assert sum("grows with the power" in line for line in lines) == 1


@pytest.mark.long
def test_the_benchmark_measures_what_the_figure_needs() -> None:
    command = [sys.executable, "-m", "tests.benchmark.scale", "torus", "5", "4", "5", "4"]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    row = json.loads(done.stdout)
    assert set(time_and_memory.TABLES["scale"]) <= set(row)
    assert (row["states"], row["actions"], row["hypotheses"], row["steps"]) == (400, 15, 100, 20)
    assert 0 < row["largest_active_share"] <= 1
    parts = row["discretise_s"] + row["infer_s"]
    assert row["total_s"] == pytest.approx(parts, abs=1e-3)
    assert 0 < row["discretise_floor_s"] < row["discretise_s"] < 10
    assert 30 < row["peak_mb"] < 1000
