"""Do forecasts of the tabular model come true? Before and after they are calibrated."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.rows import Unsuited
from paper_figures.style import COLUMN, GUIDE, RC, STEP_COLOURS, STEP_MARKS, new_figure, whiskers

TABLES = {
    "forecasts": (
        *("map", "lower", "upper", "count", "forecast", "crossed", "low", "high"),
        *("log_score", "brier", "off_by"),
    )
}
KINDS = {0: "Phi of the tabular model", 1: "calibrated, other tasks"}
FEW = 20  # bins with fewer forecasts are not drawn


def draw(forecasts: pd.DataFrame) -> Figure:
    """Draw the share of regions that are crossed against their forecasts, a curve a kind.

    Args:
        forecasts: the table of that name.
    """
    _check(forecasts)
    figure, axes = new_figure(COLUMN, COLUMN)
    axes.plot([0, 100], [0, 100], color=GUIDE, linewidth=0.7, linestyle="--", zorder=0)
    for place, (kind, label) in enumerate(KINDS.items()):
        bins = forecasts[(forecasts["map"] == kind) & (forecasts["count"] >= FEW)]
        lengths = whiskers(bins["crossed"], bins["low"], bins["high"])
        axes.errorbar(
            100 * bins["forecast"],
            100 * bins["crossed"],
            yerr=100 * lengths,
            color=STEP_COLOURS[2 - 2 * place],
            marker=STEP_MARKS[place],
            markersize=3,
            linewidth=0.7,
            elinewidth=0.7,
            label=label,
        )
    axes.set_xlim(0, 104)
    axes.set_ylim(0, 104)
    axes.set_xlabel("forecast of crossing [%]")
    axes.set_ylabel("regions that are crossed [%]")
    with plt.rc_context(RC):
        axes.legend(loc="upper left")
    return figure


def facts(forecasts: pd.DataFrame) -> str:
    """What the caption says."""
    _check(forecasts)
    lines = [
        "Simulated demonstrations without a constraint: of the pairs of a task and a region with a",
        "forecast in a bin, the share that is crossed; dashed: equal. Bars: 95 % bootstrap",
        f"intervals over tasks. Bins of fewer than {FEW} pairs are not drawn, nor pairs that a",
        "task's ends or the reach of the tabular agent make certain.",
    ]
    for kind, label in KINDS.items():
        rows = forecasts[forecasts["map"] == kind]
        if len(rows):
            first = rows.iloc[0]
            lines.append(
                f"  {label}: {rows['count'].sum()} pairs, off by {first['off_by']:.3f}, Brier "
                f"score {first['brier']:.4f}, log score {first['log_score']:.4f} nat"
            )
    return "\n".join(lines)


def _check(forecasts: pd.DataFrame) -> None:
    """Raise if there are no forecasts, or those of more than one discretisation.

    Raises:
        Unsuited: so it is.
    """
    if forecasts.empty:
        raise Unsuited("the demonstrator could not do enough tasks for a map of forecasts")
    if forecasts.duplicated(["map", "lower"]).any():
        raise Unsuited("rows differ in more than map, lower")
