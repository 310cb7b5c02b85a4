"""The main measures when each choice that the paper leaves open is changed, one at a time."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.claim_4 import RULE, TOP, after
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import DEFAULT, PAPER

STUDY = "sensitivity"
CELLS, DT = 400, 0.25  # of the rows that are spelt out
MEASURES = {
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
    means = means[means["measure"].isin(MEASURES)]
    ranks = cases.merge(after(results, STUDY), on=keys, validate="one_to_one")
    if DEFAULT not in set(ranks["case"]):
        raise Missing(STUDY, f"the study `{STUDY}` has no case {DEFAULT!r}")
    texts = means.assign(text=[_text(row) for row in means.to_dict("records")])
    wide = texts.pivot(index=keys, columns="measure", values="text").reset_index()
    ranks = ranks.merge(wide, on=keys, how="left", validate="one_to_one")
    names = list(dict.fromkeys(ranks["case"]))
    lines = []
    for case in names:
        rows = ranks[(ranks["case"] == case) & _is_spelt_out(ranks)].sort_values("truth")
        for row in rows.to_dict("records"):
            setting = f"{row['truth'].upper()}, {row['cells']} cells, dt {row['dt']:g}"
            lines.append([case, setting, *(row[name] for name in MEASURES), row["text"]])
    counts = ranks.groupby("case")["success"].agg(["sum", "size"]).loc[names]
    successes = [[case, f"{row['sum']} of {row['size']}"] for case, row in counts.iterrows()]
    head = ["case", "setting", *MEASURES.values(), f"median rank after {PAPER}; in the top {TOP}"]
    return (
        f"Settings (truth, cells and dt) in which the truth is found, which means {RULE}:\n\n"
        + table(["case", "found in"], successes)
        + _integrator(results)
        + f"\nAt {CELLS} cells, or little more, and dt {DT:g} s; the tables of `results/{STUDY}` "
        "have the other settings:\n\n" + table(head, lines, words=2)
    )


def _integrator(results: Results) -> str:
    """What the demonstrator's integrator changes: pairs kept, and the effort of kept ones."""
    column, keys = "demonstrations.integrator", ["truth", "seed", "trial"]
    try:
        attempts = results.table(STUDY, "attempts", (*keys, "outcome", "cost", column))
    except Missing:
        return ""
    free = attempts[attempts["safety.width"] == 0] if "safety.width" in attempts else attempts
    euler, smooth = (free[free[column] == name] for name in ("euler", "rk4"))
    both = euler.merge(smooth, on=keys, suffixes=("", "_rk4"), validate="one_to_one")
    kept = both[(both["outcome"] == "kept") & (both["outcome_rk4"] == "kept")]
    change = kept["cost_rk4"] / kept["cost"] - 1
    return (
        f"\nThe integrator: explicit Euler, as in the recordings, keeps "
        f"{(both['outcome'] == 'kept').sum()} of {len(both)} pairs and Runge-Kutta "
        f"{(both['outcome_rk4'] == 'kept').sum()}; of those that both keep, the cost with "
        f"Runge-Kutta differs by {100 * change.median():.1f} % in the median (80 % of them from "
        f"{100 * change.quantile(0.1):.1f} to {100 * change.quantile(0.9):.1f} %). Ranks stand in "
        "the tables, in the case of that name.\n"
    )


def demonstration_shares(results: Results) -> str:
    """Share of pairs that become demonstrations, by default and in each case that differs.

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


def _is_spelt_out(ranks: pd.DataFrame) -> pd.Series:
    """Whether a row is of the discretisation that is spelt out."""
    return ranks["cells"].between(CELLS, 1.1 * CELLS) & (ranks["dt"] == DT)


def _text(row: dict) -> str:
    """A mean with its interval."""
    spell = percent if row["measure"] == "reachable" else number
    return between(*(spell(row[end]) for end in ("mean", "low", "high")))
