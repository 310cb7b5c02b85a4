"""Claim 1: how many of 100 start and goal pairs become demonstrations."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import between, percent, table
from paper_figures.report.means import share
from paper_figures.report.section_choices import demonstration_shares
from paper_figures.report.study_tables import Missing, Results, command
from paper_figures.report.verdict import Check, Claim, Part

PAPER = 0.65


def claim(results: Results) -> Claim:
    """Write claim 1.

    Raises:
        Missing: the study `paper` is not there yet.
    """
    attempts = results.table("paper", "attempts", ("truth", "seed", "outcome"))
    checks, rows = [], []
    outcomes = ["kept", *sorted(set(attempts["outcome"]) - {"kept"})]
    for truth, pairs in attempts.groupby("truth"):
        counts = [int((pairs["outcome"] == outcome).sum()) for outcome in outcomes]
        part = share(counts[0], len(pairs))
        text = between(percent(part.value), percent(part.low), percent(part.high))
        checks.append(Check(str(truth).upper(), part.low <= PAPER <= part.high, text))
        by_seed = pairs[pairs["outcome"] == "kept"].groupby("seed").size()
        row = [str(truth).upper(), pairs["seed"].nunique(), len(pairs), *counts, text]
        rows.append([*row, f"{by_seed.min()} to {by_seed.max()}"])
    words = [outcome.replace("_", " ") for outcome in outcomes]
    head = ["truth", "seeds", "pairs", *words, "share kept", "kept a seed"]
    return Claim(
        title="Pairs that become demonstrations",
        paper="of 100 random start and goal pairs for each true constraint, 65 were solved and "
        "make the study; the others met the constraint or missed their goal.",
        parts=[
            Part(
                "65 of 100 pairs are kept",
                "65 % lies in the 95 % interval of the share that is kept",
                checks,
            )
        ],
        numbers=table(head, rows) + "\nIntervals: Wilson's, of all pairs of all seeds. "
        "The first 65 that are kept make the study, as in the paper.\n",
        why=_why(results, attempts),
        command=command("paper"),
    )


def _why(results: Results, attempts: pd.DataFrame) -> str:
    """What else than the optimiser could explain the difference, as far as it was tried."""
    losses = attempts[attempts["outcome"] != "kept"]["outcome"].value_counts()
    if losses.empty:
        return ""
    text = (
        f"Of the {losses.sum()} pairs that are lost, {losses.iloc[0]} are "
        f"`{losses.index[0].replace('_', ' ')}`."
    )
    peaks = attempts[attempts["outcome"] == "kept"]["peak_control"]
    text += (
        f" Half of the kept demonstrations need a control of more than {peaks.median():.2f} rad/s²"
        f" at some time, {percent((peaks > 2).mean())} of them more than the 2 rad/s² of the"
        " tabular agent."
    )
    try:
        shares = demonstration_shares(results)
    except Missing:
        return text + "\n"
    return f"{text} Share kept when one choice that the paper leaves open is changed:\n\n{shares}"
