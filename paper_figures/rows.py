"""Which rows of a study's tables figures and report show, where they cannot show all."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

# What the paper's figures show, where a study holds it; the nearest that it holds otherwise.
ACTIONS, SAMPLES = 9, 1
PAPER = 9  # demonstrations after which the paper finds the truth among the first

DEFAULT = "default"  # the case of a study with which its others are compared

ALL_TASKS = "all tasks"

_CROSSING = "tasks.crossing"  # the column of a study that has both kinds of tasks
_MOST_TRUTHS = 4  # that have panels of their own in one figure


class Unsuited(Exception):
    """These tables cannot make this figure; the message tells why."""


def nearest(table: pd.DataFrame, column: str, value: float) -> pd.DataFrame:
    """The rows whose `column` is nearest to a value; of words, those with the first."""
    if not pd.api.types.is_numeric_dtype(table[column]):
        return table[table[column] == table[column].min()]
    off = (table[column] - value).abs()
    return table[off == off.min()]


def paper_rows(table: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """The rows with 9 actions and one sample a cell, or nearest to them, which `keys` tell apart.

    Raises:
        Unsuited: something else varies in the table, so that rows would lie on one another, or
            there are too many truths for panels of their own.
    """
    if (count := table["truth"].nunique()) > _MOST_TRUTHS:
        raise Unsuited(f"{count} truths are more than {_MOST_TRUTHS} panels")
    rows = nearest(nearest(table, "actions", ACTIONS), "samples", SAMPLES)
    if rows.duplicated(list(keys)).any():
        raise Unsuited(f"rows differ in more than {', '.join(keys)}")
    return rows.sort_values(list(keys), kind="stable")


def gain_in_words(gain: float) -> str:
    """The gain of a hypothesis; missing where the tabular agent cannot avoid it."""
    return "unavoidable" if np.isnan(gain) else f"gain {gain:.3g} nat"


def described(rows: pd.DataFrame, step: str = "dt") -> str:
    """The one point that rows are of, in words; `step` is the sign of its time step."""
    first = rows.iloc[0]
    return (
        f"truth {first['truth'].upper()}, {first['cells']} cells, {first['actions']} actions, "
        f"{step} = {first['dt']:g} s"
    )


def by_tasks(table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """The rows of each kind of tasks, in words; all rows where a table knows but one kind."""
    if _CROSSING not in table:
        yield ALL_TASKS, table
        return
    for crossing, rows in table.groupby(_CROSSING, sort=True):
        yield "tasks that cross the truth" if crossing else "random tasks", rows


def with_cases(cases: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table of settings that some case names, with its name, in the cases' order.

    Raises:
        Unsuited: no case is the default.
    """
    if DEFAULT not in set(cases["case"]):
        raise Unsuited(f"no case is named {DEFAULT}")
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    return cases.merge(table, on=keys)
