"""Weights of soft constraints: what is estimated against what is true."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.report.means import share
from paper_figures.style import GUIDE, PAGE, RC, STEP_COLOURS, STEP_MARKS, new_figure, whiskers

TABLES = {
    "soft": ("truth", "weight", "demonstrations", "set", "estimate", "lower", "upper", "verdict"),
}

_WALL = 100.0  # where an infinite weight is drawn [nat/s]
_LEAST = 0.1  # and what is below [nat/s]
_ASIDE = 1.12  # factor between the marks of one weight
_KINDS = ("perhaps no constraint", "undecided", "soft", "as a wall")


def soft_rows(soft: pd.DataFrame) -> pd.DataFrame:
    """A row for each truth, number of demonstrations and true weight.

    Returns:
        `truth`, `demonstrations`, `weight`; how many `sets`; quartiles of the estimate (`low`,
        `median`, `high`); `covers`, the share of intervals that hold the true weight, with
        Wilson's interval `covers_low` and `covers_high`; and a share of sets for each verdict.
    """
    rows = []
    for key, group in soft.groupby(["truth", "demonstrations", "weight"]):
        inside = (group["lower"] <= key[2]) & (key[2] <= group["upper"])
        covers = share(int(inside.sum()), len(group))
        low, median, high = np.quantile(group["estimate"], [0.25, 0.5, 0.75], method="nearest")
        rows.append(
            {
                "truth": key[0],
                "demonstrations": key[1],
                "weight": key[2],
                "sets": len(group),
                "low": low,
                "median": median,
                "high": high,
                "covers": covers.value,
                "covers_low": covers.low,
                "covers_high": covers.high,
                **{kind: float((group["verdict"] == kind).mean()) for kind in _KINDS},
            }
        )
    return pd.DataFrame(rows)


def draw(soft: pd.DataFrame) -> Figure:
    """Draw a panel a truth, the estimates' quartiles, and how often intervals hold the truth."""
    rows = soft_rows(soft)
    truths = sorted(rows["truth"].unique())
    figure, grid = new_figure(PAGE, 2.5, ncols=len(truths) + 1, squeeze=False)
    with plt.rc_context(RC):
        sizes, legend = sorted(rows["demonstrations"].unique()), {}
        for axes, truth in zip(grid[0], truths, strict=False):
            _estimates(axes, rows[rows["truth"] == truth], sizes)
            axes.set_title(str(truth).upper())
            handles, labels = axes.get_legend_handles_labels()
            legend |= dict(zip(labels, handles, strict=True))
        _coverage(grid[0][-1], rows)
        labels = [label for size in sizes if (label := _label(size)) in legend]
        handles = [legend[label] for label in labels]
        figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
    return figure


def _label(size: int) -> str:
    """What the legend says of a number of demonstrations."""
    return f"{size} demonstrations"


def _estimates(axes: plt.Axes, rows: pd.DataFrame, sizes: list[int]) -> None:
    """The quartiles of estimates against true weights, a mark a number of demonstrations."""
    line = [_LEAST, _WALL]
    axes.plot(line, line, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
    for size, some in rows.groupby("demonstrations"):
        number = sizes.index(size)
        x = np.maximum(some["weight"], _LEAST) * _ASIDE ** (2 * number - 1)
        low, median, high = (_drawn(some[name]) for name in ("low", "median", "high"))
        axes.errorbar(
            x,
            median,
            whiskers(median, low, high),
            color=STEP_COLOURS[number],
            marker=STEP_MARKS[number],
            linestyle="none",
            label=_label(size),
        )
    axes.set_xscale("log")
    axes.set_yscale("log")
    ticks, names = [_LEAST, 1, 10, _WALL], ["0", "1", "10", "wall"]
    axes.set_yticks(ticks, names)
    axes.set_xticks(ticks[:-1], names[:-1])
    axes.minorticks_off()
    axes.set_ylim(_LEAST * 0.7, _WALL * 1.4)
    axes.set_xlim(_LEAST * 0.5, 40)
    axes.set_xlabel("true weight [nat/s]")
    axes.set_ylabel("estimate, quartiles [nat/s]")


def _coverage(axes: plt.Axes, rows: pd.DataFrame) -> None:
    """How often intervals hold the true weight, over all truths."""
    axes.axhline(95, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
    for number, (_, some) in enumerate(rows.groupby("demonstrations")):
        for place, (_, each) in enumerate(some.groupby("truth")):
            x = np.maximum(each["weight"], _LEAST) * _ASIDE ** (4 * number - 3 + 2 * place)
            value, low, high = (
                100 * each[name] for name in ("covers", "covers_low", "covers_high")
            )
            axes.errorbar(
                x,
                value,
                whiskers(value, low, high),
                color=STEP_COLOURS[number],
                marker=STEP_MARKS[number],
                linestyle="none",
            )
    axes.set_xscale("log")
    axes.set_xticks([_LEAST, 1, 10], ["0", "1", "10"])
    axes.minorticks_off()
    axes.set_xlim(_LEAST * 0.5, 40)
    axes.set_ylim(min(80.0, 100 * rows["covers_low"].min() - 2), 101)
    axes.set_title("interval holds the truth")
    axes.set_xlabel("true weight [nat/s]")
    axes.set_ylabel("sets [%]")


def _drawn(values: pd.Series) -> pd.Series:
    """Weights as they are drawn: 0 and infinity at the ends of the axis."""
    return values.clip(_LEAST, _WALL)


def facts(soft: pd.DataFrame) -> str:
    """What the caption says."""
    lines = [
        "Sets of demonstrations that the tabular model draws under a cost of each second inside",
        "the truth; the weight that makes them most likely. Medians and quartiles of estimates.",
        "Right: share of sets whose 95 % interval holds the true weight, with Wilson's interval.",
    ]
    for row in soft_rows(soft).itertuples():
        lines.append(
            f"  {row.truth.upper()}, {row.demonstrations} demonstrations, weight {row.weight:g} "
            f"nat/s: median {row.median:.3g}, quartiles {row.low:.3g} to {row.high:.3g}, held by "
            f"{100 * row.covers:.0f} % of {row.sets} intervals"
        )
    return "\n".join(lines)
