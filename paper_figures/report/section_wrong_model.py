"""How far the answer can be trusted where real demonstrators are not the nominal model."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.claim_4 import TOP
from paper_figures.report.markdown import between, count, percent, table
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import DEFAULT, PAPER, Unsuited
from paper_figures.wrong_model import BY_CHANCE, RARE, TABLES, wrong_model_rows

STUDY = "wrong_model"
_LOST = 0.5  # of the default's share in the top 5, below which an answer is lost
_SURE = 0.1  # by which the best hypothesis may claim more than it is right
_FIRING = 3  # times as many rare demonstrations as of the model's own


def section(results: Results) -> str:
    """A line for each case and truth, and from where not to trust the answer.

    Raises:
        Missing: the study `wrong_model` is not there yet.
    """
    try:
        rows = wrong_model_rows(
            **{name: results.table(STUDY, name, TABLES[name]) for name in TABLES}
        )
    except Unsuited as error:
        raise Missing(STUDY, f"the study `{STUDY}` cannot be read: {error}") from None
    default = rows[rows["case"] == DEFAULT].set_index("truth")["top"]
    rows = rows.assign(
        lost=rows["top_high"] < _LOST * rows["truth"].map(default),
        sure=rows["claim_low"] - rows["right_high"] > _SURE,
        fires=rows[RARE] > _FIRING * BY_CHANCE,
    )
    lines = [
        [
            row.case,
            row.truth.upper(),
            count(row.rank),
            *(_share(row, name) for name in ("top", "claim", "right", RARE)),
        ]
        for row in rows.itertuples()
    ]
    head = ["real demonstrators", "truth", f"median rank after {PAPER}", f"in the top {TOP}"]
    head += ["best claims", "best is right", "nearly impossible"]
    return (
        "Inference knows the nominal system; here real demonstrators have other parameters, weigh "
        "their speed, record with noise, shake, or stop early. Inference is that of `infer`. Drag "
        "is in shares of sqrt(g / l), for the nominal pendulum has none; *nearly impossible* are "
        f"demonstrations that the tabular model finds so (p < 0.01), {percent(BY_CHANCE)} of its "
        "own.\n\n" + _limits(rows) + "\n" + table(head, lines, words=2)
    )


def _limits(rows: pd.DataFrame) -> str:
    """Where the truth is lost, where the best claims too much, and whether a warning fires."""
    lost, sure, fires = (_named(rows[rows[name]]) for name in ("lost", "sure", "fires"))
    fires = "in all of them" if rows["fires"].all() else fires
    silent = _named(rows[(rows["lost"] | rows["sure"]) & ~rows["fires"]])
    of_default = rows.loc[rows["case"] == DEFAULT, RARE].mean()
    return (
        f"- The truth is lost (the share in the top {TOP} is below half of the default's, with its "
        f"interval) where: {lost}.\n"
        f"- The best hypothesis claims at least {percent(_SURE)} more than it is right, intervals "
        f"apart, where: {sure}.\n"
        f"- Nearly impossible demonstrations are more than {_FIRING} times as many as of the "
        f"model's own (nominal demonstrators: {percent(of_default)}) where: {fires}.\n"
        f"- The answer is lost or too sure and they are no more, where: {silent}.\n"
    )


def _named(rows: pd.DataFrame) -> str:
    """Cases with their truths, in words."""
    truths = rows.groupby("case", sort=False)["truth"].agg(lambda each: ", ".join(each.str.upper()))
    return "; ".join(f"{case} ({names})" for case, names in truths.items()) or "nowhere"


def _share(row: object, name: str) -> str:
    """A share with its interval."""
    return between(*(percent(getattr(row, name + end)) for end in ("", "_low", "_high")))
