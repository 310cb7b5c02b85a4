"""Claim 6: the telescoping inverted pendulum (Fig. 7), and how often inference succeeds on it."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.chosen_for_claim_6 import chosen_tasks
from paper_figures.report.markdown import between, count, number, percent, table
from paper_figures.report.study_tables import Missing, Results, command
from paper_figures.report.verdict import Check, Claim, Part
from paper_figures.rows import DEFAULT

PAPER = 5  # demonstrations
HALF = 0.5
MINUTES = 5
STUDY = "telescope"

SHARES = {
    "top_1_overlap": "the best overlaps the truth",
    "top_2_overlap": "both of the best two do",
    "top_1_inside": "the best lies inside it",
    "top_2_inside": "both of the best two do",
}
AREA = {
    "area_overlap": "the most probable area overlaps the truth",
    "area_precision": "share of its regions that do",
    "area_share": "share of all regions that it takes",
}
SIZES = (1, 3, 5, 10, 20)  # demonstrations that are listed
CROSSING = "tasks.crossing"
EVIDENCE = "truth_probability"
WORDS = {False: "random tasks", True: "tasks that cross the truth"}


def claim(results: Results) -> Claim:
    """Write claim 6.

    Raises:
        Missing: the study `telescope` is not there yet.
    """
    rows = _rows(results)
    after = rows[rows["demonstrations"] == PAPER]
    if after.empty:
        raise Missing(STUDY, f"the study `{STUDY}` ranks nothing after {PAPER} demonstrations")
    listing = results.listing(STUDY)
    minutes = listing["seconds"] / len(listing["points"]) / 60
    return Claim(
        title="Telescoping inverted pendulum",
        paper="with 2500 states, 15 actions and 100 hypotheses over angle and length, the two most "
        f"likely constraints after {PAPER} demonstrations coincide with the truth; it takes about "
        f"{MINUTES} minutes on one core.",
        parts=[
            *(
                Part(
                    f"the best two {what} after {PAPER} demonstrations of {tasks}",
                    f"the low end of the share of random sets that do is at least {HALF:.0%}",
                    [
                        Check(str(row["case"]), bool(row[f"{name}_low"] >= HALF), _share(row, name))
                        for row in cases.to_dict("records")
                    ],
                )
                for name, what in (
                    ("top_2_overlap", "overlap the truth"),
                    ("top_2_inside", "lie inside the truth"),
                )
                for tasks, cases in after.groupby("tasks", sort=False)
            ),
            Part(
                f"about {MINUTES} minutes on one core",
                f"a point, all its parts included, takes at most {MINUTES} minutes on average",
                [Check("all points", minutes <= MINUTES, f"{number(minutes, 2)} minutes")],
            ),
        ],
        numbers=_numbers(results, rows)
        + f"\nA point takes {number(60 * minutes, 2)} s on average, on one core; what points share "
        "counts once.\n",
        why=_why(rows),
        command=command(STUDY),
    )


def _rows(results: Results) -> pd.DataFrame:
    """The shares of every case, kind of tasks and number of demonstrations, with its evidence."""
    cases = results.table(STUDY, "cases", ("case", "choice", "value", CROSSING))
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    ends = [f"{name}{end}" for name in SHARES for end in ("", "_low", "_high")]
    curve = results.table(STUDY, "rank_curve", (*keys, "demonstrations", "median", *ends))
    means = results.table(STUDY, "measures", (*keys, "measure", "mean"))
    chance = means[means["measure"] == EVIDENCE][[*keys, "mean"]].rename(columns={"mean": EVIDENCE})
    rows = cases.merge(curve, on=keys).merge(chance, on=keys, how="left")
    return rows.assign(
        tasks=rows[CROSSING].map(WORDS), evidence=rows["demonstrations"] * rows[EVIDENCE]
    )


def _success(rows: pd.DataFrame) -> str:
    """How often the best hypotheses meet the truth, a line for each row of the default case."""
    return table(
        ["tasks", "demonstrations", "median rank", *SHARES.values()],
        [
            [
                row["tasks"],
                row["demonstrations"],
                count(row["median"]),
                *(_share(row, share) for share in SHARES),
            ]
            for row in rows[rows["case"] == DEFAULT].to_dict("records")
        ],
    )


def _areas(results: Results) -> str:
    """What the most probable area is worth, a line for each row of the default case."""
    columns = [f"{name}{end}" for name in AREA for end in ("", "_low", "_high")]
    try:
        curve = results.table(STUDY, "rank_curve", columns)
    except Missing as missing:
        return f"{missing}.\n"
    cases = results.table(STUDY, "cases")
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    rows = cases[cases["case"] == DEFAULT].merge(curve, on=keys)
    return table(
        ["tasks", "demonstrations", *AREA.values()],
        [
            [WORDS[row[CROSSING]], row["demonstrations"], *(_share(row, name) for name in AREA)]
            for row in rows[rows["demonstrations"].isin(SIZES)].to_dict("records")
        ],
    )


def _numbers(results: Results, rows: pd.DataFrame) -> str:
    """How often the best hypotheses meet the truth, by number of demonstrations and by case."""
    sizes = [size for size in (PAPER, 2 * PAPER) if size in set(rows["demonstrations"])]
    cases = []
    for (case, tasks), curve in rows.groupby(["case", "tasks"], sort=False):
        by_size = curve.set_index("demonstrations")
        at = [by_size.loc[size] for size in sizes if size in by_size.index]
        cells = [_share(row, name) for name in ("top_2_overlap", "top_2_inside") for row in at]
        cases.append([case, tasks, number(curve[EVIDENCE].iloc[0], 2), *cells])
    head = [f"{what}, {size}" for what in ("overlap", "inside") for size in sizes]
    return (
        "Success by default: share of random sets of demonstrations; a tied set counts by its "
        "chance.\n\n"
        + _success(rows[rows["demonstrations"].isin(SIZES)])
        + "\nThe same for the most probable *area*: the best region, with those that hang together "
        "with it by common borders and are at least half as probable. An "
        "area that takes many regions overlaps the truth easily.\n\n"
        + _areas(results)
        + f"\n{chosen_tasks(results)}"
        + "\nBoth of the best two, when one choice is changed, after "
        + " and ".join(str(size) for size in sizes)
        + " demonstrations. *Evidence* is the mean probability that an agent without constraint, "
        "given the task of a demonstration, would have violated the best hypothesis inside the "
        "truth:\n\n" + table(["case", "tasks", "evidence", *head], cases, words=2)
    )


def _why(rows: pd.DataFrame) -> str:
    """What governs success, as far as it was tried."""
    default = rows[rows["case"] == DEFAULT]
    random, crossing = (default[default[CROSSING] == kind] for kind in (False, True))
    if random.empty or crossing.empty:
        return ""
    most = random.loc[random["demonstrations"].idxmax()]
    near = crossing.loc[(crossing["evidence"] - most["evidence"]).abs().idxmin()]
    alike = rows[["evidence", "top_2_overlap"]].corr(method="spearman").iloc[0, 1]
    inside = rows[["evidence", "top_2_inside"]].corr(method="spearman").iloc[0, 1]
    return (
        "What governs success is how much a set of demonstrations could have shown: few random "
        "tasks lead through the truth, and the others say nothing about it. Over all cases, tasks "
        "and numbers of demonstrations, the rank correlation of a set's expected evidence (above, "
        "times the demonstrations) with the share that overlaps is "
        f"{number(alike, 2)}, and with the share inside {number(inside, 2)}. "
        f"{most['demonstrations']} random demonstrations hold as much evidence "
        f"({number(most['evidence'], 2)}) as {near['demonstrations']} of tasks that cross the "
        f"truth ({number(near['evidence'], 2)}); after the former "
        f"{percent(most['top_2_overlap'])} of the sets overlap and "
        f"{percent(most['top_2_inside'])} lie inside, after the latter "
        f"{percent(near['top_2_overlap'])} and {percent(near['top_2_inside'])}.\n\n"
        "To lie inside takes more: demonstrators keep their distance, so that hypotheses which the "
        "truth covers in part are hardly ever visited either, and explain as much until some "
        "demonstration cuts their free corner. What helps is that hypotheses fit: those of 8 x 8 "
        "have the sides of the truth in one dimension, fewer of them are covered in part, and each "
        "is larger and more likely to be entered. Smaller ones do not help (12 x 12): those at the "
        "sides of the truth, where most ways lead past, gain as much as those in its middle.\n"
    )


def _share(row: pd.Series | dict, name: str) -> str:
    """A share with its interval."""
    return between(*(percent(row[f"{name}{end}"]) for end in ("", "_low", "_high")))
