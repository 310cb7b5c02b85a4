"""Tables of single trajectories, against a chain of cells where every move is known."""

import numpy as np
import pytest
from toy_models import toy_model

from experiments.point.trajectory_tables import (
    probability_table,
    trajectory_tables,
    trial_that_shows_the_constraint,
)
from mlci.tabular import TabularModel

# Four cells in a row, actions back (0) and on (1). Hypothesis 0 is crossed on the way between
# cells 1 and 2, hypothesis 1 between 2 and 3; region 0 is the truth, crossed as hypothesis 1.
CROSSED = {(1, 1): [1], (2, 0): [1], (2, 1): [0, 2], (3, 0): [0, 2]}
HYPOTHESES = np.array([False, True, True])


@pytest.fixture
def chain() -> TabularModel:
    successor = np.array([[-1, 1], [0, 2], [1, 3], [2, -1]])
    crosses = np.zeros((8, 3), dtype=bool)
    for (cell, action), regions in CROSSED.items():
        crosses[2 * cell + action, regions] = True
    return toy_model(successor, np.zeros((4, 2)), successor >= 0, crosses)


def test_visits_and_violations_are_those_of_the_moves(chain: TabularModel) -> None:
    trajectories = {
        3: (np.array([0, 1, 0]), np.array([1, 0])),  # turns before any region
        7: (np.array([1, 2, 3]), np.array([1, 1])),  # through everything
    }
    violated = {3: np.array([False, False]), 5: np.array([False, True]), 7: np.array([True, False])}
    tables = trajectory_tables(chain, HYPOTHESES, trajectories, violated, example=3)
    assert tables["sampled"].to_numpy().tolist() == [
        *([3, 0, 0], [3, 1, 1], [3, 2, 0]),
        *([7, 0, 1], [7, 1, 2], [7, 2, 3]),
    ]
    assert tables["violations"].to_numpy().tolist() == [
        [5, "demonstration", 1],
        [7, "demonstration", 0],
        [7, "sampled", 0],
        [7, "sampled", 1],  # the truth, region 0, is no hypothesis
    ]
    # All moves from cells 0 and 1, none twice although cell 0 is visited twice.
    assert tables["moves"].to_numpy().tolist() == [[0, 1, 1], [1, 0, 0], [1, 1, 2]]


def test_nothing_feasible_leaves_tables_with_columns_alone(chain: TabularModel) -> None:
    tables = trajectory_tables(chain, HYPOTHESES, {}, {4: np.array([True, False])}, None)
    assert list(tables["sampled"].columns) == ["trial", "step", "cell"]
    assert len(tables["sampled"]) == len(tables["moves"]) == 0
    assert tables["violations"].to_numpy().tolist() == [[4, "demonstration", 0]]
    phi = np.array([0.5, 0.25])
    table = probability_table(None, phi, phi)
    assert list(table.columns) == ["trial", "hypothesis", "unconstrained", "constrained"]
    assert len(table) == 0
    table = probability_table(6, phi, 2 * phi)
    assert table.to_numpy().tolist() == [[6, 0, 0.5, 1.0], [6, 1, 0.25, 0.5]]


def test_telling_trial_would_violate_the_truth_most() -> None:
    phi = np.array([[0.9, 0.1], [0.0, 0.3], [0.2, 0.7], [0.1, 0.3]])
    second = np.array([False, True])
    assert trial_that_shows_the_constraint(np.array([True] * 4), phi, second) == 2
    assert trial_that_shows_the_constraint(np.array([True, True, False, True]), phi, second) == 1
    # A truth that covers no hypothesis tells nothing: the first that is feasible.
    none = np.array([False, False])
    assert trial_that_shows_the_constraint(np.array([False, True, True, True]), phi, none) == 1


def test_rounding_does_not_choose_the_trial_that_shows_the_constraint() -> None:
    chance = np.array([[0.2], [0.7 - 1e-16], [0.7], [0.7 + 1e-16]])
    assert trial_that_shows_the_constraint(np.ones(4, bool), chance, np.ones(1, bool)) == 1
