"""Claims 1 and 4 under each reading of the paper: is there one in which both hold?"""

from __future__ import annotations

import pandas as pd

from paper_figures.readings import PAPER_KEPT, TABLES, reading_rows
from paper_figures.report.claim_4 import HALF, RULE, TOP
from paper_figures.report.markdown import between, count, number, percent, table
from paper_figures.report.means import share
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import PAPER, Unsuited

STUDY = "readings"
NAMED = {"the default": "2 rad/s: free", "`reading=printed`": "6 rad/s: clipped"}


def judged_readings(results: Results) -> pd.DataFrame:
    """A row a truth and reading, as of `reading_rows`, with `keeps` and `finds`.

    The former is the rule of claim 1, the latter that of claim 4 at 400 cells and dt 0.25 s.

    Raises:
        Missing: the study `readings` is not there yet.
    """
    try:
        rows = reading_rows(**{name: results.table(STUDY, name, TABLES[name]) for name in TABLES})
    except Unsuited as error:
        raise Missing(STUDY, f"the study `{STUDY}` has {error}") from None
    shares = [share(kept, pairs) for kept, pairs in zip(rows["kept"], rows["pairs"], strict=True)]
    texts = [between(percent(each.value), percent(each.low), percent(each.high)) for each in shares]
    return rows.assign(
        kept_text=texts,
        keeps=[each.low <= PAPER_KEPT <= each.high for each in shares],
        finds=(rows["median"] <= TOP) & (rows["top_low"] >= HALF),
    )


def section(results: Results) -> str:
    """A line for each truth and reading, and what follows.

    Raises:
        Missing: the study `readings` is not there yet.
    """
    rows = judged_readings(results)
    both = rows.groupby("case", sort=False)[["keeps", "finds"]].all()
    holding = both.index[both.all(axis=1)].tolist()
    related = rows[["expected", "top"]].corr(method="spearman").iloc[0, 1]
    lines = [
        [
            row.case,
            row.truth.upper(),
            row.kept_text,
            _yes(row.keeps),
            f"{count(row.median)}; "
            + between(percent(row.top), percent(row.top_low), percent(row.top_high)),
            _yes(row.finds),
            percent(row.top_late),
            number(row.expected),
        ]
        for row in rows.itertuples()
    ]
    head = ["reading", "truth", "pairs kept", f"{percent(PAPER_KEPT)} kept"]
    head += [f"median rank after {PAPER}; in the top {TOP}", "found", f"in the top {TOP} after 20"]
    head += [f"expected entries in {PAPER}"]
    answer = (
        f"Both claims hold for both truths in: {'; '.join(holding)}."
        if holding
        else "In no reading do both claims hold for both truths."
    )
    return (
        "The paper leaves open how fast starts and goals are, whether controls are clipped to the "
        "range of the actions, and whether paths may wind. Claim 1 (65 % of the pairs are kept: "
        f"65 % lies in Wilson's interval) and claim 4 (found, at 400 cells and dt 0.25 s: {RULE}) "
        f"under each reading, over {len(set(rows['case']))} readings. {answer}\n\n"
        f"{_named(rows)}\n"
        "Why the claims pull apart: a truth is found by what demonstrations would have entered, "
        "were it not there. *Expected entries* is the sum over "
        f"{PAPER} demonstrations of the probability that the unconstrained tabular agent enters "
        f"the truth; its rank correlation with the share in the top {TOP} is {related:.2f}. Fast "
        "starts and goals are where few paths pass a slow truth.\n\n" + table(head, lines, words=2)
    )


def _named(rows: pd.DataFrame) -> str:
    """Verdicts on both claims under the readings that have a name of their own."""
    lines = []
    for words, case in NAMED.items():
        of_case = rows[rows["case"] == case]
        if not of_case.empty:
            lines.append([words, case, *(_verdict(of_case, rule) for rule in ("keeps", "finds"))])
    return table(["reading", "which is", "claim 1 holds", "claim 4 holds"], lines, words=2)


def _verdict(rows: pd.DataFrame, rule: str) -> str:
    """For which truths a rule holds."""
    good = [str(truth).upper() for truth in rows[rows[rule]]["truth"]]
    return f"for {' and '.join(good)}" if good else "for no truth"


def _yes(holds: bool) -> str:
    return "yes" if holds else "no"
