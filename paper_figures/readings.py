"""Readings of the paper: how many pairs are kept against how soon the truth is found with them."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paper_figures.rows import PAPER, Unsuited
from paper_figures.style import GUIDE, PAGE, RC, STEP_COLOURS, new_figure, whiskers

_KEYS = ("truth", "case")
TABLES = {
    "cases": ("truth", "case", "choice", "value"),
    "summary": ("truth", "seed", "pairs", "kept", "demonstrations"),
    "measures": ("truth", "measure", "mean", "low", "high"),
    "rank_curve": ("truth", "demonstrations", "median", "share_top_5"),
}

FREE, CLIPPED, STRAIGHT = "free", "clipped", "no winding"
PAPER_KEPT = 0.65  # share of the pairs that the paper keeps
_SPEEDS = " rad/s"
_TOP = "share_top_5"
_LATE = 20  # demonstrations, beside the paper's 9


def reading_rows(
    cases: pd.DataFrame, summary: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame
) -> pd.DataFrame:
    """A row for each truth and reading.

    Args:
        cases, summary, measures, rank_curve: the study's tables of these names.

    Returns:
        `truth`; `case`; `choice`, the speed in words; `value`, the rest of the name; `pairs` and
        `kept` of all seeds; `median` rank and `top`, the share in the top 5, with `top_low` and
        `top_high`, after 9 demonstrations; `top_late` after 20 or as many as there are; `expected`,
        how often 9 demonstrations of the unconstrained agent would enter the truth, with its ends.

    Raises:
        Unsuited: cases that are not named after speeds.
    """
    if not cases["choice"].str.endswith(_SPEEDS).all():
        raise Unsuited("no readings of the paper")
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    pairs = summary.groupby(keys, dropna=False)[["pairs", "kept"]].sum().reset_index()
    counts = rank_curve["demonstrations"]
    early, late = (
        rank_curve[counts == min(size, counts.max())][[*keys, "median", _TOP, *_ends(_TOP)]]
        for size in (PAPER, _LATE)
    )
    early = early.rename(columns=lambda name: name.replace(_TOP, "top"))
    late = late[[*keys, _TOP]].rename(columns={_TOP: "top_late"})
    evidence = measures[measures["measure"] == "truth_probability"]
    evidence = evidence[[*keys, "mean", "low", "high"]].set_axis(
        [*keys, "expected", *_ends("expected")], axis=1
    )
    rows = cases
    for part in (pairs, early, late, evidence):
        rows = rows.merge(part, on=keys, how="left", validate="one_to_one")
    rows[["expected", *_ends("expected")]] *= PAPER
    return rows


def draw(
    cases: pd.DataFrame, summary: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame
) -> Figure:
    """Draw a panel a truth, kept pairs against found truths, and one of the reason."""
    rows = reading_rows(cases, summary, measures, rank_curve)
    truths = sorted(rows["truth"].unique())
    figure, grid = new_figure(PAGE, 2.9, ncols=len(truths) + 1, sharey=True)
    with plt.rc_context(RC):
        for axes, truth in zip(grid, truths, strict=False):
            of_truth = rows[rows["truth"] == truth]
            _draw_readings(axes, of_truth, 100 * of_truth["kept"] / of_truth["pairs"])
            axes.axvline(100 * PAPER_KEPT, color=GUIDE, linewidth=0.8, linestyle=":", zorder=0)
            axes.set_title(f"{truth.upper()}: kept and found")
            axes.set_xlabel("pairs kept [%]")
        _draw_readings(grid[-1], rows, rows["expected"])
        grid[-1].set_title("both: what 9 demonstrations hold")
        grid[-1].set_xlabel("expected entries [demonstrations]")
        for axes in grid:
            axes.axhline(50, color=GUIDE, linewidth=0.8, linestyle=":", zorder=0)
        grid[0].set_ylim(-4, 104)
        grid[0].set_ylabel(f"truth in the top 5 after {PAPER} [%]")
        figure.legend(handles=_legend(rows), loc="outside lower center", ncols=4)
    return figure


def facts(
    cases: pd.DataFrame, summary: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame
) -> str:
    """What the caption says."""
    rows = reading_rows(cases, summary, measures, rank_curve)
    lines = [
        "Readings of the paper: the largest speed of starts and goals, controls free or clipped to",
        "the range of the actions, paths that may wind or not. Upright lines: 65 % kept, as in the",
        "paper; level ones: found in half of the sets. Bars: 95 % bootstrap intervals over seeds",
        "and sets. Expected entries: sum over 9 demonstrations of the probability that the tabular",
        "agent, were nothing forbidden, enters the truth.",
    ]
    for row in rows.itertuples():
        lines.append(
            f"  {row.truth.upper()}, {row.case}: {row.kept} of {row.pairs} pairs kept, in the top "
            f"5 {100 * row.top:.0f} % ({100 * row.top_low:.0f} to {100 * row.top_high:.0f}) after "
            f"{PAPER} and {100 * row.top_late:.0f} % after {_LATE}, expected entries "
            f"{row.expected:.2f}"
        )
    return "\n".join(lines)


def _draw_readings(axes: Axes, rows: pd.DataFrame, x: pd.Series) -> None:
    """A mark with its interval for each reading."""
    for place, row in zip(x, rows.itertuples(), strict=True):
        style = _style(row.choice, row.value, sorted(set(rows["choice"])))
        axes.errorbar(
            place,
            100 * row.top,
            yerr=100 * whiskers([row.top], [row.top_low], [row.top_high]),
            elinewidth=0.7,
            linestyle="",
            **style,
        )


def _style(speed: str, value: str, speeds: list[str]) -> dict[str, str]:
    """A colour a speed, a mark for winding or not, hollow where controls are clipped."""
    colour = STEP_COLOURS[speeds.index(speed) % len(STEP_COLOURS)]
    return {
        "color": colour,
        "marker": "^" if STRAIGHT in value else "o",
        "markerfacecolor": "white" if CLIPPED in value else colour,
    }


def _legend(rows: pd.DataFrame) -> list[Line2D]:
    """What colours, marks and fillings mean."""
    speeds = sorted(set(rows["choice"]))
    blank = {"linestyle": "", "color": GUIDE}
    return [
        *(
            Line2D([], [], linestyle="", marker="s", color=colour, label=f"speeds up to {speed}")
            for speed, colour in zip(speeds, STEP_COLOURS, strict=False)
        ),
        Line2D([], [], marker="o", label="paths may wind", **blank),
        Line2D([], [], marker="^", label="no winding", **blank),
        Line2D([], [], marker="s", label="controls free", **blank),
        Line2D([], [], marker="s", markerfacecolor="white", label="clipped", **blank),
    ]


def _ends(name: str) -> list[str]:
    """The columns of an interval."""
    return [f"{name}_low", f"{name}_high"]
