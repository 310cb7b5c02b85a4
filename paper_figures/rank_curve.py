"""Rank of the truth against the number of demonstrations (the paper's Fig. 5)."""

from __future__ import annotations

import re
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from paper_figures.rows import PAPER, Unsuited, paper_rows
from paper_figures.style import GUIDE, PAGE, RC, mark, new_figure

TABLES = {
    "rank_curve": (
        *("truth", "cells", "actions", "dt", "samples", "demonstrations"),
        *("median", "q25", "q75", "median_low", "median_high", "seeds"),
    )
}

_TICKS = (1, 2, 5, 10, 20, 50, 100)
_MARKED = 4  # demonstrations between the marks of a curve
_KEYS = ("truth", "cells", "dt", "demonstrations")


def draw(rank_curve: pd.DataFrame) -> Figure:
    """Draw a row of panels a dt and, a truth, the rank and the share among the first.

    Args:
        rank_curve: the table of that name: a row a number of demonstrations and setting.
    """
    curves, top = paper_rows(rank_curve, _KEYS), _top(rank_curve)
    if curves["median"].isna().all():
        raise Unsuited("there is no truth to rank")
    truths, dts = sorted(curves["truth"].unique()), sorted(curves["dt"].unique())
    figure, grid = new_figure(
        PAGE * max(1, len(truths)) / 2,
        0.6 + 1.15 * len(dts),
        nrows=len(dts),
        ncols=2 * len(truths),
        sharex=True,
        sharey="col",
        squeeze=False,
    )
    with plt.rc_context(RC):
        for row, dt in enumerate(dts):
            for column, truth in enumerate(truths):
                panel = curves[(curves["dt"] == dt) & (curves["truth"] == truth)]
                left, right = grid[row][2 * column : 2 * column + 2]
                for number, (cells, curve) in enumerate(panel.groupby("cells", sort=True)):
                    # Marks of one curve between those of the others, where curves coincide.
                    style = {**mark(int(cells), number), "markevery": (number % _MARKED, _MARKED)}
                    _draw_rank(left, curve, style)
                    _draw_share(right, curve, top, style)
                left.axhspan(0.9, top, color="black", alpha=0.05, linewidth=0)
                left.set_yscale("log")
                left.set_ylim(0.9, 100)
                left.set_yticks(_TICKS, labels=[str(tick) for tick in _TICKS])
                left.yaxis.set_minor_locator(NullLocator())
                right.set_ylim(-3, 103)
                for axes in (left, right):
                    axes.axvline(PAPER, color=GUIDE, linewidth=0.6, linestyle=":")
                    axes.set_xticks(range(1, int(curves["demonstrations"].max()) + 1, 4))
                left.set_title(f"{truth.upper()}, $\\Delta t$ = {dt:g} s", loc="left")
                left.set_ylabel("rank of truth")
                right.set_ylabel(f"in top {top} [%]")
        for axes in grid[-1]:
            axes.set_xlabel("demonstrations")
        figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def facts(rank_curve: pd.DataFrame) -> str:
    """What the caption says."""
    curves, top = paper_rows(rank_curve, _KEYS), _top(rank_curve)
    share = f"share_top_{top}"
    at = min(PAPER, int(curves["demonstrations"].max()))
    how = (
        "two-level bootstrap intervals (seeds, then subsets)"
        if curves["seeds"].min() > 1
        else "bootstrap intervals over subsets: with one seed they tell nothing of others"
    )
    lines = [
        f"Rank of the true constraint among all hypotheses, {curves['actions'].iloc[0]} actions.",
        "Curves: median over random subsets of the demonstrations and over seeds.",
        "Bands: first to third quartile, the spread between subsets.",
        f"Beside them: share of the subsets that rank the truth among the first {top}.",
        f"Uncertainty: the bands of the shares, and the intervals below, are 95 % {how}.",
        f"Grey: rank 1 to {top}; dotted: {PAPER} demonstrations.",
        f"After {at} demonstrations:",
    ]
    for row in curves[curves["demonstrations"] == at].itertuples():
        part, low, high = (100 * getattr(row, share + end) for end in ("", "_low", "_high"))
        lines.append(
            f"  {row.truth.upper()}, {row.cells} cells, dt {row.dt:g} s: median rank "
            f"{row.median:.3g} ({row.median_low:.3g} to {row.median_high:.3g}), "
            f"in the top {top} {part:.0f} % ({low:.0f} to {high:.0f})"
        )
    return "\n".join(lines)


def _top(rank_curve: pd.DataFrame) -> int:
    """Among how many first hypotheses the table counts the truth."""
    matches = (re.fullmatch(r"share_top_(\d+)", name) for name in rank_curve)
    (top,) = (int(match[1]) for match in matches if match)
    return top


def _draw_rank(axes: Axes, curve: pd.DataFrame, style: dict[str, Any]) -> None:
    """Median and quartiles."""
    x = curve["demonstrations"]
    axes.fill_between(x, curve["q25"], curve["q75"], color=style["color"], alpha=0.15, linewidth=0)
    label = f"{curve['cells'].iloc[0]} cells"
    axes.plot(x, curve["median"], label=label, **style)


def _draw_share(axes: Axes, curve: pd.DataFrame, top: int, style: dict[str, Any]) -> None:
    """Share among the first, in percent, with its interval."""
    middle, low, high = (100 * curve[f"share_top_{top}{end}"] for end in ("", "_low", "_high"))
    x = curve["demonstrations"]
    axes.fill_between(x, low, high, color=style["color"], alpha=0.15, linewidth=0)
    axes.plot(x, middle, **style)
