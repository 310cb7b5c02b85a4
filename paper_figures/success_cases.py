"""What success owes to single choices, and the one number that governs it."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures.curves import draw_dots
from paper_figures.rows import DEFAULT, Unsuited, by_tasks, with_cases
from paper_figures.style import (
    GUIDE,
    OTHER_COLOURS,
    OTHER_MARKS,
    PAGE,
    RC,
    TASKS,
    VIOLATED,
    new_figure,
)

_KEYS = ("truth", "cells", "actions", "dt", "samples")
_ENDS = ("", "_low", "_high")
_SHARES = ("top_2_overlap", "top_2_inside")
TABLES = {
    "first_ranking": ("truth", "covered_by_truth", "overlaps_truth"),
    "cases": (*_KEYS, "case"),
    "measures": (*_KEYS, "measure", "mean"),
    "rank_curve": (
        *(*_KEYS, "demonstrations", "seeds"),
        *(f"{name}{end}" for name in _SHARES for end in _ENDS),
    ),
}
EACH = "truth"

_AT = (5, 10)  # demonstrations of the columns
_TITLES = {"top_2_overlap": "overlap", "top_2_inside": "inside"}
_SPREAD = 0.5  # of a row's height that its marks take
_EVIDENCE = "truth_probability"


def draw(
    first_ranking: pd.DataFrame,
    cases: pd.DataFrame,
    measures: pd.DataFrame,
    rank_curve: pd.DataFrame,
) -> Figure:
    """Draw shares after 5 and 10 demonstrations, a line a case, and all of them against evidence.

    Args:
        first_ranking: tells whether the truth lies across hypotheses.
        cases: which settings are which case's.
        measures: of each setting, the mean probability that an agent without constraint violates
            the truth.
        rank_curve: shares of random sets of demonstrations, a row a number of them.
    """
    table = _shares(first_ranking, cases, measures, rank_curve)
    names = list(table["case"].drop_duplicates())
    columns = [(name, count) for name in _SHARES for count in _counts(table)]
    figure, grid = new_figure(
        PAGE,
        1.1 + 0.24 * len(names),
        ncols=len(columns) + 1,
        width_ratios=(*(1,) * len(columns), 1.7),
    )
    with plt.rc_context(RC):
        for number, (axes, (name, count)) in enumerate(zip(grid, columns, strict=False)):
            kinds = list(by_tasks(table))
            for place, (words, rows) in enumerate(kinds):
                after = rows[rows["demonstrations"] == count]
                y = after["case"].map(names.index) + _SPREAD * (place - (len(kinds) - 1) / 2)
                shares = 100 * after[[f"{name}{end}" for end in _ENDS]]
                draw_dots(axes, shares, y, _style(words))
            for line in range(1, len(names)):
                axes.axhline(line - 0.5, color=VIOLATED, linewidth=0.6, zorder=0)
            axes.set_yticks(range(len(names)), labels=names if number == 0 else [""] * len(names))
            axes.set_ylim(len(names) - 0.5, -0.5)
            axes.set_xlim(-4, 104)
            axes.set_xticks((0, 50, 100))
            axes.set_title(f"{_TITLES[name]},\n{count} shown")
            axes.set_xlabel("sets [%]")
        _draw_evidence(grid[-1], table)
        handles = [
            Line2D([], [], linestyle="", label=words, **_style(words))
            for words, _ in by_tasks(table)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


def facts(
    first_ranking: pd.DataFrame,
    cases: pd.DataFrame,
    measures: pd.DataFrame,
    rank_curve: pd.DataFrame,
) -> str:
    """What the caption says."""
    table = _shares(first_ranking, cases, measures, rank_curve)
    lines = [
        "Share of random sets of demonstrations after which both of the best two hypotheses "
        "overlap the true constraint, or lie inside it, when one choice is changed.",
        "Right: the same share (overlap) for every case and 1 to "
        f"{table['demonstrations'].max()} demonstrations, against the evidence that a set holds on "
        "average: how many of its tasks an agent without constraint would violate the best "
        "hypothesis inside the truth in.",
        "Uncertainty: lines are 95 % two-level bootstrap intervals (seeds, then sets).",
    ]
    for words, rows in by_tasks(table):
        for row in rows[rows["demonstrations"].isin(_counts(table))].to_dict("records"):
            shares = ", ".join(
                f"{_TITLES[name]} "
                + "{:.0f} % ({:.0f} to {:.0f})".format(*(100 * row[name + end] for end in _ENDS))
                for name in _SHARES
            )
            lines.append(
                f"  {words}, {row['case']}, {row['demonstrations']} demonstrations: {shares}; "
                f"evidence {row['evidence']:.3g}"
            )
    return "\n".join(lines)


def _shares(
    first_ranking: pd.DataFrame,
    cases: pd.DataFrame,
    measures: pd.DataFrame,
    rank_curve: pd.DataFrame,
) -> pd.DataFrame:
    """The shares in `rank_curve` with their case and the evidence of a set of demonstrations.

    Raises:
        Unsuited: the truth is made of whole hypotheses, so that to overlap it is to lie inside.
    """
    if not (first_ranking["overlaps_truth"] & ~first_ranking["covered_by_truth"]).any():
        raise Unsuited("the truth is made of whole hypotheses")
    chance = with_cases(cases, measures[measures["measure"] == _EVIDENCE])
    keys = [name for name in cases if name not in ("choice", "value")]
    table = with_cases(cases, rank_curve).merge(chance[[*keys, "mean"]], on=keys)
    return table.assign(evidence=table["demonstrations"] * table["mean"])


def _counts(table: pd.DataFrame) -> list[int]:
    """The numbers of demonstrations of the columns, or the largest that there is."""
    counts = set(table["demonstrations"])
    return [count for count in _AT if count in counts] or [max(counts)]


def _style(words: str) -> dict[str, str]:
    """Colour and mark of a kind of tasks."""
    colour, mark = TASKS.get(words, (OTHER_COLOURS[0], OTHER_MARKS[0]))
    return {"color": colour, "marker": mark}


def _draw_evidence(axes: Axes, table: pd.DataFrame) -> None:
    """All cases and numbers of demonstrations; the default's marks are filled, and joined."""
    for words, rows in by_tasks(table):
        style = _style(words)
        for case, curve in rows.groupby("case", sort=False):
            is_default = case == DEFAULT
            axes.plot(
                curve["evidence"],
                100 * curve["top_2_overlap"],
                linewidth=1.1 if is_default else 0.4,
                alpha=1 if is_default else 0.45,
                markersize=3 if is_default else 2,
                markerfacecolor=style["color"] if is_default else "white",
                markeredgewidth=0.5,
                zorder=3 if is_default else 2,
                **style,
            )
    axes.axhline(100, color=GUIDE, linewidth=0.4, zorder=0)
    axes.set_ylim(-3, 103)
    axes.set_title("overlap, all cases")
    axes.set_xlabel("evidence\n[violations expected]")
    axes.set_ylabel("sets [%]")
