"""Means with their intervals, looked up by truth, cells and time step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from paper_figures.report.markdown import between, by_dt, number
from paper_figures.report.study_tables import Missing, Results, paper_rows

Setting = tuple[str, int, float]  # truth, cells, dt


@dataclass(frozen=True)
class Mean:
    """A mean with the ends of its 95 % interval; NaN where there is no value."""

    value: float
    low: float
    high: float

    def lower_than(self, other: Mean) -> bool:
        """Whether the intervals do not overlap and this one is the lower; not for NaN."""
        return self.high < other.low

    def __str__(self) -> str:
        return between(number(self.value), number(self.low), number(self.high))


class Means(dict[Setting, Mean]):
    """Means by setting; one that is not there is told as missing."""

    def __missing__(self, setting: Setting) -> Mean:
        truth, cells, dt = setting
        raise Missing(
            "paper",
            f"the study `paper` has no point with truth {truth}, {cells} cells and dt {dt:g} s",
        )

    @property
    def truths(self) -> list[str]:
        return sorted({truth for truth, _, _ in self})

    @property
    def cells(self) -> list[int]:
        return sorted({cells for _, cells, _ in self})

    @property
    def steps(self) -> list[float]:
        return sorted({dt for _, _, dt in self})


def share(part: int, whole: int) -> Mean:
    """A share with Wilson's 95 % interval."""
    z, p = 1.96, part / whole
    middle = (p + z**2 / (2 * whole)) / (1 + z**2 / whole)
    half = z * math.sqrt(p * (1 - p) / whole + z**2 / (4 * whole**2)) / (1 + z**2 / whole)
    return Mean(p, middle - half, middle + half)


def measure(results: Results, name: str) -> Means:
    """A measure of the paper's study, in every setting with 9 actions.

    Raises:
        Missing: the study is not there yet.
    """
    columns = ("truth", "cells", "actions", "dt", "samples", "measure", "mean", "low", "high")
    rows = paper_rows(results.table("paper", "measures", columns))
    return Means(
        ((row.truth, row.cells, row.dt), Mean(row.mean, row.low, row.high))
        for row in rows[rows["measure"] == name].itertuples()
    )


def grid(means: Mapping[Setting, Mean]) -> str:
    """All settings as a table, a column for each time step."""
    rows = [(*setting, str(mean)) for setting, mean in means.items()]
    return by_dt(pd.DataFrame(rows, columns=["truth", "cells", "dt", "text"]), "text")
