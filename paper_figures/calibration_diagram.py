"""Are beliefs as often right as they are probable? Reliability over simulated worlds."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures.rows import Unsuited
from paper_figures.style import GUIDE, PAGE, RC, STEP_COLOURS, STEP_MARKS, new_figure, whiskers

_KEYS = ("source", "demonstrations", "belief", "bin")
TABLES = {
    "reliability": (
        *_KEYS,
        *("lower", "upper", "predicted", "observed", "low", "high", "weight", "count"),
    )
}
BELIEFS = {
    "each": "every hypothesis,\nexact posterior",
    "selected": "the most likely one,\nexact posterior",
    "corrected": "the most likely one,\n(12) corrected",
    "printed": "the most likely one,\n(12) as printed",
}
SOURCES = {
    "model": "drawn from the tabular model",
    "demonstrator": "shown by the demonstrator",
}
FEW = 20  # bins with fewer beliefs are not drawn


def draw(reliability: pd.DataFrame) -> Figure:
    """Draw a row of panels a source and a column a belief; a curve a number of demonstrations.

    Args:
        reliability: the table of that name.
    """
    table = _sorted(reliability)
    figure, grid = new_figure(
        PAGE, 0.7 + 1.85 * len(SOURCES), nrows=len(SOURCES), ncols=len(BELIEFS), sharey="col"
    )
    numbers = sorted(table["demonstrations"].unique())
    with plt.rc_context(RC):
        for row, source in zip(grid, SOURCES, strict=True):
            for axes, belief in zip(row, BELIEFS, strict=True):
                panel = table[(table["source"] == source) & (table["belief"] == belief)]
                _draw_frame(axes, panel, belief)
                for place, number in enumerate(numbers):
                    style = place % len(STEP_MARKS)
                    curve = panel[(panel["demonstrations"] == number) & _enough(panel)]
                    lengths = whiskers(curve["observed"], curve["low"], curve["high"])
                    axes.errorbar(
                        100 * curve["predicted"],
                        100 * curve["observed"],
                        yerr=100 * lengths,
                        color=STEP_COLOURS[style],
                        marker=STEP_MARKS[style],
                        markersize=3,
                        linewidth=0.7,
                        elinewidth=0.7,
                        label=f"{number} demonstration{'s' if number > 1 else ''}",
                    )
            row[0].set_ylabel(f"{SOURCES[source]}\n\nright [%]")
        for axes, title in zip(grid[0], BELIEFS.values(), strict=True):
            axes.set_title(title)
        for axes in grid[-1]:
            axes.set_xlabel("probability [%]")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(numbers))
    return figure


def facts(reliability: pd.DataFrame) -> str:
    """What the caption says."""
    table = _sorted(reliability)
    lines = [
        "Simulated worlds: each hypothesis as the truth, and none, as often as the prior says.",
        "Marks: of the beliefs in a bin of probabilities, the share that is right; dashed: equal.",
        "Bars: 95 % bootstrap intervals over worlds and over sets of demonstrations in each.",
        f"Bins of fewer than {FEW} beliefs are not drawn, nor what is above 1.",
        "Mean probability and share that is right, over all beliefs of a kind:",
    ]
    for (source, belief, number), rows in table.groupby(["source", "belief", "demonstrations"]):
        inside, beyond = rows[_proper(rows)], rows[~_proper(rows)]
        text = f"  {source}, {belief}, {number}: "
        if len(inside):
            probability, right = (
                np.average(inside[name], weights=inside["weight"])
                for name in ("predicted", "observed")
            )
            text += f"{probability:.3f} probable, {right:.3f} right"
        if len(beyond):
            right = np.average(beyond["observed"], weights=beyond["weight"])
            text += (
                f"{'; ' if len(inside) else ''}{beyond['weight'].sum():.0%} of them are no "
                f"probability, of which {right:.3f} right"
            )
        lines.append(text)
    return "\n".join(lines)


def _sorted(reliability: pd.DataFrame) -> pd.DataFrame:
    """The table in the order of its keys.

    Raises:
        Unsuited: it holds more than one discretisation.
    """
    if reliability.duplicated(list(_KEYS)).any():
        raise Unsuited(f"rows differ in more than {', '.join(_KEYS)}")
    return reliability.sort_values(list(_KEYS), kind="stable")


def _enough(panel: pd.DataFrame) -> pd.Series:
    """Which rows are probabilities, and of enough beliefs."""
    return _proper(panel) & (panel["count"] >= FEW)


def _proper(rows: pd.DataFrame) -> pd.Series:
    """Which rows are probabilities."""
    return np.isfinite(rows["lower"]) & np.isfinite(rows["upper"])


def _draw_frame(axes: Axes, panel: pd.DataFrame, belief: str) -> None:
    """Scales, the diagonal, and how much is outside of them."""
    ticks = [0, 50, 100]
    if belief == "each":  # most hypotheses are unlikely
        ticks = [0, 5, 20, 50, 100]
        for scale in (axes.set_xscale, axes.set_yscale):
            scale("function", functions=(_root, np.square))
    axes.plot([0, 100], [0, 100], color=GUIDE, linewidth=0.7, linestyle="--", zorder=0)
    axes.set_xlim(0, 104)
    axes.set_ylim(0, 104)
    axes.set_xticks(ticks, labels=[str(tick) for tick in ticks])
    axes.set_yticks(ticks, labels=[str(tick) for tick in ticks])
    beyond = panel[~_proper(panel)]
    if len(beyond):
        share = beyond["weight"].sum() / panel["weight"].sum()
        right = np.average(beyond["observed"], weights=beyond["weight"])
        axes.text(
            0.5,
            0.55,
            f"{share:.0%} of them are\nno probability\n({right:.0%} of these right)",
            backgroundcolor="white",
            ha="center",
            va="center",
            fontsize=7,
            transform=axes.transAxes,
        )


def _root(values: np.ndarray) -> np.ndarray:
    """The square root, of what is not negative."""
    return np.sqrt(np.maximum(values, 0.0))
