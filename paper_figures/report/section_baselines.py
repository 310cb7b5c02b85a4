"""Other ways to rank regions, on the same demonstrations as ours."""

from __future__ import annotations

import numpy as np
import pandas as pd

from paper_figures.baselines import METHODS, TABLES, baseline_rows
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import Unsuited

STUDY = "baselines"
_OURS = "ours"


def section(results: Results) -> str:
    """A line a method and number of demonstrations, and where ours wins.

    Raises:
        Missing: the study `baselines` is not there yet.
    """
    name = "baseline_differences"
    try:
        rows = baseline_rows(results.table(STUDY, name, TABLES[name]))
    except Unsuited as error:
        raise Missing(STUDY, f"the study `{STUDY}` cannot be read: {error}") from None
    first = rows.iloc[0]
    lines = [
        [
            row.demonstrations,
            METHODS[row.method][0],
            _share(row, "top"),
            "-" if row.method == _OURS else _share(row, "top_less_ours", signed=True),
            number(float(np.exp(row.log_rank))),
            "-" if row.method == _OURS else _ratio(row),
        ]
        for row in rows.sort_values("demonstrations", kind="stable").itertuples()
    ]
    head = ["demonstrations", "method", "in the top 5", "less ours [%]", "geometric mean rank"]
    head += ["rank by ours"]
    return (
        f"Means over {first['points']} points, {first['truths']} truths of the pendulum, and "
        "random subsets of their demonstrations; differences are paired, with 95 % intervals over "
        "truths and seeds. A region that a demonstration enters comes last with every method. "
        "*Visitation difference*: expected less empirical time steps in a region. *Crossings of "
        "sampled paths*: the share of sampled unconstrained paths that cross it, added over tasks; "
        "it estimates the mean of Phi, where the likelihood multiplies 1 - Phi. *Nearest "
        "unvisited*: distance to the nearest demonstration. *Uniform*: all tie.\n\n"
        + _outcome(rows)
        + "\n"
        + table(head, lines, words=2)
    )


def _outcome(rows: pd.DataFrame) -> str:
    """Against which method ours wins, loses, or is not told apart, by the share in the top 5."""
    others = rows[(rows["method"] != _OURS)]
    wins = others[others["top_less_ours_high"] < 0]
    losses = others[others["top_less_ours_low"] > 0]
    even = others.drop(wins.index).drop(losses.index)
    return (
        f"- Ours has the truth in the top 5 more often, intervals apart from 0: {_named(wins)}.\n"
        f"- Less often: {_named(losses)}.\n"
        f"- The difference cannot be told from 0: {_named(even)}.\n"
    )


def _named(rows: pd.DataFrame) -> str:
    """Methods with numbers of demonstrations, in words."""
    parts = [
        f"{METHODS[str(method)][0]} ({', '.join(map(str, sorted(group['demonstrations'])))})"
        for method, group in rows.groupby("method", sort=False)
    ]
    return "; ".join(parts) or "nowhere"


def _share(row: object, name: str, *, signed: bool = False) -> str:
    """A share, or a difference of shares in percent, with its interval."""
    values = (getattr(row, name + end) for end in ("", "_low", "_high"))
    if signed:
        return between(*(f"{100 * value:+.0f}" for value in values))
    return between(*map(percent, values))


def _ratio(row: object) -> str:
    """The geometric mean rank as a multiple of ours, with its interval."""
    ends = ("", "_low", "_high")
    return between(*(f"{np.exp(getattr(row, f'log_rank_less_ours{end}')):.2g}" for end in ends))
