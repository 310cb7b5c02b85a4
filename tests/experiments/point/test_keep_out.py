"""What keeps demonstrators out of a truth, where no margin can be derived."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.point.keep_out import derived_margin
from experiments.point.no_answer import NoAnswer
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.spaces import Box
from mlci.systems import Pendulum


def test_where_no_margin_can_be_derived_the_keys_that_help_are_told() -> None:
    weak = Pendulum(control_limit=0.5)
    wall = Regions.from_boxes(weak.space, [Box([np.pi, -np.inf], [1.2 * np.pi, np.inf])])
    safe_set = solve_safe_set(weak, Grid(weak.space, (31, 31)), wall)
    with pytest.raises(NoAnswer, match=r"safety\.margin: null, but .* as in safety\.margin=0\.1"):
        derived_margin(weak, safe_set, 0.01)
