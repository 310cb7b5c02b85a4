"""Claim 6 with tasks that are chosen: what the answer after five demonstrations overlaps."""

from __future__ import annotations

from paper_figures.early_overlap import ANSWERS, SOURCES, TABLES
from paper_figures.report.markdown import between, percent, table
from paper_figures.report.study_tables import Missing, Results, command

STUDY = "next_task_telescope"


def chosen_tasks(results: Results) -> str:
    """A line a source and way to pick tasks; or what makes it, where it is not there."""
    try:
        early = results.table(STUDY, "early_overlap", TABLES["early_overlap"])
        chosen = results.table(STUDY, "chosen_tasks", ("source", "repetitions", "points"))
    except Missing as missing:
        return f"Tasks that are chosen: {missing}. `{command(STUDY)}` makes it.\n"
    rows = early.to_dict("records")
    lines = [
        [
            SOURCES[row["source"]],
            row["way"],
            *(
                between(*(percent(row[f"{name}{end}"]) for end in ("", "_low", "_high")))
                for name in ANSWERS
            ),
        ]
        for row in rows
    ]
    sizes = chosen.iloc[0]
    return (
        "Which tasks are demonstrated can be chosen: before each demonstration, that of a random "
        "pool which promises most information about the constraint, given what was shown so far "
        f"(see *What to record next*). After five, over {sizes['repetitions']} pools from "
        f"{sizes['points']} sets of tasks:\n\n"
        + table(["demonstrations", "tasks", *ANSWERS.values()], lines, words=2)
        + _verdict({(row["source"], row["way"]): row for row in rows})
    )


def _verdict(rows: dict[tuple[str, str], dict[str, float]]) -> str:
    """Whether the most probable area, and both of the best two, overlap more often than not."""
    try:
        of_ways = {way: rows["demonstrator", way] for way in ("chosen", "random")}
    except KeyError:
        return ""
    told = []
    for name, text in (
        ("likeliest_overlaps", "the most probable area overlaps the truth"),
        ("two_overlap", "both of the best two regions overlap it"),
    ):
        chosen, random = (
            between(*(percent(of_ways[way][f"{name}{end}"]) for end in ("", "_low", "_high")))
            for way in ("chosen", "random")
        )
        apart = of_ways["chosen"][f"{name}_low"] > of_ways["random"][f"{name}_high"]
        verdict = "more than" if apart else "which the intervals do not tell apart from"
        told.append(f"{text} in {chosen}, {verdict} {random} after random ones")
    return (
        f"\nAfter five chosen tasks of the simulated demonstrator {told[0]}; {told[1]}. An area "
        "that took many regions would overlap easily; the last column says how many it takes, and "
        "the one before how much of it is right.\n"
    )
