"""Cells that are refined for tasks."""

import numpy as np
import pytest

import mlci
from mlci.answers import answer
from mlci.baselines import occupancy
from mlci.cells.box_tree import BoxTree
from mlci.cells.goal_cells import goal_tree
from mlci.cells.importance import importance, neighbours
from mlci.cells.multilinear import MultilinearModel
from mlci.cells.refinement import refine
from mlci.exploration import explore
from mlci.maxent import TrajectoryDistribution
from mlci.temperature import estimate_temperature

PENDULUM = mlci.Pendulum()
HYPOTHESES = mlci.Regions.from_grid(PENDULUM.space, (10, 10))
GRID = mlci.Grid(PENDULUM.space, (10, 10))
TASKS = [
    mlci.Task(np.array([1.0, 0.5]), mlci.Box.point([2.7, -0.4]), 3.0),
    mlci.Task(np.array([3.0, -1.0]), mlci.Box.point([2.1, 1.3]), 3.0),
]


def model(cells: mlci.Grid | BoxTree = GRID, samples: int = 2) -> mlci.TabularModel:
    actions = mlci.action_grid(PENDULUM, 7)
    return mlci.TabularModel(PENDULUM, cells, actions, 0.25, HYPOTHESES, samples=samples)


def phi(of: mlci.TabularModel) -> np.ndarray:
    ways = [TrajectoryDistribution.of_task(of, task, exact_ends=True) for task in TASKS]
    return np.array([way.violation_probabilities() for way in ways])


@pytest.fixture(scope="module")
def refined() -> mlci.TabularModel:
    return refine(model(), TASKS, 250)


def test_refined_cells_are_worth_many_equal_ones(refined: mlci.TabularModel) -> None:
    fine = phi(model(mlci.Grid(PENDULUM.space, (100, 100)), samples=1))
    equal, varying = (
        np.sqrt(np.mean((phi(each) - fine) ** 2))
        for each in (model(mlci.Grid(PENDULUM.space, (20, 20))), refined)
    )
    assert refined.states == 250
    assert varying < 0.9 * equal  # of 400 cells


def test_the_same_cells_each_time_and_goals_in_their_middle(refined: mlci.TabularModel) -> None:
    tree = refine(model(), TASKS, 250).grid
    assert np.array_equal(tree.centers, refined.grid.centers)
    goals = [task.goal.lower for task in TASKS]
    assert tree.centers[tree.index(goals)] == pytest.approx(np.array(goals))
    more = refine(refined, TASKS, 260)  # goes on from a tree
    assert more.states == 260
    assert np.isin(refined.grid.corners[0][:, 0], more.grid.corners[0][:, 0]).all()


def test_moves_of_cells_that_tasks_come_by_are_enough(refined: mlci.TabularModel) -> None:
    short = [mlci.Task(TASKS[0].start, mlci.Box.point([1.4, 0.6]), 0.5)]
    active = explore(refined, short, bounded=False)
    assert active.explored is not None
    assert np.sum(active.explored.cells) < 0.7 * refined.states
    of_all, of_active = (
        TrajectoryDistribution.of_task(each, short[0], exact_ends=True).violation_probabilities()
        for each in (refined, active)
    )
    assert of_active == pytest.approx(of_all, abs=1e-12)


def test_cells_that_cannot_do_a_task_are_refined_too() -> None:
    coarse = model(mlci.Grid(PENDULUM.space, (4, 4)), samples=1)
    task = TrajectoryDistribution.of_task(coarse, TASKS[0], exact_ends=True)
    assert not task.is_possible
    assert refine(coarse, TASKS, 30).states == 30


def test_cells_grow_by_a_share_in_each_round_and_it_is_told() -> None:
    told: list[tuple[int, int]] = []
    refine(model(), TASKS, 150, growth=0.1, progress=lambda *counts: told.append(counts))
    expected = [told[0][0]]
    while expected[-1] < 150:
        expected.append(min(150, expected[-1] + expected[-1] // 10))
    assert told == [(size, 150) for size in expected]


def test_the_cells_that_matter_most_are_halved_where_they_do() -> None:
    """Two rounds by hand, for tasks whose goals are whole cells."""
    corners = PENDULUM.space.bounds.lower + GRID.widths * [[4, 4], [3, 6]]
    tasks = [
        mlci.Task(task.start, mlci.Box(corner, corner + GRID.widths), 3.0)
        for task, corner in zip(TASKS, corners, strict=True)
    ]
    tree = goal_tree(GRID, [task.goal for task in tasks], GRID.widths)
    for more in (10, 11):  # a tenth of 100, and of 110
        ways = [TrajectoryDistribution.of_task(model(tree), it, exact_ends=True) for it in tasks]
        matters = sum(importance(way, tree) for way in ways)
        most, along = np.argsort(np.max(matters, axis=1))[-more:], np.full(tree.size, -1)
        along[most] = matters[most, 1] > matters[most, 0]
        tree = tree.halved(along)
    assert np.array_equal(refine(model(), tasks, 121, growth=0.1).grid.centers, tree.centers)


def test_what_no_task_comes_by_stays_as_it_is() -> None:
    corner = PENDULUM.space.bounds.lower + GRID.widths * (1, 5)
    one_step = mlci.Task(TASKS[0].start, mlci.Box(corner, corner + GRID.widths), 0.25)
    assert refine(model(), [one_step], 250).states == 100


def test_the_cell_of_a_goal_is_as_wide_as_equal_cells_of_that_number() -> None:
    tree = refine(model(), TASKS[:1], 400, growth=1.0).grid
    assert tree.sides[tree.index(TASKS[0].goal.lower)] == pytest.approx(GRID.widths / 2)


def test_the_cells_of_a_goal_that_is_no_point_are_refined_like_others() -> None:
    along = mlci.Box([2.7, -0.4], [2.7, 1.4])
    first = goal_tree(GRID, [along], GRID.widths / 2)
    refined = refine(model(), [mlci.Task(TASKS[0].start, along, 3.0)], 400, growth=1.0).grid
    before, after = (each.sides[each.index(along.lower)].prod() for each in (first, refined))
    assert after < 0.6 * before


def test_options_of_tasks_count_for_their_cells() -> None:
    """A rounded horizon is the round one, and where in its cell one starts is of no account."""

    def cells(shift: float, horizon: float, exact_ends: bool) -> list[list[float]]:
        task = mlci.Task(TASKS[0].start + shift, TASKS[0].goal, horizon)
        options = {"round_horizon": True, "exact_ends": exact_ends}
        return refine(model(), [task], 130, **options).grid.centers.tolist()

    for exact_ends in (True, False):
        assert cells(0.0, 3.05, exact_ends) == cells(0.0, 3.0, exact_ends)
    assert cells(0.05, 3.0, False) == cells(0.0, 3.0, False)
    assert cells(0.05, 3.0, True) != cells(0.0, 3.0, True)


def test_visits_and_levels_are_those_of_the_distribution() -> None:
    one = model(samples=1)
    start, goal = one.grid.index([[1.0, 0.5], [2.1, 1.3]])
    task = TrajectoryDistribution(one, int(start), np.array([goal]), 12)
    visits = task.occupancies()
    assert np.sum(visits, axis=1) == pytest.approx(1.0)
    assert np.sum(visits, axis=0) == pytest.approx(occupancy(task), abs=1e-12)
    levels = {t: alpha.copy() for t, alpha in task.avoidance_levels()}
    assert sorted(levels) == list(range(13))
    assert levels[0][start] == pytest.approx(task.avoidance_probabilities(), abs=1e-12)
    # What is avoided from a later step on is avoided more often than from the start.
    on_average = visits[6] @ np.nan_to_num(levels[6])
    assert np.all(on_average >= levels[0][start] - 1e-12)


def test_neighbours_share_a_face() -> None:
    tree = goal_tree(GRID, [TASKS[0].goal], GRID.widths / 3)
    found = neighbours(tree)
    lower, upper = tree.corners
    for d in range(2):
        below = found[:, d, 0]
        known = np.flatnonzero(below >= 0)
        face = PENDULUM.space.difference(upper[below[known]], lower[known])[:, d]
        assert face == pytest.approx(0.0, abs=1e-12)
    assert np.all(found[:, 0] >= 0)  # the angle goes round
    assert np.array_equal(found[:, 1, 0] == -1, lower[:, 1] == -6)


def test_cells_that_are_not_visited_do_not_matter() -> None:
    tree = goal_tree(GRID, [], GRID.widths)
    task = TrajectoryDistribution.of_task(model(tree), TASKS[0], exact_ends=True)
    matters = importance(task, tree)
    visited = np.sum(task.occupancies()[1:-1], axis=0) > 0
    assert np.all(matters[~visited] == 0)
    assert np.all(matters[visited] > 0)
    assert 0.2 < np.mean(visited) < 0.95


def test_importance_is_visits_times_the_change_to_the_neighbours() -> None:
    """Cell by cell: the change of Z (alpha - alpha_0), beside what is larger of both Z."""
    tree = goal_tree(mlci.Grid(PENDULUM.space, (7, 6)), [TASKS[0].goal], GRID.widths / 2)
    task = TrajectoryDistribution.of_task(model(tree), TASKS[0], exact_ends=True)
    matters, beside = importance(task, tree), neighbours(tree)
    visits, alpha_0 = task.occupancies(), task.avoidance_probabilities()
    levels = {t: alpha - alpha_0 for t, alpha in task.avoidance_levels()}
    for cell, d in np.ndindex(tree.size, 2):
        side = tree.sides[cell, d]
        share = side / PENDULUM.space.bounds.widths[d]
        expected = 100 * np.sum(visits[1:-1, cell]) * share**2
        for t in range(1, task.steps):
            if visits[t, cell] <= 1e-9:
                continue
            squares = []
            for other in beside[cell, d]:
                if other >= 0 and task.log_z[t, other] > -np.inf:
                    rise = np.clip(task.log_z[t, other] - task.log_z[t, cell], -3, 3)
                    most = max(rise, 0.0)
                    there = np.exp(rise - most) * levels[t][other]
                    slope = (there - np.exp(-most) * levels[t][cell]) / (
                        (side + tree.sides[other, d]) / 2
                    )
                    squares.append(np.mean((side * slope) ** 2))
            expected += visits[t, cell] * np.mean(squares or [0.0])
        assert matters[cell, d] == pytest.approx(expected, rel=1e-9)


def test_inference_on_cells_of_each_task() -> None:
    own = mlci.RefinedModel(model(), 150)
    prepared = mlci.prepare(own, TASKS)
    for task, avoidance in zip(TASKS, prepared.avoidance, strict=True):
        alone = refine(model(), [task], 150)
        way = TrajectoryDistribution.of_task(alone, task, exact_ends=True)
        assert avoidance == pytest.approx(way.avoidance_probabilities(), abs=1e-12)
    assert prepared.reachable.all()
    with pytest.raises(ValueError, match="there are 100 cells already"):
        mlci.RefinedModel(model(), 50)
    outside = mlci.Task(np.array([1.0, 9.0]), TASKS[0].goal, 3.0)
    with pytest.raises(ValueError, match="outside the state space"):
        mlci.prepare(own, [outside])


@pytest.mark.parametrize("own", [True, False])
def test_an_answer_is_told_of_refined_cells(refined: mlci.TabularModel, own: bool) -> None:
    """Whether cells cut a hypothesis is not told of cells that differ in size."""
    cells = mlci.RefinedModel(model(), 150) if own else refined

    path = np.linspace(TASKS[0].start, TASKS[0].goal.lower, 31)
    shown = mlci.Demonstration.from_path(path, 0.1)
    inference = mlci.infer(cells, [shown])
    result = answer(cells, [shown], inference)
    assert not result.cut.any()
    assert result.temperature == 1.0
    assert (result.ties is None) == own


def test_what_cannot_be_refined_is_refused() -> None:
    with pytest.raises(ValueError, match="there is none"):
        refine(model(), [], 250)
    with pytest.raises(ValueError, match="there are 100 cells already"):
        refine(model(), TASKS, 50)
    with pytest.raises(ValueError, match=r"lies in \(0, 1\], not 0"):
        refine(model(), TASKS, 250, growth=0)
    shared = MultilinearModel(PENDULUM, GRID, mlci.action_grid(PENDULUM, 3), 0.25, HYPOTHESES)
    with pytest.raises(TypeError, match="not of a MultilinearModel"):
        refine(shared, TASKS, 250)
    with pytest.raises(TypeError, match="not of a MultilinearModel"):
        mlci.RefinedModel(shared, 250)
    for huge in (lambda: refine(model(), TASKS, 10**9), lambda: mlci.RefinedModel(model(), 10**9)):
        with pytest.raises(ValueError, match="1000000000 cells of 28 moves have more than the"):
            huge()
    for cells in (np.nan, np.inf, 250.5):
        with pytest.raises(ValueError, match="a number of cells is whole, not"):
            refine(model(), TASKS, cells)


def test_refined_cells_that_are_all_equal_are_those_of_the_grid() -> None:
    """A goal of whole cells leaves them as they are."""
    corner = PENDULUM.space.bounds.lower + GRID.widths * (4, 5)
    task = mlci.Task(TASKS[0].start, mlci.Box(corner, corner + GRID.widths), 3.0)
    own = mlci.prepare(mlci.RefinedModel(model(), GRID.size), [task])
    assert own.reachable.all()
    assert own.avoidance == pytest.approx(mlci.prepare(model(), [task]).avoidance, abs=1e-12)


def test_refined_cells_under_a_truth_are_those_of_the_constrained_agent() -> None:
    truth = np.zeros(len(HYPOTHESES), dtype=bool)
    truth[36] = True
    own = mlci.RefinedModel(model(), 150)
    free, constrained = (each.distribution(TASKS[0]) for each in (own, own.under(truth)))
    assert 0 < free.avoidance_probabilities()[36] < 1
    assert constrained.avoidance_probabilities()[36] == 1
    tree = refine(model().under(truth), TASKS[:1], 150).grid
    assert np.array_equal(constrained.model.grid.centers, tree.centers)


def test_a_sliver_between_goals_does_not_decide_how_finely_moves_are_followed() -> None:
    middle, half = np.array([2.7, -0.4]), GRID.widths / 2
    goals = [mlci.Box(middle - half + shift, middle + half + shift) for shift in (0.0, 1e-5)]
    tree = goal_tree(GRID, goals, GRID.widths)
    assert np.min(tree.sides) < 1.1e-5
    assert model(tree).substeps <= 2 * model().substeps


def test_what_needs_the_same_cells_for_all_tasks_says_so() -> None:
    own = mlci.RefinedModel(model(), 150)
    path = mlci.Demonstration.from_path(np.linspace(TASKS[0].start, TASKS[0].goal.lower, 31), 0.1)
    inference = mlci.infer(own, [path])
    limits = mlci.ControlRanges.beyond(PENDULUM, [0.5])
    for ask in (
        lambda: mlci.diagnose(own),
        lambda: mlci.soften(own, 0),
        lambda: mlci.estimate_weights(own, [path], inference),
        lambda: estimate_temperature(own, [path], inference),
        lambda: mlci.infer_controls(own, [path], limits),
        lambda: explore(own, TASKS),
    ):
        with pytest.raises(TypeError, match="a RefinedModel has no cells that all tasks share"):
            ask()
    with pytest.raises(TypeError, match="needs a Grid of equal cells, not a BoxTree"):
        mlci.diagnose(refine(model(), TASKS, 150))
