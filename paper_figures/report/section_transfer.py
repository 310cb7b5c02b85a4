"""Failure set or tube: which of both holds where the controls are others?"""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import between, table
from paper_figures.report.study_tables import Results
from paper_figures.transfer import NOMINAL, TABLES, transfer_rows

STUDY = "transfer"
MOST = 0.01  # share of trials that the region's own safe set may let in
OWN, TUBE = "own safe set", "tube"


def section(results: Results) -> str:
    """A line a strength and method.

    Raises:
        Missing: the study `transfer` is not there yet.
    """
    transfer = results.table(STUDY, "transfer", (*TABLES["transfer"], "seed"))
    rows = transfer_rows(transfer)
    lines = [
        [
            f"{row['strength']:g}",
            row["method"],
            *(_share(row, name) for name in ("entered", "admitted", "refused")),
        ]
        for row in rows.to_dict("records")
    ]
    right = transfer.groupby("seed")["right"].first()
    head = ["controls", "method", "entered", "doomed and let through", "safe and refused"]
    return (
        "Whoever cannot turn back any more avoids the states that lead to a region as well as the "
        "region itself, so demonstrations alone do not tell a region from its tube, and the tube "
        "depends on the controls. Here a region is inferred at the nominal control range, and "
        "random controls of other ranges are filtered by its own safe set, solved anew, or by "
        "the nominal one, whose complement is the tube that can be learned. *Doomed* states are "
        "outside the truth and cannot keep out of it; *safe* ones can.\n\n"
        f"- The inferred region is the truth in {int(right.sum())} of {len(right)} points.\n"
        + _verdict(rows)
        + "\n"
        + table(head, lines, words=2)
    )


def _verdict(rows: pd.DataFrame) -> str:
    """What each lets in and refuses at other strengths."""
    own = rows[rows["method"] == OWN].set_index("strength")
    tube = rows[rows["method"] == TUBE].set_index("strength")
    worst = own["entered"].max()
    met = "met" if worst <= MOST else "missed"
    text = (
        f"- The region's own safe set lets in at most {100 * worst:.2f} % of trials at any "
        f"strength; the target of {100 * MOST:.0f} % is {met}.\n"
    )
    for strength in own.index[own.index != NOMINAL]:
        weaker = strength < NOMINAL
        name = "entered" if weaker else "refused"
        what = "lets in" if weaker else "refuses"
        of = "trials" if weaker else "safe states"
        text += (
            f"- At {strength:g} times the controls the tube {what} "
            f"{_share(tube.loc[strength], name)} of {of}, the own safe set "
            f"{_share(own.loc[strength], name)}.\n"
        )
    return text


def _share(row: pd.Series, name: str) -> str:
    """A share in percent with its interval."""
    value, low, high = (row[f"{name}{end}"] for end in ("", "_low", "_high"))
    if pd.isna(value):
        return "-"
    return between(f"{100 * value:.1f} %", f"{100 * max(low, 0.0):.1f} %", f"{100 * high:.1f} %")
