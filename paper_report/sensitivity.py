"""The main measures when each choice that the paper leaves open is changed, one at a time."""

from __future__ import annotations

import pandas as pd

from paper_report.markdown import table
from paper_report.means import Mean
from paper_report.ranking import PAPER, RULE, TOP, after
from paper_report.results import Missing, Results

STUDY = "sensitivity"
SHOWN = {
    "final_state_error": "final-state error",
    "violation_distance": "violation distance",
    "violation_distance_pooled": "pooled",
}


def section(results: Results) -> str:
    """A line for each choice and truth, the default first.

    Raises:
        Missing: the study `sensitivity` is not there yet.
    """
    columns = ("truth", "measure", "mean", "low", "high")
    means = results.table(STUDY, "measures", columns)
    ranks = after(results, STUDY)
    choices = changed(ranks)
    ranks = ranks.assign(choice=choices)
    means = means.assign(choice=changed(means))
    rows, same, other = [], [], []
    usual = dict(ranks[ranks["choice"] == DEFAULT].set_index("truth")["found"])
    if not usual:
        raise Missing(STUDY, f"the study `{STUDY}` has no point with all values as by default")
    for choice in sorted(set(choices), key=lambda name: (name != DEFAULT, name)):
        for truth, own in ranks[ranks["choice"] == choice].groupby("truth"):
            (rank,) = own.to_dict("records")
            found = means[(means["choice"] == choice) & (means["truth"] == truth)]
            values = {
                row.measure: str(Mean(row.mean, row.low, row.high)) for row in found.itertuples()
            }
            rows.append(
                [
                    f"{choice}, {truth.upper()}",
                    *(values.get(name, "-") for name in SHOWN),
                    rank["text"],
                ]
            )
            if choice != DEFAULT:
                (same if rank["found"] == usual.get(truth) else other).append(rows[-1][0])
    head = ["choice, truth", *SHOWN.values(), f"median rank after {PAPER}; share in the top {TOP}"]
    verdict = (
        f"The rule of claim 4 ({RULE}) comes out as by default in {len(same)} of "
        f"{len(same) + len(other)} rows"
    )
    verdict += f"; it does not for: {'; '.join(other)}." if other else "."
    return f"{verdict}\n\n{table(head, rows)}"


DEFAULT = "default"


def changed(rows: pd.DataFrame) -> list[str]:
    """What differs in each row from the usual value of its column, in words.

    Args:
        rows: opening columns up to `samples`, with the usual value in most rows.
    """
    names = list(rows.columns)
    opening = [name for name in names[: names.index("samples") + 1] if name != "truth"]
    text = rows[opening].astype(object).where(rows[opening].notna(), "none").astype(str)
    usual = text.mode().iloc[0]
    return [
        ", ".join(f"`{name}={row[name]}`" for name in opening if row[name] != usual[name])
        or DEFAULT
        for _, row in text.iterrows()
    ]
