"""Which task to record next, against every trajectory of small models."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import entropy as entropy_of
from toy_models import every_trajectory, toy_model, toy_world

import mlci
from mlci.demonstrations import Demonstration, Task
from mlci.evidence import PAPER, Rates
from mlci.forecasts import ForecastCurve, ForecastMap
from mlci.inference import Inference
from mlci.next_task import NextTask, entropy, nearly_the_same, next_tasks, plausible, simulate_tasks
from mlci.regions import Regions
from mlci.spaces import Bools, Box, Floats, StateSpace
from mlci.systems import FunctionSystem
from mlci.tabular import TabularModel

STEPS, REGIONS = 5, 4


def away(model: TabularModel) -> TabularModel:
    """The model with its regions moved to where no task begins or ends."""
    boxes = [Box([0.6], [0.7])] * len(model.regions)
    return replace(model, regions=Regions.from_boxes(model.grid.space, boxes))


def task_to(goal: int) -> Task:
    """From cell 0 into a cell of a toy world."""
    return Task(np.array([0.5]), Box.point([goal + 0.5]), float(STEPS))


def nothing_seen(
    model: TabularModel, rates: Rates = PAPER, hypotheses: Bools | None = None
) -> Inference:
    """The inference from no demonstration, about all regions or some."""
    regions = model.regions if hypotheses is None else model.regions.select(hypotheses)
    none, count = np.zeros((0, len(regions))), 0
    return Inference(regions, (), none, none.astype(bool), np.zeros(count, dtype=bool), rates=rates)


def exact_information(model: TabularModel, goal: int, belief: Floats, rates: Rates) -> float:
    """The mutual information of truth and D, from the distribution of D under each truth.

    Under truth i its trajectories are listed, and those that cross i are left out; a share of
    agents whom the model does not describe crosses nothing, and a share breaks rules. Where none
    is left, the task is refused.
    """
    crossed, weight = every_trajectory(model, goal, STEPS)
    crossed = np.vstack([crossed, np.zeros((1, REGIONS), dtype=bool)])
    eta, eps = rates.model_error, rates.rule_breaking
    free = np.append((1 - eta) * weight, eta)
    number = np.unique(crossed, axis=0, return_inverse=True)[1].ravel()
    bins, tables = int(number.max()) + 2, []  # the last: a task that cannot be done is not done
    for i in range(REGIONS):
        obeying = np.where(crossed[:, i], 0.0, free)
        refused = np.sum(obeying) == 0
        obeying = obeying / (1.0 if refused else np.sum(obeying))
        tables.append(np.bincount(number, (1 - eps) * obeying + eps * free, bins))
        tables[-1][-1] = (1 - eps) * refused
    tables.append(np.bincount(number, free, bins))
    mixture = belief @ np.array(tables)
    return float(entropy_of(mixture) - belief @ entropy_of(tables, axis=1))


@pytest.mark.parametrize("rates", [PAPER, Rates(0.1), Rates(0.1, 0.1)])
def test_information_is_exact_but_for_sampling(rates: Rates) -> None:
    """2000 trajectories a task: within four of the standard errors that are stated."""
    model = away(toy_world())
    goals = [goal for goal in range(6) if goal in model.kept.successor]
    inference = nothing_seen(model, rates)
    belief = np.append(inference.posterior, inference.posterior_none)
    simulated = simulate_tasks(
        model, inference, [task_to(goal) for goal in goals], samples=2000, exact_ends=False
    )
    some = 0
    for goal, outcomes in zip(goals, simulated, strict=True):
        exact = exact_information(model, goal, belief, rates)
        error = outcomes.error(belief)
        assert error < 0.1 * max(exact, 0.05)
        assert outcomes.information(belief) == pytest.approx(exact, abs=4 * error + 1e-9)
        some += exact > 0.01
    assert some > 2


def test_the_first_task_is_the_most_informative_by_enumeration() -> None:
    model = away(toy_world())
    inference = nothing_seen(model)
    belief = np.append(inference.posterior, inference.posterior_none)
    exact = [exact_information(model, goal, belief, PAPER) for goal in (1, 2, 3)]
    best, second = np.argsort(exact)[::-1][:2]
    assert exact[best] > 1.1 * exact[second]  # sampling cannot turn them round
    first = next_tasks(
        model, inference, [task_to(goal) for goal in (1, 2, 3)], samples=2000, exact_ends=False
    )[0]
    assert first.number == best
    assert first.information == pytest.approx(exact[best], abs=4 * first.error)
    assert first.information <= entropy(belief)


def information_about_one(alpha: float, prior_none: float) -> float:
    """Of one region, whose demonstrators avoid it, if it is forbidden, and with alpha if not."""
    avoids = 1 - prior_none + prior_none * alpha
    told = entropy_of([avoids, 1 - avoids])
    return float(told - prior_none * entropy_of([alpha, 1 - alpha]))


def swing_world() -> tuple[TabularModel, Task, Bools]:
    """A coarse pendulum, a task that its time step does not divide, and one region to ask of."""
    system = mlci.Pendulum()
    regions = mlci.Regions.from_grid(system.space, (5, 5))
    grid, actions = mlci.Grid(system.space, (9, 9)), mlci.action_grid(system, 5)
    model = mlci.discretize(system, grid, actions, 0.5, regions)
    task = Task(np.array([0.65, 0.0]), Box([2.8, -0.3], [3.2, 0.3]), 3.2)
    return model, task, np.arange(25) == 7


@pytest.mark.parametrize("exact_ends", [False, True])
@pytest.mark.parametrize("calibrated", [False, True])
def test_alpha_is_that_of_the_inference_by_the_same_options(
    exact_ends: bool, calibrated: bool
) -> None:
    """Ends, a rounded horizon, the hypotheses and a calibration, by closed form."""
    model, task, mask = swing_world()
    level = ForecastMap((ForecastCurve((1e-6, 1.0), 9, 99, 0.0, 0.0, 0.0, ceiling=0.6),))
    options = {"exact_ends": exact_ends, "round_horizon": True, "hypotheses": mask}
    path = Demonstration.from_path([task.start, [3.0, 0.0]], task.horizon)
    of_path = mlci.infer(model, [replace(path, task=task)], rates=PAPER, **options)
    alpha = of_path.avoidance[0, 0]
    inference = nothing_seen(model, hypotheses=mask)
    if calibrated:  # 0.7 whatever alpha is
        inference, alpha = replace(inference, calibration=level), 1 - 0.6 / 2
    first = next_tasks(model, inference, [task], samples=4000, **options)[0]
    expected = information_about_one(alpha, inference.posterior_none)
    assert first.information == pytest.approx(expected, abs=4 * first.error)
    assert first.error < 0.1 * expected
    with pytest.raises(ValueError, match="horizon"):
        next_tasks(model, inference, [task], hypotheses=mask)


def test_what_one_task_reveals_is_not_expected_of_the_next() -> None:
    """All trajectories of both tasks cross the one region: a demonstration tells everything."""
    successor, every = np.array([[1], [2], [3], [0]]), np.ones((4, 1), dtype=bool)
    model = away(toy_model(successor, np.zeros((4, 1)), every, every))
    tasks = [Task(np.array([at]), Box.point([at + 1]), 1.0) for at in (0.5, 2.5)]
    first, second = next_tasks(model, nothing_seen(model), tasks, exact_ends=False)
    assert first.information == pytest.approx(np.log(2))
    assert second.information == pytest.approx(0, abs=1e-12)
    assert first.chance == second.chance == pytest.approx(1)  # of each alone


def test_each_task_has_trajectories_of_its_own_by_the_seed() -> None:
    """The same task again is drawn anew, and a task more changes none before it."""
    model = away(toy_world())
    task, inference = task_to(2), nothing_seen(model)

    done: list[tuple[int, int]] = []

    def drawn(count: int, seed: int) -> list[Floats]:
        options = {"samples": 300, "seed": seed, "exact_ends": False}
        simulated = simulate_tasks(
            model, inference, [task] * count, progress=lambda *some: done.append(some), **options
        )
        return [outcomes.likelihood for outcomes in simulated]

    first, again = drawn(2, seed=0)
    assert done == [(1, 2), (2, 2)]
    assert not np.array_equal(first, again)
    assert not np.array_equal(first, drawn(1, seed=1)[0])
    assert np.array_equal(first, drawn(1, seed=0)[0])


def test_a_batch_repeats_no_task_and_adds_less_with_each() -> None:
    system = mlci.Pendulum()
    hypotheses = mlci.Regions.from_grid(system.space, (5, 5))
    model = mlci.discretize(
        system, mlci.Grid(system.space, (15, 15)), mlci.action_grid(system, 5), 0.5, hypotheses
    )
    rng = np.random.default_rng(0)
    ends = rng.uniform([0, -2], [2 * np.pi, 2], (12, 2, 2))
    tasks = [Task(start, Box.point(goal), 4.0) for start, goal in ends]
    inference = nothing_seen(model, Rates(0.1))
    alone = next_tasks(model, inference, tasks, count=1)[0]
    twice = [*tasks, Task(alone.task.start + 0.01, alone.task.goal, 4.0)]
    batch = next_tasks(model, inference, twice, count=3)
    assert batch[0].information >= batch[1].information >= batch[2].information > 0
    numbers = [each.number for each in batch]
    assert (
        len({number % len(tasks) if number == alone.number else number for number in numbers}) == 3
    )
    assert not {alone.number, len(tasks)} <= set(numbers)
    again = next_tasks(model, inference, twice, count=3)
    assert [each.number for each in again] == numbers


def test_tasks_that_the_model_cannot_do_are_passed_over() -> None:
    model = away(
        toy_model(
            np.array([[1], [0]]), np.zeros((2, 1)), np.ones((2, 1), bool), np.ones((2, 1), bool)
        )
    )
    inference = nothing_seen(model)
    odd = Task(np.array([0.5]), Box.point([0.5]), 3.0)  # after three moves it is in the other cell
    assert next_tasks(model, inference, [odd], exact_ends=False) == []
    even = Task(np.array([0.5]), Box.point([0.5]), 2.0)
    chosen = next_tasks(model, inference, [odd, even], names=["odd", "even"], exact_ends=False)
    assert [each.name for each in chosen] == ["even"]
    with pytest.raises(ValueError, match="at least one trajectory"):
        next_tasks(model, inference, [even], samples=0)
    with pytest.raises(ValueError, match="counted from 0 up, not -1"):
        next_tasks(model, inference, [even], count=-1, exact_ends=False)
    assert next_tasks(model, inference, [even], count=0, exact_ends=False) == []


def test_what_is_left_out_as_implausible_holds_a_thousandth() -> None:
    belief = np.array([0.6, 0.0004, 0.0005, 0.0002, 0.3989])
    kept = plausible(belief)
    assert kept.sum() == pytest.approx(1)
    assert np.array_equal(kept > 0, [True, False, True, False, True])


def test_tasks_are_nearly_the_same_the_short_way_round() -> None:
    space = StateSpace(Box([0.0, -1.0], [10.0, 1.0]), [True, False], ("angle", "speed"))

    def task(start: list[float], goal: list[float]) -> Task:
        return Task(np.array(start), Box.point(goal), 1.0)

    one = task([0.1, 0.0], [5.0, 0.0])
    assert nearly_the_same(space, one, task([9.9, 0.1], [5.5, 0.1]))
    assert not nearly_the_same(space, one, task([8.9, 0.1], [5.5, 0.1]))
    assert not nearly_the_same(space, one, task([0.1, 0.0], [5.0, 0.3]))
    narrow, wide = (Task(one.start, Box(one.goal.lower, [upper, 0.0]), 1.0) for upper in (5.5, 7.0))
    assert nearly_the_same(space, one, narrow)
    assert not nearly_the_same(space, one, wide)
    free = Task(np.array([0.1, 0.0]), Box([5.0, -np.inf], [5.0, np.inf]), 1.0)
    assert nearly_the_same(space, free, free)
    assert not nearly_the_same(space, one, free)


def test_nobody_is_asked_to_begin_or_end_in_what_may_be_forbidden() -> None:
    """All trajectories cross the region; if it holds an end, that a demonstration does says
    nothing, and else everything."""
    crossing = toy_model(
        np.array([[1], [0]]), np.zeros((2, 1)), np.ones((2, 1), bool), np.ones((2, 1), bool)
    )
    task = Task(np.array([0.5]), Box.point([0.5]), 2.0)
    for model, information in ((away(crossing), np.log(2)), (crossing, 0.0)):
        chosen = next_tasks(model, nothing_seen(model), [task], exact_ends=False)
        assert chosen[0].information == pytest.approx(information)


def test_what_only_a_cell_decides_is_not_expected_to_tell() -> None:
    """A pillar holds the centre of the first cell, but not the start: trajectories differ."""
    floor = StateSpace(Box([0.0, 0.0], [4.0, 3.0]), [False, False], ("x", "y"))
    walker = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), floor, Box([-1, -1], [1, 1]))
    pillar = Regions.from_boxes(floor, [Box([0.4, 1.4], [1.3, 1.6])])
    cells, actions = mlci.Grid(floor, (4, 3)), mlci.action_grid(walker, 3)
    model = mlci.discretize(walker, cells, actions, 1.0, pillar)
    task = Task(np.array([0.9, 1.1]), Box.point([3.5, 1.5]), 3.0)
    assert 0.1 < mlci.prepare(model, [task]).avoidance[0, 0] < 0.9
    assert next_tasks(model, nothing_seen(model), [task])[0].information == 0


def test_a_task_as_a_record_for_programs() -> None:
    space = StateSpace(Box([0.0, -1.0], [10.0, 1.0]), [True, False], ("angle", "speed"))
    task = Task(np.array([0.1, 0.0]), Box([5.0, -np.inf], [5.5, np.inf]), 2.0)
    record = json.loads(json.dumps(NextTask(task, 3, "reach", 0.2, 0.01, 0.4).record(space)))
    assert record == {
        "name": "reach",
        "start": {"angle": 0.1, "speed": 0.0},
        "goal": {"lower": {"angle": 5.0, "speed": None}, "upper": {"angle": 5.5, "speed": None}},
        "horizon": 2.0,
        "information": 0.2,
        "error": 0.01,
        "chance": 0.4,
    }
