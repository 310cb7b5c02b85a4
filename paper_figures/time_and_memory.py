"""Time and memory against the number of tabular states, and time against all else that may grow."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from paper_figures.style import COLUMN, GUIDE, OTHER_COLOURS, OTHER_MARKS, RC, new_figure

TABLES = {
    "scale": (
        *("system", "states", "actions", "hypotheses", "steps", "dt", "largest_active_share"),
        *("discretise_s", "infer_s", "total_s", "peak_mb"),
        *("cpu", "python", "numpy", "scipy", "commit", "date"),
    ),
    "growth": ("factor", "value", "discretise_s", "infer_s"),
}
PAPER_STATES = 2500  # of the paper's telescoping pendulum

# What is drawn of each row: colour and mark, filled for the first system, hollow for others.
_TIMES = (
    ("discretise_s", "discretise", OTHER_COLOURS[0], "o"),
    ("infer_s", "infer and rank", OTHER_COLOURS[1], "s"),
)
_MEMORY = (("peak_mb", "peak", OTHER_COLOURS[0], "^"),)


def draw(scale: pd.DataFrame, growth: pd.DataFrame) -> Figure:
    """Draw time and memory, all axes logarithmic, with a line of slope 1 through the last point.

    Args:
        scale: the table of that name: a row a system and size.
        growth: the table of that name: a row a size, by what grows.
    """
    figure, ((left, right), below) = new_figure(COLUMN, 4.6, nrows=2, ncols=2)
    with plt.rc_context(RC):
        _draw_panel(left, scale, _TIMES, "processor time [s]")
        _draw_panel(right, scale, _MEMORY, "memory [MB]")
        entries = [
            *left.get_legend_handles_labels()[0],
            Line2D([], [], color=OTHER_COLOURS[0], marker="^", label="peak memory"),
            Line2D([], [], color=GUIDE, linestyle=":", linewidth=0.8, label="slope 1"),
            Line2D([], [], color=GUIDE, linewidth=0.6, label=f"the paper's {PAPER_STATES} states"),
        ]
        if len(_systems(scale)) > 1:
            dashed = {"linestyle": "--", "marker": "o", "markerfacecolor": "white"}
            entries.append(Line2D([], [], color=OTHER_COLOURS[0], label="four angles", **dashed))
        for axes, (column, name, _, _) in zip(below, _TIMES, strict=True):
            _draw_growth(axes, growth, column, f"{name} [multiple]")
        entries += below[0].get_legend_handles_labels()[0]
        figure.legend(handles=entries, loc="outside lower center", ncols=2)
    return figure


def facts(scale: pd.DataFrame, growth: pd.DataFrame) -> str:
    """What the caption says."""
    first = scale.iloc[0]
    lines = [
        "One task of the telescoping pendulum against the number of tabular states: forming the "
        "tabular model, and Phi of all hypotheses with the ranking; processor time of one thread "
        "(left) and peak memory of the process (right).",
        f"{first['actions']} actions, {first['hypotheses']} hypotheses, {first['steps']} steps of "
        f"{first['dt']:g} s; one run a size, so the times have no intervals.",
        "Filled, solid: telescoping pendulum. Hollow, dashed: four angles that no bound stops, so "
        "that most cells are active. Dotted: slope 1; line: the paper's 2500 states.",
    ]
    for system, rows in _systems(scale):
        for row in rows.itertuples():
            lines.append(
                f"  {system}, {row.states} states: {row.discretise_s:.3g} s and {row.infer_s:.3g} "
                f"s, {row.peak_mb:.0f} MB, at most {100 * row.largest_active_share:.0f} % of the "
                "cells active at a step"
            )
        if len(rows) > 1:
            few, many = rows.iloc[0], rows.iloc[-1]
            slope = np.log(many["total_s"] / few["total_s"]) / np.log(
                many["states"] / few["states"]
            )
            lines.append(
                f"  {system}: from {few['states']} to {many['states']} states the time grows with "
                f"the power {slope:.2f}"
            )
    lines.append("Below, what else grows; times as multiples of that at the smallest size.")
    for factor, rows in _factors(growth):
        few, many = rows.iloc[0], rows.iloc[-1]
        more = np.log(many["value"] / few["value"])
        powers = [np.log(many[column] / few[column]) / more for column, *_ in _TIMES]
        lines.append(
            f"  {factor} from {few['value']} to {many['value']}: discretising grows with the power "
            f"{powers[0]:.2f}, inference with {powers[1]:.2f}"
        )
    lines.append(
        f"Measured on {first['cpu']}, Python {first['python']}, numpy {first['numpy']}, scipy "
        f"{first['scipy']}, commit {first['commit']}, {first['date']}."
    )
    return "\n".join(lines)


def _systems(scale: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The rows of each system by size, in the order of the table."""
    return [
        (system, scale[scale["system"] == system].sort_values("states"))
        for system in scale["system"].unique()
    ]


def _factors(growth: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The rows of each factor by size, in the order of the table."""
    return [
        (factor, growth[growth["factor"] == factor].sort_values("value"))
        for factor in growth["factor"].unique()
    ]


def _draw_growth(axes: Axes, growth: pd.DataFrame, column: str, label: str) -> None:
    """Times of each factor against its size, both as multiples of the smallest."""
    for number, (factor, rows) in enumerate(_factors(growth)):
        axes.plot(
            rows["value"] / rows["value"].iloc[0],
            rows[column] / rows[column].iloc[0],
            color=OTHER_COLOURS[number % len(OTHER_COLOURS)],
            marker=OTHER_MARKS[number % len(OTHER_MARKS)],
            linestyle="-" if number < len(OTHER_COLOURS) else "--",
            label=factor,
        )
    most = float((growth["value"] / growth.groupby("factor")["value"].transform("min")).max())
    axes.plot([1, most], [1, most], color=GUIDE, linestyle=":", linewidth=0.8)
    _on_logarithms(axes, "size [multiple]", label)


def _on_logarithms(axes: Axes, x_label: str, y_label: str) -> None:
    """Logarithmic axes with labels, and with numbers at the powers of ten alone."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)


def _draw_panel(
    axes: Axes,
    scale: pd.DataFrame,
    curves: tuple[tuple[str, str, str, str], ...],
    label: str,
) -> None:
    """The curves of one unit."""
    for number, (_, rows) in enumerate(_systems(scale)):
        for column, name, colour, sign in curves:
            axes.plot(
                rows["states"],
                rows[column],
                color=colour,
                marker=sign,
                markerfacecolor=colour if number == 0 else "white",
                linestyle="-" if number == 0 else "--",
                label=name if number == 0 else None,
            )
    longest = _systems(scale)[0][1]
    x = longest["states"].to_numpy(dtype=float)
    y = float(longest[curves[0][0]].iloc[-1]) * x / x[-1]
    axes.plot(x, y, color=GUIDE, linestyle=":", linewidth=0.8)
    axes.axvline(PAPER_STATES, color=GUIDE, linewidth=0.6)
    _on_logarithms(axes, "states", label)
