"""What the measures owe to each choice that the paper leaves open, one at a time."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.curves import draw_dots, name_cases
from paper_figures.rows import DEFAULT, PAPER, Unsuited
from paper_figures.style import CELL_COLOURS, CELL_MARKS, GUIDE, PAGE, RC, new_figure

_KEYS = ("truth", "cells", "actions", "dt", "samples")
TABLES = {
    "cases": (*_KEYS, "case", "choice", "value"),
    "measures": (*_KEYS, "measure", "mean", "low", "high"),
    "rank_curve": (*_KEYS, "demonstrations", "median", "median_low", "median_high"),
}
EACH = "truth"

_TOP = "share_top_5"
# Column, title, factor, and the limits of its axis.
_PANELS = {
    "rank": ("median rank", 1, (0.8, 110)),
    "top": ("truth in the top 5", 100, (-4, 104)),
    "final_state_error": ("final-state error", 1, None),
    "violation_distance": ("violation distance", 1, None),
}
_UNITS = {
    "rank": "rank of truth",
    "top": "subsets [%]",
    "final_state_error": "error [of the ranges]",
    "violation_distance": "distance [regions]",
}
_SPREAD = 0.7  # of a row's height that its marks take


def case_rows(
    cases: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame
) -> pd.DataFrame:
    """The main numbers of each case at each setting, with their 95 % intervals.

    Args:
        cases, measures, rank_curve: the study's tables of these names.

    Returns:
        The columns of `cases`, its rows in their order, and `<name>`, `<name>_low`, `<name>_high`
        for `rank` (the median) and `top` (share in the top 5) after 9 demonstrations, or as many
        as there are, `final_state_error` and `violation_distance`.

    Raises:
        Unsuited: no case is the default, or a case has several values at one setting.
    """
    if DEFAULT not in set(cases["case"]):
        raise Unsuited(f"no case is named {DEFAULT}")
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    after = min(PAPER, rank_curve["demonstrations"].max())
    at = rank_curve[rank_curve["demonstrations"] == after]
    parts = [
        at[[*keys, "median", "median_low", "median_high"]].set_axis(
            [*keys, *_limits("rank")], axis=1
        ),
        at[[*keys, _TOP, f"{_TOP}_low", f"{_TOP}_high"]].set_axis([*keys, *_limits("top")], axis=1),
    ]
    for name in ("final_state_error", "violation_distance"):
        part = measures[measures["measure"] == name][[*keys, "mean", "low", "high"]]
        parts.append(part.set_axis([*keys, *_limits(name)], axis=1))
    joined = cases
    for part in parts:
        joined = joined.merge(part, how="left", on=keys)
    if joined.duplicated(["case", *_KEYS]).any():
        raise Unsuited(f"rows of one case differ in more than {', '.join(_KEYS)}")
    return joined


def draw(cases: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame) -> Figure:
    """Draw a line a case and a panel a number; marks tell the cells and the time step."""
    table = case_rows(cases, measures, rank_curve)
    names = list(table["case"].drop_duplicates())
    series = _series(table)
    figure, grid = new_figure(PAGE, 0.8 + 0.24 * len(names), ncols=len(_PANELS), sharey=True)
    with plt.rc_context(RC):
        for axes, (name, (title, factor, limits)) in zip(grid, _PANELS.items(), strict=True):
            for number, (label, style, of_series) in enumerate(series):
                shift = _SPREAD * ((number + 0.5) / len(series) - 0.5)
                y = of_series["case"].map(names.index) + shift
                draw_dots(axes, factor * of_series[_limits(name)], y, {**style, "label": label})
                default = of_series[of_series["case"] == DEFAULT]
                if len(default):
                    x = factor * float(default[name].iloc[0])
                    axes.axvline(x, color=style["color"], linewidth=0.5, linestyle=":", zorder=0)
            axes.set_title(title)
            axes.set_xlabel(_UNITS[name])
            if limits:
                axes.set_xlim(*limits)
        name_cases(grid, names)
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(series))
    return figure


def facts(cases: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame) -> str:
    """What the caption says."""
    table = case_rows(cases, measures, rank_curve)
    after = min(PAPER, rank_curve["demonstrations"].max())
    first = table.iloc[0]
    lines = [
        f"Truth {first['truth'].upper()}: what single choices change, all others at their default.",
        f"Rank and share in the top 5: after {after} demonstrations, over random subsets of them.",
        "Lines: 95 % bootstrap intervals (of rank and share over subsets, of the others over",
        "demonstrations); dotted: the default's value.",
        "Cases, with median rank, share in the top 5, final-state error, violation distance:",
    ]
    for row in table.to_dict("records"):
        values = ", ".join(
            f"{factor * row[name]:.3g} ({factor * row[f'{name}_low']:.3g} to "
            f"{factor * row[f'{name}_high']:.3g})"
            for name, (_, factor, _) in _PANELS.items()
        )
        lines.append(f"  {row['case']}, {row['cells']} cells, dt {row['dt']:g} s: {values}")
    return "\n".join(lines)


def _limits(name: str) -> list[str]:
    """The columns of a number and of its interval."""
    return [name, f"{name}_low", f"{name}_high"]


def _series(table: pd.DataFrame) -> list[tuple[str, dict[str, str], pd.DataFrame]]:
    """The settings of the default case: a label, a mark, and all rows at or nearest to it."""
    default = table[table["case"] == DEFAULT].sort_values(["dt", "cells"])
    series = []
    for number, row in enumerate(default.itertuples()):
        near = table[table["dt"] == row.dt]
        gaps = near.assign(gap=(near["cells"] / row.cells).where(near["cells"] >= row.cells))
        members = gaps[gaps["gap"] < 1.5].drop(columns="gap")
        repeated = (default["cells"] == row.cells).idxmax() != row.Index
        style = {
            "color": "black" if repeated else CELL_COLOURS.get(row.cells, GUIDE),
            "marker": "D" if repeated else CELL_MARKS.get(row.cells, "Pv*"[number % 3]),
        }
        series.append((f"{row.cells} cells, $\\Delta t$ = {row.dt:g} s", style, members))
    return series
