"""An inferred region and the tube that was learned, where controls are weaker or stronger."""

from __future__ import annotations

from collections.abc import Sequence

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
    whiskers,
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
    "transfer_values": ("region", "strength", "state_1", "state_2", "value"),
    "cases": ("case", "choice", "value"),
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


def with_cases(transfer: pd.DataFrame, cases: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of each case, in the order of the cases.

    Raises:
        Unsuited: a row is of no case.
    """
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    rows = transfer.merge(cases[[*keys, "case"]], on=keys, how="left", validate="many_to_one")
    if rows["case"].isna().any():
        raise Unsuited("some points are of no case")
    return {str(case): rows[rows["case"] == case] for case in cases["case"].drop_duplicates()}


def right_points(transfer: pd.DataFrame) -> tuple[int, int]:
    """In how many points the inferred region is the truth, and how many there are."""
    right = transfer.groupby("seed")["right"].first()
    return int(right.sum()), len(right)


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
    cases: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> Figure:
    """Draw a line of panels a case: borders of safe sets, and the shares of each method."""
    if len(dimensions) != 2:
        raise Unsuited("borders of safe sets are drawn in two dimensions")
    of_cases = with_cases(transfer, cases)
    figure, grid = new_figure(
        PAGE,
        0.6 + 2.1 * len(of_cases),
        nrows=len(of_cases),
        ncols=3,
        width_ratios=[1.5, 1, 1],
        squeeze=False,
    )
    with plt.rc_context(RC):
        for line, (case, rows) in zip(grid, of_cases.items(), strict=True):
            region = rows["region"].mode()[0]
            right, points = right_points(rows)
            values = transfer_values[transfer_values["region"] == region]
            _borders(line[0], values, Plane.of(regions, dimensions), regions)
            line[0].set_title(
                f"{case}\ninferred: region {region}, the truth in {right} of {points}"
            )
            _shares(line[1:], transfer_rows(rows))
        handles, labels = grid[0][2].get_legend_handles_labels()
        handles += grid[0][0].get_legend_handles_labels()[0]
        labels += grid[0][0].get_legend_handles_labels()[1]
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _shares(panels: Sequence[plt.Axes], rows: pd.DataFrame) -> None:
    """A panel a share, a curve a method against the strength of controls."""
    for axes, (name, (title, unit)) in zip(panels, _TITLES.items(), strict=True):
        for method, (colour, mark) in _LOOKS.items():
            each = rows[(rows["method"] == method) & rows[name].notna()]
            value, low, high = (100 * each[f"{name}{end}"] for end in ("", "_low", "_high"))
            style = {"color": colour, "marker": mark, "label": method}
            axes.errorbar(each["strength"], value, whiskers(value, low, high), **style)
        axes.axvline(NOMINAL, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
        axes.set_ylim(-3, 103)
        axes.set_title(title)
        axes.set_xlabel("controls [nominal range]")
        axes.set_ylabel(unit)


def _borders(axes: plt.Axes, values: pd.DataFrame, plane: Plane, regions: pd.DataFrame) -> None:
    """The truth, and where the safe set of the inferred region ends, a line a strength."""
    for box in plane.rectangles(regions):
        box.set(facecolor=TRUTH, alpha=0.5, edgecolor="none")
        axes.add_patch(box)
    plane.dress(axes)
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
    cases: pd.DataFrame,
    regions: pd.DataFrame,
    dimensions: pd.DataFrame,
) -> str:
    """What the caption says."""
    del transfer_values, regions, dimensions
    lines = [
        "Orange: the truth. A region is inferred with the nominal control range and kept out of",
        "with others: by its own safe set, solved anew, or by the tube, the complement of its",
        "nominal safe set. Left: where the safe sets end. Entries: random controls that pass the",
        "filter; refused: of states that can keep out for ever. Lines: Wilson's 95 % intervals;",
        "dotted: nominal range. A line of panels a margin, of demonstrators and of filters.",
    ]
    for case, rows in with_cases(transfer, cases).items():
        right, points = right_points(rows)
        lines.append(f"{case}: the inferred region is the truth in {right} of {points} points.")
        for row in transfer_rows(rows).itertuples():
            entered = "" if np.isnan(row.entered) else f"entered {100 * row.entered:.2f} %, "
            lines.append(
                f"  {row.strength:g} x the controls, {row.method}: {entered}refused "
                f"{100 * row.refused:.1f} %"
            )
    return "\n".join(lines)
