"""Where other ways to rank regions put the truth, beside ours, as demonstrations arrive."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from paper_figures.rows import PAPER, Unsuited
from paper_figures.style import (
    DEMONSTRATION,
    GUIDE,
    PAGE,
    RC,
    SAMPLED,
    STEP_COLOURS,
    TRUTH,
    new_figure,
    whiskers,
)

TABLES = {
    "baseline_differences": (
        *("method", "demonstrations", "truths", "points", "rank", "log_rank", "log_rank_low"),
        *("log_rank_high", "log_rank_less_ours", "log_rank_less_ours_low"),
        *("log_rank_less_ours_high", "top", "top_low", "top_high", "top_less_ours"),
        *("top_less_ours_low", "top_less_ours_high"),
    )
}

# Each method as the figure and the report call it, with its colour and mark.
METHODS = {
    "ours": ("ours, with rates", TRUTH, "o"),
    "paper": ("the paper's evidence", DEMONSTRATION, "s"),
    "visits": ("visitation difference", STEP_COLOURS[1], "^"),
    "crossings": ("crossings of sampled paths", SAMPLED, "v"),
    "nearest": ("nearest unvisited", STEP_COLOURS[0], "D"),
    "uniform": ("uniform", GUIDE, "x"),
}
_ASIDE = 0.02  # share of the number of demonstrations that neighbours are apart


def baseline_rows(baseline_differences: pd.DataFrame) -> pd.DataFrame:
    """The table's rows of one model.

    Raises:
        Unsuited: several models are in it.
    """
    if baseline_differences.duplicated(["method", "demonstrations"]).any():
        raise Unsuited("rows differ in more than method and demonstrations")
    return baseline_differences


def draw(baseline_differences: pd.DataFrame) -> Figure:
    """Draw the share in the top 5, and the geometric mean of the rank, against demonstrations."""
    rows = baseline_rows(baseline_differences)
    figure, (top, rank) = new_figure(PAGE, 3.0, ncols=2)
    with plt.rc_context(RC):
        for number, (method, (label, colour, marker)) in enumerate(METHODS.items()):
            own = rows[rows["method"] == method].sort_values("demonstrations")
            x = own["demonstrations"] * (1 + _ASIDE * (number - len(METHODS) / 2))
            style = {"color": colour, "marker": marker, "markersize": 3.5, "elinewidth": 0.7}
            for axes, name, change in ((top, "top", _percent), (rank, "log_rank", _rank)):
                middle, low, high = (change(own[f"{name}{end}"]) for end in ("", "_low", "_high"))
                lengths = whiskers(middle, low, high)
                axes.errorbar(x, middle, yerr=lengths, label=label, linewidth=1, **style)
        for axes in (top, rank):
            axes.set_xscale("log")
            ticks = sorted(rows["demonstrations"].unique())
            axes.set_xticks(ticks, labels=[str(tick) for tick in ticks])
            axes.xaxis.set_minor_locator(NullLocator())
            axes.set_xlabel("demonstrations")
        top.set_ylabel("truth in the top 5 [%]")
        top.set_ylim(-3, 103)
        rank.set_ylabel("rank of truth")
        rank.set_yscale("log")
        rank.set_yticks((1, 2, 5, 10, 20, 50), labels=["1", "2", "5", "10", "20", "50"])
        rank.yaxis.set_minor_locator(NullLocator())
        handles, labels = top.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def facts(baseline_differences: pd.DataFrame) -> str:
    """What the caption says."""
    rows = baseline_rows(baseline_differences)
    first = rows.iloc[0]
    lines = [
        "Ways to rank regions on the same demonstrations, over random subsets: how often the truth",
        "is in the top 5, and the geometric mean of its rank (ties share their mean rank). Means",
        f"over {first['points']} points of {first['truths']} truths; lines: 95 % bootstrap",
        f"intervals over truths and seeds. After {PAPER} demonstrations:",
    ]
    for row in rows[rows["demonstrations"] == PAPER].itertuples():
        lines.append(
            f"  {METHODS[row.method][0]}: in the top 5 {100 * row.top:.0f} % "
            f"({100 * row.top_less_ours:+.0f} % against ours)"
        )
    return "\n".join(lines)


def _percent(values: pd.Series) -> pd.Series:
    """Shares in percent."""
    return 100 * values


def _rank(values: pd.Series) -> pd.Series:
    """Ranks from their logarithms."""
    return values.map(math.exp)
