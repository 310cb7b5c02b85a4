"""When the truth counts as found, and which task of a pool is chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from tiny_point import composed

from experiments.config.read import read_config
from experiments.point.inference import infer_point
from experiments.point.next_task_tables import COLUMNS, chosen_order, found_after, next_task_table
from experiments.tracking.store import Store
from mlci.inference import Inference
from mlci.regions import Regions
from mlci.spaces import Box, Floats, StateSpace
from mlci.task_outcomes import task_outcomes

LINE = Regions.from_grid(StateSpace(Box([0.0], [3.0]), [False], ("place",)), (3,))
TRUTH = np.array([False, True, False])


def inference(avoidance: Floats, violated: Floats | None = None) -> Inference:
    """Of demonstrations about three regions on a line."""
    alpha = np.array(avoidance, dtype=float)
    crossed = np.zeros(alpha.shape, bool) if violated is None else np.array(violated, dtype=bool)
    names = tuple(map(str, range(len(alpha))))
    return Inference(LINE, names, alpha, crossed, np.ones(len(alpha), bool))


def test_the_truth_is_found_when_it_leads_for_good_and_when_it_is_nearly_certain() -> None:
    """It leads after 2, falls behind after 3, leads again after 4, and is above .95 after 5."""
    steps = [[0.5, 1, 1], [1, 0.2, 1], [0.2, 1, 1], [1, 0.1, 1], [1, 0.001, 1], [1, 1, 1]]
    assert found_after(inference(steps), TRUTH) == {"sure": 5, "settled": 4}
    assert found_after(inference(steps[:3]), TRUTH)["settled"] is np.nan


def test_who_leads_from_the_first_is_settled_after_one_and_ties_do_not_lead() -> None:
    assert found_after(inference([[1, 0.5, 1], [1, 0.5, 1]]), TRUTH)["settled"] == 1
    tied = found_after(inference([[0.5, 0.5, 1]]), TRUTH)
    assert np.isnan(tied["settled"])
    assert np.isnan(found_after(inference([[1, 0.5, 1]]), np.zeros(3, bool))["settled"])


def test_what_has_been_shown_is_not_chosen_again_for_the_same_end() -> None:
    """Task 0 tells of region 0 alone and task 2 of the others; nothing is learnt from task 1. Once
    a demonstration has violated regions 1 and 2, nothing is left to learn of them."""
    both, nothing = np.array([[0, 1, 1], [0, 0, 0]]), np.zeros((2, 3))
    one = np.array([[1, 0, 0], [0, 0, 0]])
    outcomes = [task_outcomes(np.repeat(each, 50, axis=0) > 0) for each in (one, nothing, both)]
    shown = inference([[0.5, 1, 1], [1, 1, 1], [1, 0.5, 0.5]], [[0, 0, 0], [0, 0, 0], [0, 1, 1]])
    assert chosen_order(outcomes, shown, np.array([1, 0, 2]), 3).tolist() == [2, 0, 1]


def test_a_prior_by_size_counts_for_what_leads_and_for_what_is_chosen() -> None:
    """Regions of 2 m and of 1 m explain alike, and the smaller one is 32 times as probable."""
    space = StateSpace(Box([0.0], [3.0]), [False], ("place",))
    regions = Regions.from_boxes(space, [Box([0.0], [2.0]), Box([2.0], [3.0])])
    small, nothing = np.array([False, True]), np.zeros((2, 2), dtype=bool)
    shown = Inference(regions, ("0", "1"), np.full((2, 2), 0.5), nothing, np.ones(2, bool))
    sized = replace(shown, size_prior=5.0)
    assert np.isnan(found_after(shown, small)["settled"])
    assert found_after(sized, small)["settled"] == 1
    # Half of the trajectories cross the larger region in task 0, and the smaller one in task 1.
    halves = (np.repeat([[True, False], [False, False]], 50, axis=0), [1, 0])
    outcomes = [task_outcomes(halves[0]), task_outcomes(halves[0][:, halves[1]])]
    assert chosen_order(outcomes, shown, np.array([0, 1]), 2)[0] == 0
    assert chosen_order(outcomes, sized, np.array([0, 1]), 2)[0] == 1


def test_a_small_point_has_a_row_a_source_repetition_and_way(tmp_path) -> None:
    words = ["scale=smoke", "truth=c1", "grid=100", "dt=0.5", "actions=5"]
    words += ["demonstrations.dt=0.1", "inference.calibrate=false", "safety.shape=[41,41]"]
    words += ["next_task.repetitions=2", "next_task.pool=5", "next_task.most=3"]
    settings = read_config(composed(*words))[0]
    point = infer_point(settings, Store(tmp_path))
    table = next_task_table(settings, point)
    assert list(table.columns) == COLUMNS
    assert (table["tried"] <= 3).all()
    assert set(table.groupby(["source", "repetition"])["way"].agg(tuple)) == {("chosen", "random")}
    assert next_task_table(settings, point).equals(table)
