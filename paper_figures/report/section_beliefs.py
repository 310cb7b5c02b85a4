"""Is the posterior right as often as it says? Over simulated worlds, weighed by the prior."""

from __future__ import annotations

import numpy as np
import pandas as pd

from paper_figures.report.markdown import number, percent, table
from paper_figures.report.study_tables import Missing, Results

STUDY = "calibration"
FEW = 20  # beliefs; bins with fewer say nothing
BELIEFS = {
    "each": "every hypothesis, exact posterior",
    "selected": "the most likely one, exact posterior",
    "none": "that there is no constraint, exact posterior",
    "corrected": "the most likely one, (12) corrected",
    "printed": "the most likely one, (12) as printed",
}
SOURCES = {"model": "drawn from the tabular model", "demonstrator": "shown by the demonstrator"}
COLUMNS = ("source", "demonstrations", "belief", "lower", "upper", "predicted", "observed", "low")


def section(results: Results) -> str:
    """A line for each source of demonstrations, kind of belief and number of demonstrations.

    Raises:
        Missing: the study `calibration` is not there yet.
    """
    beliefs = results.table(STUDY, "reliability", (*COLUMNS, "high", "weight", "count"))
    lines = []
    for source, words in SOURCES.items():
        for belief, meant in BELIEFS.items():
            rows = beliefs[(beliefs["source"] == source) & (beliefs["belief"] == belief)]
            for size, bins in rows.groupby("demonstrations"):
                lines.append([words, meant, size, *_judged(bins)])
    if not lines:
        raise Missing(STUDY, f"the study `{STUDY}` has no beliefs of a known kind")
    head = ["demonstrations", "belief", "how many", "mean probability", "right", "off by"]
    head += ["bins that agree", "no probability"]
    return (
        "Worlds are simulated with each hypothesis as the truth, and with none, as often as the "
        "prior says; a belief of probability p should be right in a share p of them. Beliefs are "
        "put into bins by their probability. *Off by* is the mean over beliefs of the distance "
        "between a bin's mean probability and the share that is right; a bin *agrees* if the 95 % "
        f"interval of that share (bootstrap over worlds and their sets) has the probability in it, "
        f"and bins of fewer than {FEW} beliefs do not count. *No probability* is the share of "
        "values outside of 0 to 1. With demonstrations that are drawn from the tabular model "
        "itself, the exact posterior must agree; with those of the demonstrator, what is off is "
        "the error of the tabular model.\n\n" + table(head, lines, words=2)
    )


def _judged(bins: pd.DataFrame) -> list[str]:
    """Mean probability, share that is right, how far off, and how many bins agree."""
    inside = bins[np.isfinite(bins["lower"]) & np.isfinite(bins["upper"])]
    beyond = 1 - inside["weight"].sum() / bins["weight"].sum()
    if inside.empty:
        return ["-", "-", "-", "-", percent(beyond)]
    share = inside["weight"] / inside["weight"].sum()
    off = (inside["predicted"] - inside["observed"]).abs()
    many = inside[inside["count"] >= FEW]
    agrees = (many["low"] <= many["predicted"]) & (many["predicted"] <= many["high"])
    return [
        number(float(np.sum(share * inside["predicted"]))),
        number(float(np.sum(share * inside["observed"]))),
        number(float(np.sum(share * off))),
        f"{agrees.sum()} of {len(many)}" if len(many) else "-",
        percent(beyond),
    ]
