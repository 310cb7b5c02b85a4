"""Violation distance (11), floor and pooled value against the time step (the paper's Fig. 4)."""

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
from paper_figures.style import PAGE, RC, new_figure

TABLES = {"measures": COLUMNS}
_PANELS = {
    "violation_distance": "one demonstration",
    "violation_floor": "its floor",
    "violation_distance_pooled": "pooled",
}


def draw(measures: pd.DataFrame) -> Figure:
    """Draw a row of panels a measure, a panel in it a truth.

    Args:
        measures: the table of that name, with the measures of `_PANELS`.
    """
    rows = {name: paper_measure(measures, name) for name in _PANELS}
    truths = sorted(rows["violation_distance"]["truth"].unique())
    figure, grid = new_figure(
        PAGE * max(1, len(truths)) / 2,
        0.6 + 1.3 * len(_PANELS),
        nrows=len(_PANELS),
        ncols=len(truths),
        sharex=True,
        sharey="row",
        squeeze=False,
    )
    with plt.rc_context(RC):
        for (name, what), panels in zip(_PANELS.items(), grid, strict=True):
            for truth, axes in zip(truths, panels, strict=True):
                draw_curves(axes, rows[name][rows[name]["truth"] == truth])
                axes.set_title(f"truth {truth.upper()}, {what}", loc="left")
            panels[0].set_ylim(bottom=0)  # last: it ends the scaling to the data
            panels[0].set_ylabel("distance [regions]")
        for axes in grid[-1]:
            axes.set_xlabel(r"$\Delta t$ [s]")
        entries = legend_entries(rows["violation_distance"])
        figure.legend(handles=entries, loc="outside lower center", ncols=4)
    return figure


def facts(measures: pd.DataFrame) -> str:
    """What the caption says."""
    rows = paper_measure(measures, "violation_distance")
    lines = [
        "Sum over the hypotheses of the difference between the probability of violating it and "
        "whether the demonstrations do (11).",
        "One demonstration: (11) with N = 1, averaged. Its floor: what it would be on average if "
        "demonstrations were drawn from the model itself, sum of 2 Phi (1 - Phi). Pooled: "
        "probabilities and violations averaged over all demonstrations before they are compared.",
        *common_facts(rows),
    ]
    for name, what in _PANELS.items():
        lines += [f"{what[0].upper()}{what[1:]}:", *curve_facts(paper_measure(measures, name), "")]
    return "\n".join(lines)
