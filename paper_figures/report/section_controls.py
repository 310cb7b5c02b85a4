"""Limits of controls: whether a joint that will not push is found."""

from __future__ import annotations

import pandas as pd

from paper_figures.control_limits import TABLES, UNIT, limit_rows
from paper_figures.report.markdown import between, percent, table
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import Unsuited

STUDY = "control_limits"
ENOUGH = 0.9  # of the sets
_CHANCES = (" with the model's", "; with calibrated")
_SIZES = (1, 3, 10)  # of the table
_JOINT = {
    "of_nothing": "nothing",
    "of_region": "region alone",
    "of_controls": "range alone",
    "of_both": "both",
    "true_first": "truth first",
}


def section(results: Results) -> str:
    """A line for each limit, kind of evidence and number of demonstrations.

    Raises:
        Missing: the study `control_limits` is not there yet.
    """
    curve = results.table(STUDY, "control_curve", TABLES["control_curve"])
    cases = results.table(STUDY, "cases", TABLES["cases"])
    try:
        of_cases = limit_rows(curve, cases)
    except Unsuited as error:
        raise Missing(STUDY, f"the study `{STUDY}` cannot be read: {error}") from None
    lines = [
        [
            case,
            "calibrated" if row["calibrated"] else "the model's",
            row["demonstrations"],
            *(_share(row, name) for name in ("true_first", "posterior", "wrong", "wrong_sure")),
        ]
        for case, rows in of_cases.items()
        for row in rows.sort_values(["calibrated", "demonstrations"]).to_dict("records")
        if row["demonstrations"] in _SIZES
    ]
    head = ["u, in " + UNIT, "chances", "demonstrations", "truth first", "its posterior"]
    head += ["wrong answer", "above 50 %"]
    return (
        "A joint may be unable to push, or its owner unwilling. Simulated demonstrators swing the "
        "pendulum optimally under a limit of the control u; hypotheses forbid u beyond a quarter, "
        "a half or three quarters of its range, on either side. The truth is first if no other "
        "range explains more; a narrower one on the same side is part of the truth, and no error. "
        "A *wrong answer* is a range that is more probable than the truth and than that nothing is "
        "forbidden. The simulated demonstrator wastes no control, as the tabular agent does, so "
        "that the model's chances of a hard push are too high: few demonstrations look like a "
        "limit. Calibrated chances come from demonstrators whom nothing limits. Tasks that cannot "
        "be done under the limit are left out.\n\n"
        + "".join(_verdict(case, rows) for case, rows in of_cases.items())
        + "\n"
        + table(head, lines, words=2)
        + _joint(results, cases)
    )


def _joint(results: Results, cases: pd.DataFrame) -> str:
    """Whether it is told that a region, a range or both are forbidden."""
    columns = [f"{name}{end}" for name in _JOINT for end in ("", "_low", "_high")]
    try:
        curve = results.table(STUDY, "joint_curve", ("truth", "demonstrations", *columns))
    except Missing as missing:
        return f"\nRegions and controls in one belief: {missing}.\n"
    lines = [
        [case, row["demonstrations"], *(_share(row, name) for name in _JOINT)]
        for truth, case in zip(cases["truth"], cases["case"], strict=True)
        for row in curve[curve["truth"] == truth].sort_values("demonstrations").to_dict("records")
        if row["demonstrations"] in _SIZES
    ]
    return (
        "\nRegions and ranges may also compete in *one* belief, as nothing, a region alone, a "
        "range alone, or both: moves into the region and moves that apply the range are then left "
        "out of one distribution a task. Columns are mean posterior probabilities, and the share "
        "of sets in which the most probable answer is all of the truth; a region inside of the "
        "true one counts. The model's chances are not calibrated for pairs.\n\n"
        + table(["u, in " + UNIT, "demonstrations", *_JOINT.values()], lines, words=2)
    )


def _verdict(case: str, rows: pd.DataFrame) -> str:
    """From how many demonstrations on the truth is first, or how often a limit is imagined."""
    best = rows[rows["calibrated"] == rows["calibrated"].max()]
    if best["true_first"].notna().any():
        late = best.loc[best["true_first"] < ENOUGH, "demonstrations"].max()
        sizes = best["demonstrations"]
        after = sizes[sizes > late].min() if pd.notna(late) else sizes.min()
        words = (
            f"from {after} demonstrations on"
            if pd.notna(after)
            else "with no number that was tried"
        )
        return f"- **u {case} {UNIT}.** The truth is first in {percent(ENOUGH)} of sets {words}.\n"
    text = "- **No limit.** Some range is the answer"
    for calibrated, kind in rows.groupby("calibrated", sort=True):
        worst = kind.loc[kind["wrong"].idxmax()]
        last = kind.loc[kind["demonstrations"].idxmax()]
        text += (
            f"{_CHANCES[calibrated]} chances in up to "
            f"{_share(worst, 'wrong')} of sets, of {worst['demonstrations']:.0f}, and in "
            f"{_share(last, 'wrong')} of those of {last['demonstrations']:.0f}"
        )
    return text + ".\n"


def _share(row: pd.Series | dict, name: str) -> str:
    """A share in percent with its interval."""
    if pd.isna(row[name]):
        return "-"
    return between(*(percent(row[f"{name}{end}"]) for end in ("", "_low", "_high")))
