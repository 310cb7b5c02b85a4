"""Tasks that promise the best area, against every truth and trajectory of a small world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlci.areas.evidence import ShapeEvidence
from mlci.areas.next_task import choose_tasks, expected_overlaps
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.spaces import Box, StateSpace
from mlci.task_outcomes import under_truths

RASTER = Grid(StateSpace(Box([0.0], [6.0]), [False], ("place",)), (6,))
ONE = (0.5, 0.5, 0.0)  # of nothing, one shape, two


def world() -> ShapeEvidence:
    """Three shapes; the first task tells the first from the others, the second tells nothing."""
    inside = np.zeros((6, 3), dtype=bool)
    inside[:3, 0] = inside[1:4, 1] = inside[4:, 2] = True
    telling = np.zeros((40, 3), dtype=bool)
    telling[:20, 0] = telling[20:, 1:] = True
    tasks = (telling, np.ones((40, 3), dtype=bool), None)
    return ShapeEvidence(tasks, np.zeros((3, 3), dtype=bool), inside, RASTER, Rates())


def test_a_task_is_worth_the_overlap_after_it() -> None:
    """Shapes 0 and 1 share two points of four; shape 2 meets none."""
    worth = expected_overlaps(world(), np.array([], int), np.random.default_rng(0), ONE, 40_000)
    # Without a demonstration: shape 0 overlaps itself, and shape 1 by a half: (1 + 1/2) / 3.
    assert worth[1] == pytest.approx(0.5, abs=0.01)
    # With one it is shape 0, a third of the time; or one of the others, that share nothing.
    assert worth[0] == pytest.approx(1 / 3 + 2 / 3 * 0.5, abs=0.01)
    assert np.isnan(worth[2])


def test_what_is_recorded_tells_nothing_anew() -> None:
    """Once the first demonstration kept out of all, shapes are as probable as it says."""
    evidence = world()
    rng = np.random.default_rng(0)
    violated = evidence.violated.copy()
    violated[0, 1:] = True  # what is left is the first shape
    after = expected_overlaps(replace(evidence, violated=violated), np.array([0]), rng, ONE)
    np.testing.assert_allclose(after, [1, 1, np.nan])
    violated[0, 0] = True
    nothing = expected_overlaps(replace(evidence, violated=violated), np.array([0]), rng, ONE)
    assert np.isnan(nothing).all()


def test_tasks_are_chosen_one_after_the_other_as_long_as_there_are_any() -> None:
    evidence = world()
    assert choose_tasks(evidence, 1, np.random.default_rng(0), ONE).tolist() == [0]
    assert choose_tasks(evidence, 5, np.random.default_rng(0), ONE).tolist() == [0, 1]


def test_truths_that_hardly_any_trajectory_avoids_share_an_outcome() -> None:
    keeps_out = np.zeros((50, 3), dtype=bool)
    keeps_out[:20, 0] = keeps_out[:9, 1] = True
    likelihood = under_truths(keeps_out, np.ones(50, dtype=int), 0.1)
    np.testing.assert_allclose(likelihood.sum(axis=0), 1)
    np.testing.assert_allclose(likelihood[-1], [0, 0.9, 0.9])
    np.testing.assert_allclose(likelihood[:20, 0], 0.9 / 20 + 0.1 / 50)
    np.testing.assert_allclose(likelihood[:20, 1], 0.1 / 50)
