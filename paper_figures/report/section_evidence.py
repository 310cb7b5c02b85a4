"""Which evidence deserves its number? Kinds of it compared on the same demonstrations."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results

STUDY = "calibration"
LIMITS = ("", "_low", "_high")
SCORES = ("off_by", "log_truth", "log_over_paper", "log_over_fixed", "top", "top_over_paper")
COLUMNS = ("demonstrations", "evidence", "worlds", "sets", "best", "right")
CHANCE = ("by_chance", "by_chance_high")
# Criterion: which kind, at how many demonstrations, and how far off it may be at most.
MOST_OFF = 0.05
JUDGED = ("calibrated", (5, 10))
FALLBACK, FALLBACK_MOST_OFF = "model error 0.1", 0.07  # where evidence cannot be calibrated

_WORDS = {
    "paper": "the paper's: Phi as it is, from cell to cell",
    "exact ends": "the same from state to state",
    "calibrated": "calibrated by simulated demonstrations",
}


def section(results: Results) -> str:
    """A line for each kind of evidence and number of demonstrations, and what follows from them.

    Raises:
        Missing: the study `calibration` is not there yet.
    """
    columns = (*COLUMNS, *CHANCE, *(f"{name}{end}" for name in SCORES for end in LIMITS))
    kinds = results.table(STUDY, "evidence_kinds", columns)
    if kinds.empty:
        raise Missing(STUDY, f"the study `{STUDY}` compares no kinds of evidence")
    lines = [
        [
            row["evidence"],
            row["demonstrations"],
            number(row["best"]),
            number(row["right"]),
            _value(row, "off_by"),
            f"{row['by_chance']:.3f} (95 %: {row['by_chance_high']:.3f})",
            *(_value(row, name) for name in ("log_truth", "log_over_paper")),
            _value(row, "log_over_fixed"),
            between(*(percent(row[f"top{end}"]) for end in LIMITS)),
        ]
        for _, row in kinds.sort_values("demonstrations", kind="stable").iterrows()
    ]
    head = ["evidence", "demonstrations", "probability", "right", "off by", "by chance"]
    head += ["log of the truth"]
    head += ["over the paper's", "over the best fixed rate", "truth in the top"]
    meant = "; ".join(f"*{name}*: {words}" for name, words in _WORDS.items())
    sizes = kinds.drop_duplicates("demonstrations").sort_values("demonstrations")
    sets = ", ".join(f"{row['demonstrations']:.0f}" for _, row in sizes.iterrows())
    return (
        f"The same sets of demonstrations in {kinds.iloc[0]['worlds']:.0f} points of simulated "
        f"worlds (random sets of {sets} of a point's demonstrations, "
        f"{kinds['sets'].max() / kinds['worlds'].max():.0f} of each size), half of the prior "
        "without a constraint and half shared by the hypotheses, read with different kinds of "
        "evidence. "
        f"{meant}; *model error*: "
        "a fixed rate eta. *Probability* is that of the most likely hypothesis, *off by* its "
        "distance to how often it is right, by bins. That distance is never negative, so that "
        "chance alone makes it positive: *by chance* is how far the bins of other worlds, drawn "
        "from these, are from those of these worlds, and so what *off by* would be if every "
        "probability came true. *Off by* is given as it is, with chance in it. Intervals are over "
        "worlds, each with all its sets. "
        "*Log of the truth* is the mean log posterior of "
        "what is true [nat], 1e-10 at least, and its differences are between the same sets.\n\n"
        + table(head, lines)
        + "\n"
        + _judgement(kinds)
    )


def _judgement(kinds: pd.DataFrame) -> str:
    """Whether calibrated evidence is calibrated, and why not where it is not."""
    kind, sizes = JUDGED
    rows = kinds[kinds["evidence"] == kind].set_index("demonstrations")
    judged = [size for size in sizes if size in rows.index]
    if not judged:
        return "No evidence is calibrated in this study.\n"
    text = f"Calibrated evidence is {_distance(rows.loc[judged], MOST_OFF)}."
    fallback = kinds[kinds["evidence"] == FALLBACK].set_index("demonstrations")
    if set(judged) <= set(fallback.index):
        off = _distance(fallback.loc[judged], FALLBACK_MOST_OFF)
        text += f" A fixed rate of 0.1, for where it cannot be calibrated, is {off}."
    for size in rows.index.difference(list(sizes)):
        row = rows.loc[size]
        if row["right"] > row["best"]:
            text += (
                f" After {size} it is too modest ({number(row['best'])} probable, "
                f"{number(row['right'])} right), for at least two reasons that lie in these worlds "
                "and that a posterior which takes tasks as given cannot use: starts and goals are "
                "drawn where the truth allows them, so that each task alone tells a little of it; "
                "and a demonstrator who goes round the truth crosses more of the other regions "
                "than one who does not meet it, and so refutes them sooner."
            )
    return text + "\n"


def _distance(rows: pd.DataFrame, most: float) -> str:
    """How far off a kind of evidence is after each number of demonstrations, and whether within."""
    off = ", ".join(f"{number(value)} after {size}" for size, value in rows["off_by"].items())
    within = "within" if (rows["off_by"] <= most).all() else "not within"
    return f"off by {off} demonstrations, {within} {most}"


def _value(row: pd.Series, name: str) -> str:
    """A score with its interval."""
    return between(*(f"{row[f'{name}{end}']:.3f}" for end in LIMITS))
