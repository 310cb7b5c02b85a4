"""How much it gains at 100 cells to average moves over start points inside a cell."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.claim_4 import RULE, TOP, after
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Results
from paper_figures.rows import PAPER

STUDY = "in_cell"
CELLS = 100
KEYS = ["truth", "dt", "samples"]
MEASURES = {"reachable": percent, "final_state_error": number, "violation_distance": number}
HEAD = (
    "truth, dt, samples",
    "goals that can be reached",
    "final-state error",
    "violation distance",
    f"median rank after {PAPER}; share in the top {TOP}",
)


def _successes(ranks: pd.DataFrame) -> str:
    """In how many settings the truth is found, by the number of start points."""
    counts = ranks.groupby("samples")["success"].agg(["sum", "size"])
    words = "; ".join(
        f"{samples} a dimension: {row['sum']} of {row['size']}"
        for samples, row in counts.iterrows()
    )
    return (
        f"With {CELLS} cells, moves that start at several points of a cell instead of its centre "
        "alone let the agent leave cells that are otherwise frozen. Settings (truth and dt) in "
        f"which the truth is found, which means {RULE}, by start points: {words}.\n"
    )


def section(results: Results) -> str:
    """A line for each truth, time step and number of samples.

    Raises:
        Missing: the study `in_cell` is not there yet.
    """
    columns = (*KEYS, "cells", "measure", "mean", "low", "high")
    means = results.table(STUDY, "measures", columns)
    means = means[means["cells"] == CELLS]
    by_setting = {
        (*(row[key] for key in KEYS), row["measure"]): row for row in means.to_dict("records")
    }
    rows = []
    ranks = _ranks(results)
    for rank in ranks.to_dict("records"):
        key = tuple(rank[name] for name in KEYS)
        texts = [
            between(*(spell(by_setting[(*key, name)][end]) for end in ("mean", "low", "high")))
            for name, spell in MEASURES.items()
        ]
        label = f"{rank['truth'].upper()}, {rank['dt']:g} s, {rank['samples']}"
        rows.append([label, *texts, rank["text"]])
    return f"{_successes(ranks)}\n{table(HEAD, rows)}"


def _ranks(results: Results) -> pd.DataFrame:
    """Ranks with 100 cells."""
    ranks = after(results, STUDY)
    return ranks[ranks["cells"] == CELLS].sort_values(KEYS)
