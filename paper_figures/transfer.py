"""An inferred region and the tube that was learned, where controls are weaker or stronger."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures.plane import Plane
from paper_figures.report.means import share
from paper_figures.rows import Unsuited
from paper_figures.style import (
    GUIDE,
    OTHER_MARKS,
    PAGE,
    PATH,
    RC,
    STEP_COLOURS,
    TRUTH,
    new_figure,
)

TABLES = {
    "transfer": (
        "strength",
        "method",
        "region",
        "right",
        "safe",
        "refused",
        "doomed",
        "admitted",
        "trials",
        "entered",
    ),
    "transfer_values": ("strength", "state_1", "state_2", "value"),
    "regions": ("region",),
    "dimensions": ("name", "unit", "lower", "upper", "periodic"),
}

NOMINAL = 1.0
_SHARES = {"entered": "trials", "refused": "safe", "admitted": "doomed"}
_TITLES = {
    "entered": ("entries", "trials [%]"),
    "refused": ("safe and refused", "safe states [%]"),
}
_LOOKS = {
    "own safe set": (STEP_COLOURS[0], "o"),
    "tube": (STEP_COLOURS[2], "s"),
    "no filter": (STEP_COLOURS[3], OTHER_MARKS[1]),
    "never entered": (STEP_COLOURS[1], OTHER_MARKS[0]),
}


def transfer_rows(transfer: pd.DataFrame) -> pd.DataFrame:
    """A row a strength and method, all points together.

    Returns:
        `strength`, `method`; how many `trials`; the shares `entered` of trials, `refused` of safe
        states and `admitted` of those that are doomed, each with Wilson's interval `_low` and
        `_high`; NaN where there is none.
    """
    rows = []
    for (strength, method), group in transfer.groupby(["strength", "method"], sort=True):
        row = {"strength": strength, "method": method, "trials": group["trials"].sum()}
        for part, whole in _SHARES.items():
            count = int(group[whole].sum())
            each = share(int(group[part].sum()), count) if count else None
            row |= {
                part: each.value if each else np.nan,
                f"{part}_low": each.low if each else np.nan,
                f"{part}_high": each.high if each else np.nan,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def draw(
    transfer: pd.DataFrame,
    transfer_values: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> Figure:
    """Draw the truth with a safe set's border a strength, and the shares of each method."""
    if len(dimensions) != 2:
        raise Unsuited("borders of safe sets are drawn in two dimensions")
    rows = transfer_rows(transfer)
    figure, grid = new_figure(PAGE, 2.7, ncols=3, width_ratios=[1.5, 1, 1])
    with plt.rc_context(RC):
        _borders(grid[0], transfer_values, Plane.of(regions, dimensions), regions)
        for axes, (name, (title, unit)) in zip(grid[1:], _TITLES.items(), strict=True):
            for method, (colour, mark) in _LOOKS.items():
                each = rows[(rows["method"] == method) & rows[name].notna()]
                value, low, high = (100 * each[f"{name}{end}"] for end in ("", "_low", "_high"))
                style = {"color": colour, "marker": mark, "label": method}
                axes.errorbar(
                    each["strength"],
                    value,
                    [(value - low).clip(0), (high - value).clip(0)],
                    **style,
                )
            axes.axvline(NOMINAL, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
            axes.set_ylim(-3, 103)
            axes.set_title(title)
            axes.set_xlabel("controls [nominal range]")
            axes.set_ylabel(unit)
        handles, labels = grid[2].get_legend_handles_labels()
        handles += grid[0].get_legend_handles_labels()[0]
        labels += grid[0].get_legend_handles_labels()[1]
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _borders(axes: plt.Axes, values: pd.DataFrame, plane: Plane, regions: pd.DataFrame) -> None:
    """The truth, and where the safe set of the inferred region ends, a line a strength."""
    for box in plane.rectangles(regions):
        box.set(facecolor=TRUTH, alpha=0.5, edgecolor="none")
        axes.add_patch(box)
    plane.dress(axes)
    axes.set_title("borders of the safe sets")
    styles = ("--", "-", ":", "-.")
    strengths = sorted(values["strength"].unique())
    for number, strength in enumerate(strengths):
        of_strength = values[values["strength"] == strength]
        table = of_strength.drop_duplicates(["state_1", "state_2"]).pivot(
            index="state_2", columns="state_1", values="value"
        )
        style = styles[number % len(styles)]
        colour = "black" if strength == NOMINAL else PATH
        axes.contour(
            table.columns,
            table.index,
            table.to_numpy(),
            [0.0],
            colors=colour,
            linestyles=style,
            linewidths=1.1,
        )
        label = f"safe set, {strength:g} x the controls"
        axes.add_line(Line2D([], [], color=colour, linestyle=style, label=label))


def facts(
    transfer: pd.DataFrame,
    transfer_values: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> str:
    """What the caption says."""
    del transfer_values, regions, dimensions
    right = transfer.groupby("seed")["right"].first() if "seed" in transfer else transfer["right"]
    lines = [
        "Orange: the truth. A region is inferred with the nominal control range and kept out of",
        "with others: by its own safe set, solved anew, or by the tube, the complement of its",
        "nominal safe set. Entries: random controls that pass the filter; refused: of states that",
        "can keep out for ever. Lines: Wilson's 95 % intervals; dotted: nominal range.",
        f"The inferred region is the truth in {int(right.sum())} of {len(right)} points.",
    ]
    for row in transfer_rows(transfer).itertuples():
        entered = "" if np.isnan(row.entered) else f"entered {100 * row.entered:.2f} %, "
        lines.append(
            f"  {row.strength:g} x the controls, {row.method}: {entered}refused "
            f"{100 * row.refused:.1f} %"
        )
    return "\n".join(lines)
