"""Claim 4: the rank of the truth after a few demonstrations (Fig. 5)."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import between, by_dt, count, percent, table
from paper_figures.report.study_tables import Missing, Results, command, paper_rows
from paper_figures.report.verdict import Check, Claim, Part
from paper_figures.rows import PAPER

TOP = 5
HALF = 0.5  # of the subsets, the least for which the truth counts as found; of the moves, most
RULE = (
    f"median rank at most {TOP}, and the low end of the share in the top {TOP} at least {HALF:.0%}"
)

COLUMNS = (
    *("truth", "cells", "actions", "dt", "samples", "demonstrations", "median", "median_low"),
    *("median_high", "q10", "q90", "share_top_5", "share_top_5_low", "share_top_5_high"),
)


def after(results: Results, study: str, demonstrations: int = PAPER) -> pd.DataFrame:
    """Rows of a study's `rank_curve` after some demonstrations, with `success` and `text`.

    Success means that the truth is found: `RULE`.

    Raises:
        Missing: the study is not there yet, or never has so many.
    """
    curve = results.table(study, "rank_curve", COLUMNS)
    rows = curve[curve["demonstrations"] == demonstrations]
    if rows.empty:
        raise Missing(
            study, f"the study `{study}` ranks nothing after {demonstrations} demonstrations"
        )
    success = (rows["median"] <= TOP) & (rows["share_top_5_low"] >= HALF)
    return rows.assign(success=success, text=[_text(row) for _, row in rows.iterrows()])


def claim(results: Results) -> Claim:
    """Write claim 4.

    Raises:
        Missing: the study `paper` is not there yet.
    """
    rows = paper_rows(after(results, "paper"))
    summary = paper_rows(results.table("paper", "summary", ("stay", "seed")))
    return Claim(
        title="Rank of the truth",
        paper=f"after {PAPER} demonstrations the true constraint is among the {TOP} most likely, "
        "for 100 to 1600 cells once dt suits; 100 cells at dt 0.2 s do badly because most moves "
        "end where they began; with 400 cells or more dt hardly matters.",
        parts=_parts(rows, summary),
        numbers=f"Median rank after {PAPER} demonstrations, and the share of random subsets that "
        f"rank the truth in the top {TOP}:\n\n"
        + by_dt(rows, "text")
        + "\nThe median over subsets hides how they differ; 80 % of them rank the truth between\n\n"
        + by_dt(rows.assign(text=[_spread(row) for _, row in rows.iterrows()]), "text"),
        why=_why(summary),
        command=command("paper"),
    )


def _parts(rows: pd.DataFrame, summary: pd.DataFrame) -> list[Part]:
    """The claim's parts, from ranks and from the diagnosis of each point."""
    coarse = rows[(rows["cells"] == 100) & (rows["dt"] == 0.2)]
    moves = summary[(summary["cells"] == 100) & (summary["dt"] == 0.2)]
    finer = rows[rows["cells"] >= 400]
    if coarse.empty or moves.empty or finer.empty:
        raise Missing(
            "paper", "the study `paper` lacks 100 cells at dt 0.2 s, or 400 cells and more"
        )
    return [
        Part(
            "found with every number of cells at some dt",
            f"at one dt at least, {RULE}",
            [
                Check(f"{str(truth).upper()}, {cells} cells", bool(steps["success"].any()))
                for (truth, cells), steps in rows.groupby(["truth", "cells"])
            ],
        ),
        Part(
            "100 cells at dt 0.2 s fail",
            f"not: {RULE}",
            [Check(row.truth.upper(), not row.success, row.text) for row in coarse.itertuples()],
        ),
        Part(
            "because most moves stay in their cell",
            "more than half of the moves of 100 cells at dt 0.2 s do",
            [
                Check(str(truth).upper(), bool(stay > HALF), percent(stay))
                for truth, stay in moves.groupby("truth")["stay"].mean().items()
            ],
        ),
        Part(
            "found with 400 cells or more at every dt",
            RULE,
            [
                Check(
                    f"{row.truth.upper()}, {row.cells} cells, dt {row.dt:g}", row.success, row.text
                )
                for row in finer.itertuples()
            ],
        ),
    ]


def _text(row: pd.Series) -> str:
    """Median rank, and the share in the top with its interval."""
    ends = (row["share_top_5"], row["share_top_5_low"], row["share_top_5_high"])
    return f"{count(row['median'])}; {between(*map(percent, ends))}"


def _spread(row: pd.Series) -> str:
    """Where the ranks of most subsets are."""
    return f"{count(row['q10'])} and {count(row['q90'])}"


def _why(summary: pd.DataFrame) -> str:
    """What the diagnosis says of discretisations that fail."""
    frozen = [name for name in summary if name.startswith("frozen_")]
    columns = ["stay", *frozen]
    grids = summary.groupby(["cells", "dt"])
    goals, means = grids[["reachable", "demonstrations"]].sum(), grids[columns].mean()
    worst = means[means[frozen].max(axis=1) > 0.25]
    if worst.empty:
        return ""
    words = [f"frozen: {name.removeprefix('frozen_').replace('_', ' ')}" for name in frozen]
    return (
        "What fails is told by the diagnosis before anything is ranked: the share of cells whose "
        "place in a dimension no action changes within a step (frozen). Where a fourth of them or "
        "more are frozen:\n\n"
        + table(
            ["cells, dt", "moves that stay", *words, "goals that can be reached"],
            [
                [
                    f"{cells}, {dt:g} s",
                    *(percent(value) for value in row),
                    "{reachable} of {demonstrations}".format(**goals.loc[(cells, dt)].astype(int)),
                ]
                for (cells, dt), row in worst.iterrows()
            ],
        )
        + "\nWhether this is the reason is tried by averaging moves over start points inside a "
        "cell: see the section on in-cell sampling.\n"
    )
