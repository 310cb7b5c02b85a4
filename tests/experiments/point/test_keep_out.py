"""What keeps demonstrators out of a truth, where no margin can be derived."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.point.keep_out import derived_margin
from experiments.point.no_answer import NoAnswer
from experiments.point.stages import settled_safe_set
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.spaces import Box, StateSpace
from mlci.systems import FunctionSystem, Pendulum


def test_where_no_margin_can_be_derived_the_keys_that_help_are_told() -> None:
    weak = Pendulum(control_limit=0.5)
    wall = Regions.from_boxes(weak.space, [Box([np.pi, -np.inf], [1.2 * np.pi, np.inf])])
    safe_set = solve_safe_set(weak, Grid(weak.space, (31, 31)), wall)
    with pytest.raises(NoAnswer, match=r"safety\.margin: null, but .* as in safety\.margin=0\.1"):
        derived_margin(weak, safe_set, 0.01)


def test_a_safe_set_that_does_not_settle_is_told_with_its_keys() -> None:
    """Where the first state creeps into a wall, whatever the control does to the second."""
    plane = StateSpace(Box([0.0, -1.0], [4.0, 1.0]), [False, False], ("x", "y"))
    creeps = FunctionSystem(lambda x, u: (-0.03 + 0 * x[..., 0], u[..., 0]), plane, Box([-2], [2]))
    wall = Regions.from_boxes(plane, [Box([0.0, -np.inf], [0.5, np.inf])])
    with pytest.raises(
        NoAnswer, match=r"^transfer\.strengths: 0\.01: no .* reach 2: V still falls"
    ):
        settled_safe_set(creeps, Grid(plane, (41, 3)), wall, "transfer.strengths: 0.01")
