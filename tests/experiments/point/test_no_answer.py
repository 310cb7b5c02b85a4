"""Why no demonstration was kept: the bound and the trials that came nearest."""

from __future__ import annotations

import numpy as np

from experiments.point.no_answer import why_none
from mlci.systems import Pendulum


def test_reasons_have_the_bound_and_the_trials_that_came_nearest() -> None:
    """Three that leave, although an angle has no bound, and two that miss."""
    states = np.zeros((5, 3, 2))
    states[:, 1, 0] = 50.0
    states[:3, 2, 1] = [6.5, -6.25, 9.0]
    outcome = np.array(["bounds_left"] * 3 + ["goal_missed"] * 2)
    miss = np.array([0.0, 0.0, 0.0, 0.5, 0.25])
    assert why_none(outcome, states, miss, Pendulum().space, 0.05) == (
        "of 5 trials 0 entered the truth, 3 left the state space (trial 1 the least, "
        "angular_velocity by 0.25 beyond -6 to 6 rad/s), 2 missed the goal (trial 4 the least, by "
        "0.25; demonstrations.goal_tolerance is 0.05)"
    )
