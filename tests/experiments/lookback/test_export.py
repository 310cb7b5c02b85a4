"""What an export holds for other programs."""

import pandas as pd

from experiments.lookback.export import file_bytes


def test_no_text_of_an_export_is_a_formula() -> None:
    words = ["=1+1", "+x", "-cmd", "@sum", "\tx", "wall", ""]
    table = pd.DataFrame({"truth": words, "=gain": [-1.5, float("-inf"), 0, 1, 2, 3, 4]})
    lines = file_bytes(table, "csv").decode().splitlines()
    assert lines == [
        "truth,'=gain",
        *("'=1+1,-1.5", "'+x,-inf", "'-cmd,0.0", "'@sum,1.0", "'\tx,2.0", "wall,3.0", ",4.0"),
    ]
