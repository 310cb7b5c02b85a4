"""How fast the truth is found if tasks are chosen for what they teach, against random tasks."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.rows import Unsuited
from paper_figures.style import DEMONSTRATION, GUIDE, PAGE, RC, TRUTH, new_figure

SAVED = (
    "truth source until repetitions longest chosen_median chosen_median_low chosen_median_high "
    "random_median random_median_low random_median_high median_ratio median_ratio_low "
    "median_ratio_high mean_ratio mean_ratio_low mean_ratio_high chosen_share random_share"
)
TABLES = {
    "unfound": ("truth", "source", "until", "way", "demonstrations", "share"),
    "chosen_tasks": tuple(SAVED.split()),
}

ALL = "all"  # the truth of rows over all truths
# What demonstrations are counted until, by where these come from.
COUNTED = {"model": "sure", "demonstrator": "settled"}
WORDS = {
    "model": "drawn from the model:\nfirst, posterior > 0.95",
    "demonstrator": "simulated demonstrator:\nfirst, and stays so",
}
_LOOKS = {"chosen": (DEMONSTRATION, "-"), "random": (TRUTH, "--")}


def counted_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table that count until what is asked of their source, truths in order."""
    rows = table[table["until"] == table["source"].map(COUNTED)]
    last = (rows["truth"] == ALL).rename("last")
    return rows.assign(last=last).sort_values(["source", "last", "truth"], kind="stable")


def draw(unfound: pd.DataFrame, chosen_tasks: pd.DataFrame) -> Figure:
    """Draw the share of repetitions that have not found the truth, a panel a truth and source."""
    rows = counted_rows(unfound)
    if rows.empty:
        raise Unsuited("nothing is counted until a truth is found")
    truths = list(dict.fromkeys(rows.sort_values("last", kind="stable")["truth"]))
    sources = [source for source in WORDS if (rows["source"] == source).any()]
    figure, grid = new_figure(
        PAGE,
        0.5 + 1.75 * len(sources),
        nrows=len(sources),
        ncols=len(truths),
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    with plt.rc_context(RC):
        for source, line in zip(sources, grid, strict=True):
            for truth, axes in zip(truths, line, strict=True):
                panel = rows[(rows["source"] == source) & (rows["truth"] == truth)]
                for way, curve in panel.groupby("way"):
                    colour, style = _LOOKS[str(way)]
                    number, share = curve["demonstrations"], 100 * curve["share"]
                    axes.step(
                        number,
                        share,
                        where="post",
                        color=colour,
                        linestyle=style,
                        label=f"{way} tasks",
                    )
                    axes.fill_between(
                        number,
                        100 * curve["share_low"],
                        100 * curve["share_high"],
                        step="post",
                        color=colour,
                        alpha=0.18,
                        linewidth=0,
                    )
                axes.axhline(50, color=GUIDE, linewidth=0.8, linestyle=":", zorder=0)
                axes.set_ylim(-3, 103)
            line[0].set_ylabel(f"{WORDS[source]}\nnot found [%]")
        for truth, axes in zip(truths, grid[0], strict=True):
            axes.set_title(title(truth))
        for axes in grid[-1]:
            axes.set_xlabel("demonstrations")
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
    return figure


def title(truth: str) -> str:
    """What a truth is called: region 65 for `cell_65`, all truths, or its name in capitals."""
    if truth == ALL:
        return "all truths"
    return f"region {truth.removeprefix('cell_')}" if truth.startswith("cell_") else truth.upper()


def facts(unfound: pd.DataFrame, chosen_tasks: pd.DataFrame) -> str:
    """What the caption says."""
    lines = [
        "Share of repetitions that have not found the truth after so many demonstrations (Kaplan "
        "and Meier); bands: 95 % bootstrap intervals over points and their repetitions; dotted: "
        "half.",
        "Chosen: the task of the pool that promises most information, given what was shown before.",
        "Medians of chosen and of random tasks, and the ratio:",
    ]
    for row in counted_rows(chosen_tasks).itertuples():
        lines.append(
            f"  {WORDS[str(row.source)].splitlines()[0]} {title(str(row.truth))}: "
            f"{row.chosen_median:g} ({row.chosen_median_low:g} to {row.chosen_median_high:g}) and "
            f"{row.random_median:g} ({row.random_median_low:g} to {row.random_median_high:g}), "
            f"{row.median_ratio:.2f} ({row.median_ratio_low:.2f} to {row.median_ratio_high:.2f}), "
            f"{row.repetitions} repetitions"
        )
    return "\n".join(lines)
