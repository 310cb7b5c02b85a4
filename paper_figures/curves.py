"""Means with their intervals: against the time step, a curve a number of cells; or in a line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator

from paper_figures.rows import Unsuited, paper_rows
from paper_figures.style import VIOLATED, mark, whiskers

COLUMNS = (
    *("truth", "cells", "actions", "dt", "samples"),
    *("measure", "mean", "low", "high", "seeds", "demonstrations"),
)

_ASIDE = 0.025  # share of dt that neighbouring curves are apart
_FIRM = 0.5  # below this share of goals that can be reached, a mean stands for few cases
_PALE = 0.4  # opacity of such a mean


def paper_measure(measures: pd.DataFrame, measure: str) -> pd.DataFrame:
    """The rows of one measure that the paper's figures show, with the column `reachable`.

    Raises:
        Unsuited: there are none, or rows differ in more than truth, cells and dt, or in nothing.
    """
    keys = ["truth", "cells", "dt"]
    tables = {name: measures[measures["measure"] == name] for name in (measure, "reachable")}
    for name, table in tables.items():
        if not len(table):
            raise Unsuited(f"table measures has no measure {name}")
    rows, reachable = (paper_rows(table, keys) for table in tables.values())
    if not rows.duplicated("truth").any():
        raise Unsuited("neither cells nor dt varies")
    share = reachable.rename(columns={"mean": "reachable"})
    return rows.merge(share[[*keys, "reachable"]], on=keys, how="left")


def draw_curves(axes: Axes, rows: pd.DataFrame) -> None:
    """Draw means with their intervals against dt, moved aside so that no bar hides another."""
    groups = list(rows.groupby("cells", sort=True))
    for number, (cells, curve) in enumerate(groups):
        x = curve["dt"] * (1 + _ASIDE * (number - (len(groups) - 1) / 2))
        style = mark(int(cells), number)
        firm = curve["mean"].where(curve["reachable"] >= _FIRM)
        axes.plot(x, firm, color=style["color"], label=f"{cells} cells")
        for few, part in curve.groupby(curve["reachable"] < _FIRM):
            axes.errorbar(
                x[part.index],
                part["mean"],
                yerr=whiskers(part["mean"], part["low"], part["high"]),
                linestyle="",
                capsize=1.5,
                elinewidth=0.7,
                alpha=_PALE if few else 1,
                **style,
            )
    dts = sorted(rows["dt"].unique())
    axes.set_xscale("log")
    axes.set_xticks(dts, labels=[f"{dt:g}" for dt in dts])
    axes.xaxis.set_minor_locator(NullLocator())


def legend_entries(rows: pd.DataFrame) -> list[Line2D]:
    """The legend's mark for each number of cells."""
    return [
        Line2D([], [], label=f"{cells} cells", **mark(int(cells), number))
        for number, cells in enumerate(sorted(rows["cells"].unique()))
    ]


def curve_facts(rows: pd.DataFrame, unit: str) -> Iterator[str]:
    """A line for each mean, with its interval; `unit` follows the mean."""
    for row in rows.itertuples():
        value = f"{row.mean:.3g}{unit} ({row.low:.3g} to {row.high:.3g})"
        yield (
            f"  {row.truth.upper()}, {row.cells} cells, dt {row.dt:g} s: "
            f"{'no value' if pd.isna(row.mean) else value}; goals reached "
            f"{100 * row.reachable:.0f} %"
        )


def common_facts(rows: pd.DataFrame) -> Iterator[str]:
    """What holds for every curve of a figure."""
    yield (
        f"Actions: {rows['actions'].iloc[0]}; start points in a cell along each dimension: "
        f"{rows['samples'].iloc[0]}; seeds: {rows['seeds'].max()}."
    )
    how = (
        "two-level bootstrap intervals of the mean (seeds, then demonstrations within a seed)"
        if rows["seeds"].min() > 1
        else "bootstrap intervals of the mean over demonstrations (there is but one seed)"
    )
    yield f"Uncertainty: bars are 95 % {how}."
    yield (
        f"Pale, and not joined: the tabular agent reaches fewer than {100 * _FIRM:.0f} % of the "
        "goals, and the mean is over those alone. No mark: it reaches none."
    )
    yield "Marks are moved a little aside of their dt, so that no bar hides another."


def name_cases(grid: Sequence[Axes], names: Sequence[str]) -> None:
    """A line a case across all panels, named at the first, whose values are ranks.

    Args:
        grid: panels that share their heights.
        names: of the cases, from the top.
    """
    for axes in grid:
        for line in range(1, len(names)):
            axes.axhline(line - 0.5, color=VIOLATED, linewidth=0.6, zorder=0)
    ranks = grid[0]
    ranks.set_xscale("log")
    ranks.set_xticks((1, 2, 5, 10, 20, 50, 100), labels=["1", "2", "5", "10", "20", "50", ""])
    ranks.xaxis.set_minor_locator(NullLocator())
    ranks.set_yticks(range(len(names)), labels=names)
    ranks.set_ylim(len(names) - 0.5, -0.5)


def draw_dots(axes: Axes, values: pd.DataFrame, y: pd.Series, style: dict[str, str]) -> None:
    """Draw a mark and an interval for each value.

    Args:
        axes: where.
        values: value, lower and upper end of its interval, in this order.
        y: the height of each.
        style: colour, mark and label.
    """
    middle, low, high = (values.iloc[:, column] for column in range(3))
    axes.errorbar(
        middle,
        y,
        xerr=whiskers(middle, low, high),
        linestyle="none",
        markersize=3,
        elinewidth=0.8,
        **style,
    )
