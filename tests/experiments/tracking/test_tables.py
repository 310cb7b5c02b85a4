"""Ten digits in tables, and when two tables agree."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from experiments.tracking.files import csv_bytes
from experiments.tracking.tables import agree, rounded


def test_floats_have_ten_digits_and_nothing_else_changes() -> None:
    table = pd.DataFrame(
        {
            "number": [1 / 3, -2e5 / 3, 1e-300 / 3, np.inf, np.nan, -0.0],
            "word": ["0.12345678901234", "", "x", "inf", "nan", "-0.0"],
            "whole": [12345678901234, 0, 1, 2, 3, -5],
            "flag": [True, False] * 3,
        }
    )
    assert csv_bytes(rounded(table)).decode().splitlines() == [
        "number,word,whole,flag",
        "0.3333333333,0.12345678901234,12345678901234,True",
        "-66666.66667,,0,False",
        "3.333333333e-301,x,1,True",
        "inf,inf,2,False",
        ",nan,3,True",
        "-0.0,-0.0,-5,False",
    ]
    assert table["number"][0] == 1 / 3
    assert rounded(table.head(0)).dtypes["whole"] == np.int64


HEAD = "name,count,value\n"
TABLE = HEAD + "a,20000000001,0.25\nb,2,1e-15\nc,3,250.0\n"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.25", "0.2500000001"),
        ("0.25", "0.2499999999"),
        ("1e-15", "3e-15"),
        ("1e-15", "0.0"),
        ("1e-15", "-0.0"),
        ("250.0", "250"),
        ("250.0", "250.000001"),
    ],
)
def test_tables_agree_if_numbers_differ_by_rounding(old: str, new: str) -> None:
    assert agree(TABLE.encode(), TABLE.replace(old, new).encode())
    assert agree(TABLE.replace(old, new).encode(), TABLE.encode())


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("0.25", "0.25000002"),
        ("250.0", "250.00001"),
        ("1e-15", "2e-8"),
        ("20000000001", "20000000002"),
        ("1e-15", ""),
        ("1e-15", "nan"),
        ("250.0", "inf"),
        ("250.0", "1e400"),
        ("a,", "b,"),
        ("value", "worth"),
        ("b,2,1e-15\n", ""),
        ("c,3,250.0\n", "c,3,250.0,1\n"),
        (",value", ""),
        (TABLE, ""),
        ("a,", "\udcff,"),
    ],
)
def test_tables_do_not_agree_otherwise(old: str, new: str) -> None:
    changed = TABLE.replace(old, new).encode("utf-8", "surrogateescape")
    assert not agree(TABLE.encode(), changed)
    assert not agree(changed, TABLE.encode())


def test_a_column_of_small_numbers_has_a_small_scale() -> None:
    """Whatever its unit: kilometres agree where metres do."""
    assert not agree(b"x\n1e-9\n2e-9\n", b"x\n1e-9\n3e-9\n")
    assert agree(b"x\n1e-9\n2e-9\n", b"x\n1e-9\n2.000000001e-9\n")
    assert agree(b"x\n0.0\n2e-15\n", b"x\n-1e-15\n0.0\n")  # rounding alone
    assert agree(b"x\ninf\n1e-9\n", b"x\ninf\n1.000000001e-9\n")
