"""Tables that make no figure, because their rows cannot be told apart or do not vary."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from figure_study import curve_rows, measure_rows

from paper_figures import final_state_error, rank_curve
from paper_figures.rows import Unsuited


def test_rows_that_would_lie_on_one_another_are_not_drawn() -> None:
    twice = pd.concat([curve_rows().assign(temperature=t) for t in (1, 2)])
    with pytest.raises(Unsuited, match="rows differ in more than truth, cells, dt"):
        rank_curve.draw(twice)


def test_many_truths_and_none_to_rank_are_not_drawn() -> None:
    many = pd.concat([curve_rows().assign(truth=f"cell_{number}") for number in range(5)])
    with pytest.raises(Unsuited, match="5 truths are more than 4 panels"):
        rank_curve.draw(many)
    with pytest.raises(Unsuited, match="there is no truth to rank"):
        rank_curve.draw(curve_rows().assign(median=np.nan))


def test_what_does_not_vary_is_no_curve() -> None:
    rows = measure_rows()
    with pytest.raises(Unsuited, match="neither cells nor dt varies"):
        final_state_error.draw(rows[(rows["cells"] == 100) & (rows["dt"] == 0.5)])
    with pytest.raises(Unsuited, match="table measures has no measure final_state_error"):
        final_state_error.draw(rows[rows["measure"] != "final_state_error"])
