"""Which dynamics the approach works for, and whether that can be foretold."""

from __future__ import annotations

import pandas as pd

from paper_figures.dynamics import FEATURES, TABLES, WAYS
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Results

STUDY = "dynamics"
_ENDS = ("", "_low", "_high")
_MEASURES = ("top", "over_claim", "violation_distance", "out_of_reach")
_SYSTEMS = ("system", "cells", "dt", "points", "log_rank")
_SYSTEMS += tuple(f"{name}{end}" for name in _MEASURES for end in _ENDS)


def section(results: Results) -> str:
    """What the rule is worth, then a line for each system, number of cells and time step.

    Raises:
        Missing: the study `dynamics` is not there yet.
    """
    systems = results.table(STUDY, "success_systems", _SYSTEMS)
    scores = results.table(STUDY, "success_scores", TABLES["success_scores"]).set_index("way")
    rule = results.table(STUDY, "success_rule", TABLES["success_rule"])
    lines = [
        [
            row["system"],
            row["cells"],
            row["dt"],
            _shares(row, "top"),
            number(2.718281828 ** row["log_rank"]),
            _numbers(row, "over_claim", signed=True),
            _numbers(row, "violation_distance"),
            _shares(row, "out_of_reach"),
        ]
        for row in systems.to_dict("records")
    ]
    head = ["system", "cells", "dt", "truth in the top 5", "geometric mean rank"]
    head += ["posterior less share right", "violation distance", "goals out of reach"]
    return (
        f"{scores['points'].iloc[0]} points of {scores['systems'].iloc[0]} systems: random truths "
        "among the hypotheses that a tenth of the tasks' optimal paths enter, grids of about 400 "
        "and 1600 cells whatever the dimension, two time steps. After 9 demonstrations, without "
        "calibration. Intervals are over truths and seeds.\n\n"
        f"{_verdict(scores)}\n{_weights(rule)}\n" + table(head, lines, words=1)
    )


def _verdict(scores: pd.DataFrame) -> str:
    """How the rule compares with each other way, a line each."""
    own = scores.loc["rule"]
    score = between(*(f"{own['brier' + end]:.3f}" for end in _ENDS))
    text = (
        f"- A rule by numbers that are known before anybody demonstrates has a Brier score of "
        f"{score} on systems that had no part in it. What it begins with was chosen among some "
        "sixty numbers and pairs that were tried on these systems, which flatters it a little.\n"
    )
    for way, name in WAYS.items():
        if way == "rule":
            continue
        row = scores.loc[way]
        low, high = row["rule_less_low"], row["rule_less_high"]
        word = "better than" if high < 0 else "worse than" if low > 0 else "not told apart from"
        less = between(*(f"{row[f'rule_less{end}']:+.3f}" for end in _ENDS))
        text += f"- It is {word} *{name}* ({row['brier']:.3f}): {less}.\n"
    return text


def _weights(rule: pd.DataFrame) -> str:
    """The numbers of the rule, with their weights."""
    parts = [
        f"{FEATURES[row.feature]} "
        + between(*(f"{getattr(row, f'weight{end}'):+.2f}" for end in _ENDS))
        for row in rule.itertuples()
        if row.feature != "intercept"
    ]
    return f"- Its numbers, with log odds of success a standard deviation: {'; '.join(parts)}.\n"


def _shares(row: dict[str, float], name: str) -> str:
    """A share with its interval."""
    return between(*(percent(row[name + end]) for end in _ENDS))


def _numbers(row: dict[str, float], name: str, *, signed: bool = False) -> str:
    """A number with its interval; nothing where no task could be done."""
    if pd.isna(row[name]):
        return "-"
    form = "{:+.2f}" if signed else "{:.2f}"
    return between(*(form.format(row[name + end]) for end in _ENDS))
