"""Failure set or tube: which of both holds where the controls are others?"""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import between, table
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import Unsuited
from paper_figures.transfer import NOMINAL, TABLES, right_points, transfer_rows, with_cases

STUDY = "transfer"
MOST = 0.01  # share of trials that the region's own safe set may let in
OWN, TUBE = "own safe set", "tube"


def section(results: Results) -> str:
    """A line a case, strength and method.

    Raises:
        Missing: the study `transfer` is not there yet.
    """
    transfer = results.table(STUDY, "transfer", (*TABLES["transfer"], "seed"))
    cases = results.table(STUDY, "cases", TABLES["cases"])
    try:
        of_cases = with_cases(transfer, cases)
    except Unsuited as error:
        raise Missing(STUDY, f"the study `{STUDY}` cannot be read: {error}") from None
    lines = [
        [
            case,
            f"{row['strength']:g}",
            row["method"],
            *(_share(row, name) for name in ("entered", "admitted", "refused")),
        ]
        for case, rows in of_cases.items()
        for row in transfer_rows(rows).to_dict("records")
    ]
    head = ["case", "controls", "method", "entered", "doomed and let through", "safe and refused"]
    return (
        "Whoever cannot turn back any more avoids the states that lead to a region as well as the "
        "region itself, so demonstrations alone do not tell a region from its tube, and the tube "
        "depends on the controls. Here a region is inferred at the nominal control range, and "
        "random controls of other ranges are filtered by its own safe set, solved anew, or by "
        "the nominal one, whose complement is the tube that can be learned. *Doomed* states are "
        "outside the truth and cannot keep out of it; *safe* ones can.\n\n"
        "A case is a margin: how far demonstrators, and the filters, stay away from the border of "
        "their safe set. The derived one is the simulated demonstrator's default. The other was "
        "chosen after the outcome of the derived one was known, so both are to be read together. "
        "The transfer holds where the region inferred is the true one; the safe set of a neighbour "
        "guards the wrong place, and keeps out of the truth only as far as its tube and the margin "
        "cover that.\n\n"
        + "".join(_verdict(case, rows) for case, rows in of_cases.items())
        + "\n"
        + table(head, lines, words=3)
    )


def _verdict(case: str, transfer: pd.DataFrame) -> str:
    """What is inferred, and what each method lets in and refuses at other strengths."""
    rows, (right, points) = transfer_rows(transfer), right_points(transfer)
    own = rows[rows["method"] == OWN].set_index("strength")
    tube = rows[rows["method"] == TUBE].set_index("strength")
    worst = own["entered"].max()
    met = "met" if worst <= MOST else "missed"
    text = f"- **{case}.** The inferred region is the truth in {right} of {points} points"
    if right < points:
        text += (
            ": demonstrators who stay that far away avoid a neighbour of the truth too, which "
            "explains more of what they avoid"
        )
    text += (
        f". Its own safe set lets in at most {100 * worst:.2f} % of trials at any strength; the "
        f"target of {100 * MOST:.0f} % is {met}."
    )
    for strength in own.index[own.index != NOMINAL]:
        parts = [
            f"the {name} lets in {_share(each.loc[strength], 'entered')} of trials and refuses "
            f"{_share(each.loc[strength], 'refused')} of safe states"
            for name, each in (("tube", tube), ("own safe set", own))
        ]
        text += f" At {strength:g} times the controls {', '.join(parts)}."
    return text + "\n"


def _share(row: pd.Series, name: str) -> str:
    """A share in percent with its interval."""
    value, low, high = (row[f"{name}{end}"] for end in ("", "_low", "_high"))
    if pd.isna(value):
        return "-"
    return between(f"{100 * value:.1f} %", f"{100 * max(low, 0.0):.1f} %", f"{100 * high:.1f} %")
