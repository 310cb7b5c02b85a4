"""The main measures when each choice that the paper leaves open is changed, one at a time."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.claim_4 import PAPER, RULE, TOP, after
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results

STUDY = "sensitivity"
DEFAULT = "default"  # the case that the others are compared with
CELLS, DT = 400, 0.25  # of the rows that are spelt out
SHOWN = {
    "reachable": "goals that can be reached",
    "final_state_error": "final-state error",
    "violation_distance": "violation distance",
}


def section(results: Results) -> str:
    """A line for each case, truth and discretisation, the default first.

    Raises:
        Missing: the study `sensitivity` is not there yet.
    """
    cases = results.table(STUDY, "cases", ("truth", "cells", "dt", "case"))
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    means = results.table(STUDY, "measures", (*keys, "measure", "mean", "low", "high"))
    means = means[means["measure"].isin(SHOWN)]
    ranks = cases.merge(after(results, STUDY), on=keys, validate="one_to_one")
    usual = ranks[ranks["case"] == DEFAULT]
    if usual.empty:
        raise Missing(STUDY, f"the study `{STUDY}` has no case {DEFAULT!r}")
    texts = means.assign(text=[_text(row) for row in means.to_dict("records")])
    wide = texts.pivot(index=keys, columns="measure", values="text").reset_index()
    ranks = ranks.merge(wide, on=keys, how="left", validate="one_to_one")
    names = list(dict.fromkeys(ranks["case"]))
    lines = []
    for case in names:
        own = ranks[(ranks["case"] == case) & _usual_grid(ranks)].sort_values("truth")
        for row in own.to_dict("records"):
            setting = f"{row['truth'].upper()}, {row['cells']} cells, dt {row['dt']:g}"
            lines.append([case, setting, *(row[name] for name in SHOWN), row["text"]])
    found = ranks.groupby("case")["found"].agg(["sum", "size"]).loc[names]
    verdicts = [[case, f"{row['sum']} of {row['size']}"] for case, row in found.iterrows()]
    head = ["case", "setting", *SHOWN.values(), f"median rank after {PAPER}; in the top {TOP}"]
    return (
        f"Settings (truth, cells and dt) in which the truth is found, which means {RULE}:\n\n"
        + table(["case", "found in"], verdicts)
        + f"\nAt {CELLS} cells, or little more, and dt {DT:g} s; the tables of `results/{STUDY}` "
        "have the other settings:\n\n" + table(head, lines, words=2)
    )


def kept(results: Results) -> str:
    """How many pairs become demonstrations by default and in each case where others do.

    Raises:
        Missing: the study `sensitivity` is not there yet.
    """
    cases = results.table(STUDY, "cases", ("truth", "cells", "dt", "case"))
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    pairs = cases.merge(results.table(STUDY, "summary", (*keys, "pairs", "kept")), on=keys)
    shares = pairs.assign(share=pairs["kept"] / pairs["pairs"]).groupby(["case", "truth"])["share"]
    wide = shares.first().unstack()
    wide = wide.loc[list(dict.fromkeys(pairs["case"]))]
    wide = wide[(wide != wide.loc[DEFAULT]).any(axis=1) | (wide.index == DEFAULT)]
    return table(
        ["case", *(truth.upper() for truth in wide)],
        [[case, *(percent(value) for value in row)] for case, row in wide.iterrows()],
    )


def _usual_grid(ranks: pd.DataFrame) -> pd.Series:
    """Whether a row is of the default discretisation."""
    return ranks["cells"].between(CELLS, 1.1 * CELLS) & (ranks["dt"] == DT)


def _text(row: dict) -> str:
    """A mean with its interval."""
    spell = percent if row["measure"] == "reachable" else number
    return between(*(spell(row[end]) for end in ("mean", "low", "high")))
