"""Rank of the true constraint against the number of demonstrations (compare the paper's Fig. 5)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from paper_figures.style import COLUMN, RC, mark, new_figure

_TICKS = (1, 2, 5, 10, 20, 50, 100)


def draw(rank_quantiles: pd.DataFrame) -> Figure:
    """Draw medians with bands from the first to the third quartile, a panel a dt and truth.

    Args:
        rank_quantiles: the table of that name: truth, cells, actions, dt, demonstrations, q25,
            median, q75; of one number of actions.
    """
    truths = sorted(rank_quantiles["truth"].unique())
    dts = sorted(rank_quantiles["dt"].unique())
    actions = rank_quantiles["actions"].iloc[0]
    figure, grid = new_figure(
        COLUMN * max(1, len(truths)),
        0.5 + 1.5 * len(dts),
        nrows=len(dts),
        ncols=len(truths),
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    with plt.rc_context(RC):
        for row, dt in enumerate(dts):
            for column, truth in enumerate(truths):
                axes = grid[row][column]
                panel = rank_quantiles[
                    (rank_quantiles["dt"] == dt) & (rank_quantiles["truth"] == truth)
                ]
                for number, (cells, curve) in enumerate(panel.groupby("cells", sort=True)):
                    curve = curve.sort_values("demonstrations")
                    x, style = curve["demonstrations"], mark(int(cells), number)
                    band = (curve["q25"], curve["q75"])
                    axes.fill_between(x, *band, color=style["color"], alpha=0.15, linewidth=0)
                    axes.plot(x, curve["median"], label=f"{cells} cells", markevery=4, **style)
                axes.axhspan(0.9, 5, color="#000000", alpha=0.05, linewidth=0, label="top 5")
                axes.axvline(9, color="#888888", linewidth=0.6, linestyle=":")
                axes.set_yscale("log")
                axes.set_ylim(0.9, 100)
                axes.set_yticks(_TICKS, labels=[str(tick) for tick in _TICKS])
                axes.yaxis.set_minor_locator(NullLocator())
                axes.set_xticks(range(1, int(panel["demonstrations"].max()) + 1, 4))
                axes.set_title(f"truth {truth.upper()}, $\\Delta t$ = {dt:g} s, {actions} actions")
                if row == len(dts) - 1:
                    axes.set_xlabel("demonstrations")
                if column == 0:
                    axes.set_ylabel("rank of the truth")
        figure.legend(*grid[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure
