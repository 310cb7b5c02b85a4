"""`infer`, at once or with tasks that were prepared, against (4)-(6) put together by hand."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from mlci.crossings import Crossing, crossed
from mlci.demonstrations import REACHED, Demonstration, Task, departures, even_times
from mlci.evidence import DEFAULT_MODEL_ERROR, PAPER, Ranking, Rates, log_evidence, rank_constraints
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.preparation import PreparedInference, infer, prepare
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum
from mlci.tabular import TabularModel, action_grid, discretize

SYSTEM = DoubleIntegrator()
GRID = Grid(SYSTEM.space, (12, 10))
HYPOTHESES = Regions.from_grid(SYSTEM.space, (10, 10))
# The last goal is further than the bounds allow to go in the time.
TASKS = [
    Task(np.array(start), Box.point(end), horizon)
    for start, end, horizon in (
        ([-1.0, 0.0], [1.0, 0.0], 5.0),
        ([2.0, 0.5], [-1.0, 0.0], 5.0),
        ([0.0, -1.0], [1.5, 0.5], 4.0),
        ([-2.9, 0.0], [2.9, 0.0], 1.0),
    )
]


# Trajectories from cell to cell, and probabilities as the tabular model has them.
papers = partial(infer, rates=PAPER, exact_ends=False)


@pytest.fixture(scope="module")
def model() -> TabularModel:
    return discretize(SYSTEM, GRID, action_grid(SYSTEM, 5), 0.5, HYPOTHESES)


@pytest.fixture(scope="module")
def prepared(model: TabularModel) -> PreparedInference:
    return prepare(model, TASKS, exact_ends=False)


def demonstration(task: int, seed: int) -> Demonstration:
    """A path of a task, with random controls, bent so that it ends at the goal."""
    rng = np.random.default_rng([task, seed])
    count = round(TASKS[task].horizon / 0.01)
    path = rollout(SYSTEM, TASKS[task].start, rng.uniform(-0.6, 0.6, (count, 1)), 0.01)
    path += np.linspace(0, 1, count + 1)[:, None] * (TASKS[task].goal.lower - path[-1])
    return Demonstration(
        TASKS[task], path, None, even_times(len(path), 0.01), f"path {task}.{seed}"
    )


def assert_same(one: Ranking, other: Ranking) -> None:
    for name in ("gain", "feasible", "rank", "order", "posterior", "posterior_none"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def by_hand(model: TabularModel, demonstrations: list[Demonstration], prior_none: float) -> Ranking:
    avoidance = np.ones((len(demonstrations), len(HYPOTHESES)))
    for row, each in zip(avoidance, demonstrations, strict=True):
        distribution = TrajectoryDistribution.of_task(model, each.task)
        if distribution.is_possible:
            row[:] = distribution.avoidance_probabilities()
    violated = [HYPOTHESES.violated_by(each.states) for each in demonstrations]
    return rank_constraints(avoidance, violated, prior_none)


def test_infer_is_the_ranking_of_each_task_alone(model: TabularModel) -> None:
    """A task done twice, one never, one whose goal cannot be reached; paths of several lengths."""
    demonstrations = [demonstration(task, seed) for seed, task in enumerate([2, 0, 2, 3])]
    inference = papers(model, demonstrations, prior_none=0.3)
    assert inference.reachable.tolist() == [True, True, True, False]
    assert not inference.phi[3].any()
    assert inference.names == ("path 2.0", "path 0.1", "path 2.2", "path 3.3")
    expected = by_hand(model, demonstrations, 0.3)
    assert 10 < np.sum(expected.feasible) < 100
    assert np.ptp(expected.gain[expected.feasible]) > 0.1
    assert_same(inference.ranking, expected)


def test_prepared_tasks_give_the_same(model: TabularModel, prepared: PreparedInference) -> None:
    demonstrations = [demonstration(task, seed) for seed, task in enumerate([2, 0, 2, 3])]
    paths = [each.states for each in demonstrations]
    ready = prepared.infer(paths, 0.01, [2, 0, 2, 3], prior_none=0.3, rates=PAPER)
    assert_same(ready.ranking, papers(model, demonstrations, prior_none=0.3).ranking)
    assert ready.names == ("0", "1", "2", "3")
    once = [demonstration(task, 0).states for task in range(4)]
    assert_same(
        prepared.infer(once, 0.01).ranking, prepared.infer(once, [0.01] * 4, [0, 1, 2, 3]).ranking
    )


def test_any_number_of_jobs_gives_the_same_bits(model: TabularModel) -> None:
    fresh, calls = replace(model), []
    in_parallel = prepare(fresh, TASKS, n_jobs=2, progress=lambda *count: calls.append(count))
    alone = prepare(replace(model), TASKS)
    np.testing.assert_array_equal(in_parallel.avoidance, alone.avoidance)
    np.testing.assert_array_equal(in_parallel.reachable, alone.reachable)
    assert calls == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_only_the_hypotheses_of_a_mask_are_ranked() -> None:
    """A truth among the model's regions is no hypothesis, wherever it stands."""
    truth = Regions.from_boxes(SYSTEM.space, [Box([0.0, 0.0], [0.5, 0.5])], ["truth"])
    regions = truth.joined(HYPOTHESES)
    model = discretize(SYSTEM, GRID, action_grid(SYSTEM, 5), 0.5, regions)
    demonstrations = [demonstration(task, 0) for task in (0, 2)]
    inference = infer(model, demonstrations, hypotheses=regions.mask(HYPOTHESES.names))
    assert inference.hypotheses.names == HYPOTHESES.names
    plain = discretize(SYSTEM, GRID, action_grid(SYSTEM, 5), 0.5, HYPOTHESES)
    np.testing.assert_allclose(inference.phi, infer(plain, demonstrations).phi, atol=1e-14)


def test_some_of_the_demonstrations(model: TabularModel) -> None:
    demonstrations = [demonstration(task, seed) for seed, task in enumerate([2, 0, 3, 2])]
    inference = papers(model, demonstrations, prior_none=0.2)
    for part, numbers in ((slice(2), [0, 1]), ([3, 1], [3, 1])):
        chosen = [demonstrations[number] for number in numbers]
        assert_same(inference.of(part).ranking, by_hand(model, chosen, 0.2))
        assert inference.of(part).names == tuple(each.name for each in chosen)


def hand_made() -> Inference:
    """Three hypotheses, one of them refuted, one that an agent cannot avoid in a task."""
    boxes = [Box([-1.0, -np.inf], [0.0, np.inf]), Box([0.0, -np.inf], [1.0, np.inf])]
    boxes.append(Box([1.0, -np.inf], [2.0, np.inf]))
    return Inference(
        Regions.from_boxes(SYSTEM.space, boxes, ["left", "middle", "right"]),
        ("first", "second"),
        np.array([[0.5, 0.25, 0.0], [1.0, 1.0, 1.0]]),
        np.array([[True, False, False], [False, False, False]]),
        np.array([True, False]),
    )


def test_the_frame_has_a_row_a_hypothesis_with_names_and_units() -> None:
    frame = hand_made().to_frame()
    assert list(frame) == [
        "hypothesis", "position from [m]", "position to [m]", "outcome", "rank", "gain",
        "posterior", "violated_by",
    ]  # fmt: skip
    assert frame["hypothesis"].tolist() == ["right", "middle", "left"]
    assert frame["position from [m]"].tolist() == [1.0, 0.0, -1.0]
    assert frame["position to [m]"].tolist() == [2.0, 1.0, 0.0]
    assert frame["outcome"].tolist() == ["unavoidable", "feasible", "violated"]
    np.testing.assert_array_equal(frame["gain"], [np.nan, -np.log(0.25), -np.inf])
    assert frame["violated_by"].tolist() == [0, 0, 1]
    assert frame["rank"].tolist() == [1, 2, 3]


def test_repr_and_summary_say_what_was_inferred_and_what_is_doubtful() -> None:
    text = repr(hand_made())
    assert text.startswith("2 demonstrations, 3 hypotheses; probability of no constraint 0\n")
    assert "cannot reach the goal of second" in text
    assert "unavoidable: right; the tabular agent cannot but enter" in text
    many = Inference(
        HYPOTHESES, ("a",), np.ones((1, 100)), np.zeros((1, 100), bool), np.ones(1, bool)
    )
    assert repr(many).startswith("1 demonstration, ")
    assert many.warnings == []
    assert [len(words.splitlines()) for words in (repr(many), many.summary())] == [8, 13]


def test_wrong_input_is_refused(model: TabularModel, prepared: PreparedInference) -> None:
    path = demonstration(0, 0).states
    with pytest.raises(ValueError, match=r"2 paths need as many tasks and names, not \[1\]"):
        prepared.infer([path, path], 0.01, [1])
    with pytest.raises(ValueError, match=r"1 paths need as many tasks .* not \[0, 1, 2, 3\]"):
        prepared.infer([path], 0.01)
    with pytest.raises(ValueError, match=r"1 paths need .* and \['a', 'b'\]"):
        prepared.infer([path], 0.01, [0], names=["a", "b"])
    for wrong in (4, -1):
        with pytest.raises(ValueError, match=rf"numbered 0 to 3, not \[{wrong}\]"):
            prepared.infer([path], 0.01, [wrong])
    fewer = Regions.from_grid(SYSTEM.space, (5, 5))
    with pytest.raises(
        ValueError, match=r"avoidance \(4, 100\).* do not fit 4 tasks and 25 hypotheses"
    ):
        replace(prepared, hypotheses=fewer)
    with pytest.raises(ValueError, match="mask over 100 regions"):
        infer(model, [demonstration(0, 0)], hypotheses=[True])
    inference = infer(model, [demonstration(0, 0)])
    for field, value in {
        "names": ("a", "b"),
        "avoidance": np.zeros((2, 100)),
        "violated": np.zeros((1, 99), bool),
        "reachable": np.ones(2, bool),
        "hypotheses": fewer,
    }.items():
        with pytest.raises(ValueError, match="do not fit avoidance"):
            replace(inference, **{field: value})


def test_a_path_of_another_task_is_refused_with_all_that_differs(
    prepared: PreparedInference,
) -> None:
    path = demonstration(0, 0).states
    with pytest.raises(ValueError, match="path 'bad' does not do task 1") as refusal:
        prepared.infer([path, path[:-10] + 0.1], 0.01, [0, 1], names=["good", "bad"])
    for part in (
        "it starts at (-0.9, 0.1), 2.93 from the task's start (2, 0.5)",
        "from the task's goal (-1, 0)",
        "it lasts 4.9 s, the task 5 s",
    ):
        assert part in str(refusal.value)
    with pytest.raises(ValueError, match=r"'0' .* it lasts 10 s, the task 5 s$"):
        prepared.infer([path], 0.02, [0])
    for wrong in (path[0], path[:1], path[:, :1]):
        with pytest.raises(ValueError, match=r"path '0' needs states of shape \(K\+1, 2\)"):
            prepared.infer([wrong], 0.01, [0])
    with pytest.raises(ValueError, match="path '0' has states that are not finite"):
        prepared.infer([np.where(np.arange(len(path))[:, None] == 7, np.nan, path)], 0.01, [0])


def test_a_path_ends_in_its_goal_the_short_way_round_and_within_the_tolerance() -> None:
    """A goal on the seam of an angle, reached after a turn; the other dimension is free."""
    space = Pendulum().space
    task = Task(np.array([6.0, 0.0]), Box([-0.1, -np.inf], [0.1, np.inf]), 1.0)
    path = np.linspace([6.0, 0.0], [2 * np.pi + 0.1 + REACHED, 3.0], 11)
    assert departures(task, path, 1.0, space, REACHED + 1e-9) == []
    assert departures(task, space.wrap(path), 1.0, space, REACHED + 1e-9) == []
    (phrase,) = departures(task, path, 1.0, space, REACHED - 1e-9)
    assert phrase == "it ends at (6.433, 3), 0.05 from the task's goal (-0.1, -inf) to (0.1, inf)"
    assert departures(task, path, 1.0009, space, 0.06) == []
    assert departures(task, path, 1.0011, space, 0.06) == ["it lasts 1.0011 s, the task 1 s"]


def test_a_demonstration_that_ends_elsewhere_is_refused(model: TabularModel) -> None:
    path = demonstration(0, 0).states
    times = even_times(len(path), 0.01)
    stray = Demonstration(TASKS[0], path + np.linspace(0, 0.2, len(path))[:, None], None, times)
    with pytest.raises(ValueError, match=r"'0' does not do task 0: it ends at \(1.2, 0.2\), 0.283"):
        infer(model, [stray])
    assert len(infer(model, [stray], tolerance=0.3).names) == 1


def test_no_demonstration_leaves_the_prior(model: TabularModel) -> None:
    inference = infer(model, [], prior_none=0.3)
    assert inference.posterior_none == pytest.approx(0.3)
    np.testing.assert_allclose(inference.posterior, 0.7 / 100)


def test_exact_ends_and_rates_reach_the_evidence(model: TabularModel) -> None:
    demonstrations = [demonstration(task, 0) for task in (0, 2)]
    exact = infer(model, demonstrations, exact_ends=True, rates=Rates(0.1, 0.05))
    for row, each in zip(exact.avoidance, demonstrations, strict=True):
        distribution = TrajectoryDistribution.of_task(model, each.task, exact_ends=True)
        np.testing.assert_array_equal(row, distribution.avoidance_probabilities())
    evidence = log_evidence(exact.avoidance, exact.violated, Rates(0.1, 0.05))
    np.testing.assert_array_equal(exact.evidence, evidence)
    np.testing.assert_allclose(exact.gain, evidence.sum(axis=0), rtol=1e-12)
    assert not np.array_equal(exact.avoidance, papers(model, demonstrations).avoidance)
    assert exact.of([1]).rates == Rates(0.1, 0.05)
    default = infer(model, demonstrations)
    np.testing.assert_array_equal(default.avoidance, exact.avoidance)
    assert default.rates == Rates(model_error=DEFAULT_MODEL_ERROR)
    assert 0 < np.max(default.evidence) <= -np.log(DEFAULT_MODEL_ERROR)


def test_outcomes_are_named() -> None:
    of = hand_made()
    assert of.outcomes.tolist() == ["violated", "feasible", "unavoidable"]
    doubted = replace(of, rates=Rates(0.1))
    assert doubted.outcomes.tolist() == ["violated", "feasible", "feasible"]
    assert doubted.gain[2] == pytest.approx(-np.log(0.1))
    assert of.of([1]).outcomes.tolist() == ["unreachable"] * 3


def test_with_model_error_no_set_of_demonstrations_has_an_infinite_gain() -> None:
    """Whatever is avoided or violated, however unlikely, and however often."""
    rng = np.random.default_rng(8)
    for _ in range(200):
        count = int(rng.integers(1, 40))
        alpha = rng.choice([0.0, 1e-300, 1e-20, 0.5, 1.0], (count, 3)) * rng.random((count, 3))
        one = replace(
            hand_made(),
            names=tuple(map(str, range(count))),
            avoidance=alpha,
            violated=rng.random((count, 3)) < 0.01,
            reachable=np.ones(count, dtype=bool),
            decided_by_cell=np.zeros((count, 3), dtype=bool),
            rates=Rates(DEFAULT_MODEL_ERROR),
        )
        assert np.all(one.gain <= -count * np.log(DEFAULT_MODEL_ERROR) + 1e-9)
        assert not np.any(one.outcomes == "unavoidable")
        assert not np.any(np.isnan(one.posterior))


# A floor of 4 x 3 tiles on which one steps to a neighbour in 1 s, round a pillar that holds the
# centre of the tile in which the task starts, but not the start.
FLOOR = StateSpace(Box([0.0, 0.0], [4.0, 3.0]), [False, False], ("x", "y"), ("m", "m"))
WALKER = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), FLOOR, Box([-1, -1], [1, 1]))
PILLARS = Regions.from_boxes(
    FLOOR, [Box([0.4, 1.4], [1.3, 1.6]), Box([1.4, 0.0], [1.6, 3.0])], ["pillar", "wall"]
)


def test_what_only_a_cell_makes_certain_is_no_evidence_and_is_named() -> None:
    model = discretize(WALKER, Grid(FLOOR, (4, 3)), action_grid(WALKER, 3), 1.0, PILLARS)
    path = np.linspace([0.9, 1.1], [3.5, 1.5], 301)
    beside = Demonstration.from_path(path, 0.01, name="beside")
    of_cells, inference = papers(model, [beside]), infer(model, [beside], rates=PAPER)
    assert of_cells.gain[0] == np.inf
    assert of_cells.outcomes.tolist() == ["unavoidable", "violated"]
    assert inference.decided_by_cell.tolist() == [[True, False]]
    assert inference.gain[0] == 0
    assert 0.1 < inference.avoidance[0, 0] < 0.9
    assert inference.outcomes[0] == "feasible"
    assert (
        "no evidence, since a start's or goal's cell alone makes it certain to be entered: "
        "pillar (beside)"
    ) in inference.warnings
    np.testing.assert_array_equal(inference.of([0]).gain, inference.gain)
    violating = replace(inference, violated=np.ones((1, 2), dtype=bool))
    assert violating.gain[0] == -np.inf
    assert not any("no evidence" in warning for warning in violating.warnings)


def test_a_crossing_may_be_asked_to_be_deep_and_to_last(model: TabularModel) -> None:
    demonstrations = [demonstration(task, seed) for seed, task in enumerate([2, 0])]
    paths = [each.states for each in demonstrations]
    times = [each.times for each in demonstrations]
    counts = Crossing(depth=0.2, time=0.3)
    inference = infer(model, demonstrations, crossing=counts)
    assert inference.crossing == counts
    np.testing.assert_array_equal(inference.violated, crossed(HYPOTHESES, paths, times, counts))
    touched = infer(model, demonstrations).violated
    assert np.all(inference.violated <= touched)
    assert 0 < inference.violated.sum() < touched.sum()
