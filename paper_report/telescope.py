"""Claim 6: the telescoping inverted pendulum (Fig. 7), and how often inference succeeds on it."""

from __future__ import annotations

import pandas as pd

from paper_report.markdown import between, count, number, percent, table
from paper_report.results import Missing, Results, command, settings
from paper_report.verdict import Check, Claim, Part

PAPER = 5  # demonstrations
HALF = 0.5
MINUTES = 5
STUDY = "telescope"

SHARES = {
    "top_1_overlaps": "the best overlaps the truth",
    "top_2_overlap": "both of the best two do",
    "top_1_inside": "the best lies inside it",
    "top_2_inside": "both of the best two do",
}
SIZES = (1, 2, 3, 5, 10, 20)  # demonstrations that are listed


def claim(results: Results) -> Claim:
    """Write claim 6.

    Raises:
        Missing: the study `telescope` is not there yet.
    """
    ends = [f"top_2_overlap{end}" for end in ("", "_low", "_high")]
    curve = results.table(STUDY, "rank_curve", ("demonstrations", *ends, *SHARES))
    rows = curve[curve["demonstrations"] == PAPER]
    if rows.empty:
        raise Missing(STUDY, f"the study `{STUDY}` ranks nothing after {PAPER} demonstrations")
    listed = results.listing(STUDY)
    names = settings(rows)
    minutes = listed["seconds"] / len(listed["points"]) / 60
    return Claim(
        title="Telescoping inverted pendulum",
        paper="with 2500 states, 15 actions and 100 hypotheses over angle and length, the two most "
        f"likely constraints after {PAPER} demonstrations coincide with the truth; it takes about "
        f"{MINUTES} minutes on one core.",
        parts=[
            Part(
                f"the best two overlap the truth after {PAPER} demonstrations",
                "the low end of the share of random subsets in which both do is at least half",
                [
                    Check(name, bool(row[ends[1]] >= HALF), _share(row, "top_2_overlap"))
                    for name, (_, row) in zip(names, rows.iterrows(), strict=True)
                ],
            ),
            Part(
                f"about {MINUTES} minutes on one core",
                f"a point, all its parts included, takes at most {MINUTES} minutes on average",
                [Check("all points", minutes <= MINUTES, f"{number(minutes, 2)} minutes")],
            ),
        ],
        numbers=_numbers(curve)
        + f"\nA point takes {number(60 * minutes, 2)} s on average, on one core; what points share "
        "counts once.\n",
        why="",
        command=command(STUDY),
    )


def _numbers(curve: pd.DataFrame) -> str:
    """How often the best hypotheses meet the truth, by number of demonstrations."""
    rows = curve[curve["demonstrations"].isin(SIZES)]
    names = settings(rows)
    return (
        "Success: share of random subsets of demonstrations; a tied set counts by its mean.\n\n"
        + table(
            ["setting", "demonstrations", "median rank", *SHARES.values()],
            [
                [
                    name,
                    row["demonstrations"],
                    count(row["median"]),
                    *(_share(row, share) for share in SHARES),
                ]
                for name, (_, row) in zip(names, rows.iterrows(), strict=True)
            ],
        )
    )


def _share(row: pd.Series, name: str) -> str:
    """A share with its interval."""
    return between(*(percent(row[f"{name}{end}"]) for end in ("", "_low", "_high")))
