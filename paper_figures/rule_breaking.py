"""Who finds the truth when some demonstrators ignore it: with no rate of rule breaking, or one."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from paper_figures.rows import Unsuited
from paper_figures.style import GUIDE, PAGE, RC, STEP_COLOURS, STEP_MARKS, new_figure, whiskers

RATE = "demonstrations.rule_breaking"
TABLES = {
    "cases": ("truth", RATE, "case", "value"),
    "rank_curve": ("truth", RATE, "demonstrations", "median", "median_low", "share_top_5"),
}

SET = 20  # demonstrations
_NAMES = {
    "median": ("rank", ("median_low", "median_high")),
    "share_top_5": ("top", ("share_top_5_low", "share_top_5_high")),
}
_ASIDE = 0.35  # between the marks of one rate [%]


def rule_breaking_rows(cases: pd.DataFrame, rank_curve: pd.DataFrame) -> pd.DataFrame:
    """A row for each truth, share of rule breaking and way to infer.

    Returns:
        `truth`; `rate`, the share that breaks rules; `case` and its `value`, how it is inferred;
        `demonstrations` of a set; `rank`, the median, and `top`, the share in the top 5, after so
        many, each with `_low` and `_high`.
    """
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    at = rank_curve[rank_curve["demonstrations"] == min(SET, rank_curve["demonstrations"].max())]
    rows = cases.merge(at, on=keys, how="left", validate="one_to_one")
    for column, (name, ends) in _NAMES.items():
        renamed = [name, f"{name}_low", f"{name}_high"]
        rows[renamed] = rows[[column, *ends]]
    return rows.rename(columns={RATE: "rate"}).sort_values(["truth", "case", "rate"])


def draw(cases: pd.DataFrame, rank_curve: pd.DataFrame) -> Figure:
    """Draw rank and share in the top 5 against the share of rule breaking, two panels a truth."""
    rows = rule_breaking_rows(cases, rank_curve)
    truths = sorted(rows["truth"].unique())
    if rows["rate"].nunique() < 2:
        raise Unsuited("all points have the same share of rule breaking")
    figure, grid = new_figure(
        PAGE,
        2.4,
        ncols=2 * len(truths),
        sharex=True,
        squeeze=False,
        width_ratios=[1, 1] * len(truths),
    )
    with plt.rc_context(RC):
        for place, truth in enumerate(truths):
            for axes, name, factor in zip(
                grid[0][2 * place :], ("rank", "top"), (1, 100), strict=False
            ):
                ways = rows[rows["truth"] == truth].groupby("case", sort=False)
                for number, (case, curve) in enumerate(ways):
                    middle, low, high = (
                        factor * curve[name + end] for end in ("", "_low", "_high")
                    )
                    axes.errorbar(
                        100 * curve["rate"] + _ASIDE * (number - 0.5),
                        middle,
                        yerr=whiskers(middle, low, high),
                        color=STEP_COLOURS[2 * number % 4],
                        marker=STEP_MARKS[number],
                        linestyle="--" if number == 0 else "-",
                        elinewidth=0.8,
                        label=_words(str(case)),
                    )
                axes.set_xlabel("rule-breaking [%]")
                axes.set_xticks(sorted(100 * rows["rate"].unique()))
            ranks, shares = grid[0][2 * place : 2 * place + 2]
            ranks.set_title(f"{truth.upper()}: median rank")
            ranks.set_yscale("log")
            ranks.set_yticks(
                (1, 2, 5, 10, 20, 50, 100), labels=["1", "2", "5", "10", "20", "50", "100"]
            )
            ranks.yaxis.set_minor_locator(NullLocator())
            ranks.set_ylim(0.8, 120)
            ranks.set_ylabel("rank of truth")
            ranks.axhline(5, color=GUIDE, linewidth=0.8, linestyle=":", zorder=0)
            shares.set_title(f"{truth.upper()}: in the top 5")
            shares.set_ylim(-4, 104)
            shares.set_ylabel("sets [%]")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
    return figure


def facts(cases: pd.DataFrame, rank_curve: pd.DataFrame) -> str:
    """What the caption says."""
    rows = rule_breaking_rows(cases, rank_curve)
    lines = [
        f"Sets of {rows['demonstrations'].iloc[0]} demonstrations, of which each ignores the "
        "constraint with the probability shown.",
        "Inferred as if nobody did (a violation excludes a hypothesis), and with the rate that "
        "makes the set most likely.",
        "Bars: 95 % bootstrap intervals over seeds and sets; dotted: rank 5.",
    ]
    for row in rows.itertuples():
        lines.append(
            f"  {row.truth.upper()}, {100 * row.rate:g} %, {_words(row.case)}: median rank "
            f"{row.rank:g} ({row.rank_low:g} to {row.rank_high:g}), in the top 5 "
            f"{100 * row.top:.0f} % ({100 * row.top_low:.0f} to {100 * row.top_high:.0f})"
        )
    return "\n".join(lines)


def _words(case: str) -> str:
    """How a case infers."""
    return {"eps: 0": "taken for nobody", "eps: estimated": "rate estimated"}.get(case, case)
