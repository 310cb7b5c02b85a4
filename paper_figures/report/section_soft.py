"""Whether the weight of a soft constraint can be told."""

from __future__ import annotations

from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Results
from paper_figures.soft_weights import TABLES, soft_rows

STUDY = "soft"


def section(results: Results) -> str:
    """A line for each truth, number of demonstrations and weight.

    Raises:
        Missing: the study `soft` is not there yet.
    """
    soft = results.table(STUDY, "soft", TABLES["soft"])
    rows = soft_rows(soft)
    lines = [
        [
            row["truth"].upper(),
            row["demonstrations"],
            f"{row['weight']:g}",
            between(*(_weight(row[name]) for name in ("median", "low", "high"))),
            between(*(percent(row[name]) for name in ("covers", "covers_low", "covers_high"))),
            percent(row["perhaps no constraint"]),
            percent(row["undecided"]),
            percent(row["soft"]),
            percent(row["as a wall"]),
        ]
        for row in rows.to_dict("records")
    ]
    inside = round((rows["covers"] * rows["sets"]).sum())
    head = [
        "truth",
        "demonstrations",
        "weight [nat/s]",
        "estimate (quartiles)",
        "interval holds it",
    ]
    head += ["perhaps none", "undecided", "soft", "as a wall"]
    return (
        "A soft constraint lowers the reward by its weight for each second inside; 0 is none, and "
        "an infinite weight is a wall. Here the tabular model draws demonstrations under a known "
        "weight, and the most likely weight is found with its 95 % interval. The verdict is "
        "*soft* if the interval reaches neither end, *as a wall* if it reaches infinity alone, "
        "*perhaps none* if it reaches 0 alone.\n\n"
        f"- {inside} of {int(rows['sets'].sum())} intervals hold the true weight.\n\n"
        + table(head, lines, words=1)
    )


def _weight(value: float) -> str:
    """A weight in the table."""
    return number(value) if value < float("inf") else "wall"
