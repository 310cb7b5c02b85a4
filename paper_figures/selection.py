"""Which rows of a study's tables a figure shows, where it cannot show all."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

# What the paper's figures show, where a study holds it; the nearest that it holds otherwise.
ACTIONS, SAMPLES = 9, 1

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
    chosen = nearest(nearest(table, "actions", ACTIONS), "samples", SAMPLES)
    if chosen.duplicated(list(keys)).any():
        raise Unsuited(f"rows differ in more than {', '.join(keys)}")
    return chosen.sort_values(list(keys), kind="stable")


def described(rows: pd.DataFrame, step: str = "dt") -> str:
    """The one point that rows are of, in words; `step` is the sign of its time step."""
    first = rows.iloc[0]
    return (
        f"truth {first['truth'].upper()}, {first['cells']} cells, {first['actions']} actions, "
        f"{step} = {first['dt']:g} s"
    )
