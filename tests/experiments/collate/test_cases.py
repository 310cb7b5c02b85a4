"""Names of a study's settings, as its plan has them."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from experiments.collate.cases import case_names, case_table


@pytest.mark.parametrize(
    ("overrides", "name"),
    [
        (["dt=0.5", "case=default"], "default"),
        (["case='temperature: 2'"], "temperature: 2"),
        (['case="a=b"', "dt=1"], "a=b"),
        (["case=first", "case=last"], "last"),
        (["case=first", "case=''"], None),
        (["subcase=no", "dt=0.5"], None),
    ],
)
def test_name_of_a_point(overrides: list[str], name: str | None) -> None:
    assert case_names({"point": overrides}) == ({} if name is None else {"point": name})


@pytest.fixture
def summary(tmp_path: Path) -> Path:
    """Two seeds of two temperatures, and a point beside them."""
    rows = [(1.0, 0), (1.0, 1), (2.0, 0), (2.0, 1), (3.0, 0)]
    table = pd.DataFrame({"temperature": [t for t, _ in rows], "truth": "c1"})
    table.assign(seed=[seed for _, seed in rows], kept=9).to_csv(tmp_path / "s.csv", index=False)
    return tmp_path / "s.csv"


def test_a_row_a_case_in_the_order_of_the_plan(summary: Path) -> None:
    names = {"c": "temperature: 2", "d": "temperature: 2", "a": "default", "b": "default"}
    table = case_table(summary, list("abcde"), names)
    assert table is not None
    assert table.to_dict("split")["data"] == [
        ["2.0", "c1", "temperature: 2", "temperature", "2"],
        ["1.0", "c1", "default", "default", ""],
    ]
    assert list(table.columns) == ["temperature", "truth", "case", "choice", "value"]


def test_no_table_without_a_name_of_its_points(summary: Path) -> None:
    assert case_table(summary, list("abcde"), {}) is None
    assert case_table(summary, list("abcde"), {"another": "default"}) is None
