"""What inference owes to a nominal model that is not how real demonstrators move."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.curves import draw_dots, name_cases
from paper_figures.rows import DEFAULT, PAPER, Unsuited
from paper_figures.style import DEMONSTRATION, PAGE, RC, TRUTH, new_figure

TABLES = {
    "cases": ("truth", "case", "choice"),
    "measures": ("truth", "measure", "mean", "low", "high"),
    "rank_curve": ("truth", "demonstrations", "median", "share_top_5", "claim", "top_1_inside"),
}

RARE = "rare"  # the measure: demonstrations that the model finds nearly impossible
BY_CHANCE = 0.02  # of the model's own
_LOOKS = ((TRUTH, "o"), (DEMONSTRATION, "s"))  # of truths
_SPREAD = 0.4  # of a row's height between truths
_COLUMNS = {
    "median": "rank",
    "share_top_5": "top",
    "claim": "claim",
    "top_1_inside": "right",
}
_PANELS = {
    "rank": ("median rank", "rank of truth", 1),
    "top": ("truth in the top 5", "sets [%]", 100),
    "claim": ("claimed (hollow), right", "[%]", 100),
    RARE: ("nearly impossible", "demonstrations [%]", 100),
}


def wrong_model_rows(
    cases: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame
) -> pd.DataFrame:
    """A row for each case and truth, the cases in their order.

    Returns:
        `case`, `choice` and `truth`; after 9 demonstrations `rank`, the median; `top`, the share in
        the top 5; `claim`, the mean posterior of the best hypothesis; `right`, how often that is
        the truth; and `rare`, the share of demonstrations that the model finds nearly impossible.
        Each with `_low` and `_high`.

    Raises:
        Unsuited: no case is the default, or demonstrations were not compared with the model.
    """
    if DEFAULT not in set(cases["case"]):
        raise Unsuited(f"no case is named {DEFAULT}")
    rare = measures[measures["measure"] == RARE]
    if rare.empty:
        raise Unsuited(f"table measures has no measure {RARE}")
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    after = min(PAPER, rank_curve["demonstrations"].max())
    at = rank_curve[rank_curve["demonstrations"] == after]
    columns = {
        f"{old}{end}": f"{new}{end}"
        for old, new in _COLUMNS.items()
        for end in ("", "_low", "_high")
    }
    ranks = at[[*keys, *columns]].rename(columns=columns)
    limits = rare[[*keys, "mean", "low", "high"]].set_axis(
        [*keys, RARE, f"{RARE}_low", f"{RARE}_high"], axis=1
    )
    rows = cases
    for part in (ranks, limits):
        rows = rows.merge(part, on=keys, how="left", validate="one_to_one")
    return rows


def draw(cases: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame) -> Figure:
    """Draw a line a case and a panel a number; marks tell the truths."""
    rows = wrong_model_rows(cases, measures, rank_curve)
    names, truths = list(rows["case"].drop_duplicates()), sorted(rows["truth"].unique())
    figure, grid = new_figure(PAGE, 0.8 + 0.2 * len(names), ncols=len(_PANELS), sharey=True)
    with plt.rc_context(RC):
        for axes, (name, (title, unit, factor)) in zip(grid, _PANELS.items(), strict=True):
            for number, truth in enumerate(truths):
                of_truth = rows[rows["truth"] == truth]
                colour, marker = _LOOKS[number % len(_LOOKS)]
                y = of_truth["case"].map(names.index) + _SPREAD * (number - 0.5)
                style = {"color": colour, "marker": marker, "label": truth.upper()}
                for column in (name, "right") if name == "claim" else (name,):
                    hollow = {"markerfacecolor": "white"} if column == "claim" else {}
                    limits = [column, f"{column}_low", f"{column}_high"]
                    draw_dots(axes, factor * of_truth[limits], y, {**style, **hollow})
                default = of_truth[of_truth["case"] == DEFAULT]
                x = factor * float(default["right" if name == "claim" else name].iloc[0])
                axes.axvline(x, color=colour, linewidth=0.5, linestyle=":", zorder=0)
            axes.set_title(title)
            axes.set_xlabel(unit)
            if factor == 100:
                axes.set_xlim(-4, 104)
        name_cases(grid, names)
        grid[0].set_xlim(0.8, 110)
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(truths))
    return figure


def facts(cases: pd.DataFrame, measures: pd.DataFrame, rank_curve: pd.DataFrame) -> str:
    """What the caption says."""
    rows = wrong_model_rows(cases, measures, rank_curve)
    lines = [
        "Demonstrators who are not what inference takes them for, a line each; inference is that",
        f"of `infer`. After {PAPER} demonstrations, over random subsets: rank of the truth, share",
        "in the top 5, mean posterior of the best hypothesis and how often it is the truth. Nearly",
        "impossible: p < .01 in the tabular model, about 2 % of its own. Lines: 95 % bootstrap",
        "intervals; dotted: the default's value.",
    ]
    for row in rows.itertuples():
        lines.append(
            f"  {row.case}, {row.truth.upper()}: median rank {row.rank:g}, in the top 5 "
            f"{100 * row.top:.0f} %, claimed {100 * row.claim:.0f} %, right {100 * row.right:.0f} "
            f"%, nearly impossible {100 * row.rare:.0f} %"
        )
    return "\n".join(lines)
