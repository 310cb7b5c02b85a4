"""Final-state error of the tabular agent against the time step (the paper's Fig. 3)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.curves import (
    COLUMNS,
    common_facts,
    curve_facts,
    draw_curves,
    legend_entries,
    paper_measure,
)
from paper_figures.style import COLUMN, RC, new_figure

TABLES = {"measures": COLUMNS}


def draw(measures: pd.DataFrame) -> Figure:
    """Draw a panel a truth.

    Args:
        measures: the table of that name, with the measure `final_state_error`.
    """
    rows = paper_measure(measures, "final_state_error")
    truths = sorted(rows["truth"].unique())
    figure, grid = new_figure(
        COLUMN, 0.7 + 1.45 * len(truths), nrows=len(truths), sharex=True, sharey=True, squeeze=False
    )
    with plt.rc_context(RC):
        for truth, axes in zip(truths, grid[:, 0], strict=True):
            draw_curves(axes, rows[rows["truth"] == truth])
            axes.set_title(f"truth {truth.upper()}", loc="left")
        grid[0, 0].set_ylim(bottom=0)  # last: it ends the scaling to the data
        figure.supylabel("final-state error [share of the ranges]", fontsize=8)
        grid[-1, 0].set_xlabel(r"$\Delta t$ [s]")
        figure.legend(handles=legend_entries(rows), loc="outside lower center", ncols=4)
    return figure


def facts(measures: pd.DataFrame) -> str:
    """What the caption says."""
    rows = paper_measure(measures, "final_state_error")
    lines = [
        "Distance between the goal and where policies sampled from the tabular MDP end on the "
        "continuous dynamics, each dimension as a share of its range.",
        *common_facts(rows),
        "Values:",
        *curve_facts(rows, " of the ranges"),
    ]
    return "\n".join(lines)
