"""Rank of the truth against the number of demonstrations (the paper's Fig. 5)."""

from __future__ import annotations

import re
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
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
_PANELS = 10  # at most
_MARKED = 4  # demonstrations between the marks of a curve
_KEYS = ("truth", "cells", "dt", "demonstrations")


def draw(rank_curve: pd.DataFrame) -> Figure:
    """Draw a panel a truth and dt, at most ten.

    Args:
        rank_curve: the table of that name: a row a number of demonstrations and setting.
    """
    curves, top = paper_rows(rank_curve, _KEYS), _top(rank_curve)
    if curves["median"].isna().all():
        raise Unsuited("there is no truth to rank")
    truths, dts = sorted(curves["truth"].unique()), _shown(curves)
    figure, grid = new_figure(
        PAGE,
        0.75 + 1.35 * len(truths),
        nrows=len(truths),
        ncols=len(dts),
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    with plt.rc_context(RC):
        for truth, row in zip(truths, grid, strict=True):
            for dt, axes in zip(dts, row, strict=True):
                panel = curves[(curves["dt"] == dt) & (curves["truth"] == truth)]
                for number, (cells, curve) in enumerate(panel.groupby("cells", sort=True)):
                    # Marks of one curve between those of the others, where curves coincide.
                    style = {**mark(int(cells), number), "markevery": (number % _MARKED, _MARKED)}
                    _draw_rank(axes, curve, style)
                axes.axhspan(0.9, top, color="black", alpha=0.05, linewidth=0)
                axes.axvline(PAPER, color=GUIDE, linewidth=0.6, linestyle=":")
                axes.set_title(f"{truth.upper()}, $\\Delta t$ = {dt:g} s", loc="left")
            row[0].set_ylabel("rank of truth")
        first = grid[0][0]
        first.set_yscale("log")
        first.set_ylim(0.9, 100)
        first.set_yticks(_TICKS, labels=[str(tick) for tick in _TICKS])
        first.yaxis.set_minor_locator(NullLocator())
        first.set_xticks(range(1, int(curves["demonstrations"].max()) + 1, 4))
        for axes in grid[-1]:
            axes.set_xlabel("demonstrations")
        entries = [
            *first.get_legend_handles_labels()[0],
            Patch(facecolor="black", alpha=0.15, linewidth=0, label="quartiles"),
            Patch(facecolor="black", alpha=0.05, linewidth=0, label=f"rank 1 to {top}"),
            Line2D([], [], color=GUIDE, linewidth=0.6, linestyle=":", label=f"after {PAPER}"),
        ]
        figure.legend(handles=entries, loc="outside lower center", ncols=len(entries))
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
        f"Uncertainty: the intervals below are 95 % {how}.",
        f"Grey: rank 1 to {top}; dotted: {PAPER} demonstrations.",
        *_left_out(curves),
        f"After {at} demonstrations, and the share of subsets with the truth in the top {top}:",
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


def _shown(curves: pd.DataFrame) -> list[float]:
    """The time steps that have panels: as many as fit, evenly chosen."""
    dts = sorted(curves["dt"].unique())
    room = max(1, _PANELS // curves["truth"].nunique())
    if len(dts) <= room:
        return dts
    return [dts[round(at)] for at in np.linspace(0, len(dts) - 1, room)]


def _left_out(curves: pd.DataFrame) -> list[str]:
    """Which time steps have no panel."""
    dts = sorted(set(curves["dt"]) - set(_shown(curves)))
    return [f"No panel has room for dt {', '.join(f'{dt:g}' for dt in dts)} s."] if dts else []


def _draw_rank(axes: Axes, curve: pd.DataFrame, style: dict[str, Any]) -> None:
    """Median and quartiles."""
    x = curve["demonstrations"]
    axes.fill_between(x, curve["q25"], curve["q75"], color=style["color"], alpha=0.15, linewidth=0)
    label = f"{curve['cells'].iloc[0]} cells" if curve["cells"].iloc[0] else "no cells"
    axes.plot(x, curve["median"], label=label, **style)
