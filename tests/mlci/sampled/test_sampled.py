from dataclasses import replace

import numpy as np
import pytest
from linear_bridge import WIDE, random_bridge

from mlci.demonstrations import Demonstration, Task
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.models import forecast_of
from mlci.next_task import next_tasks
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.sampled.adaptation import spread
from mlci.sampled.diagnosis import SamplingDiagnosis
from mlci.sampled.model import SampledModel
from mlci.simulate import rollout
from mlci.spaces import Box, Floats, StateSpace
from mlci.systems import FunctionSystem, Pendulum, TelescopingPendulum
from mlci.tabular import action_grid, discretize

PENDULUM = Pendulum()
CELLS = Regions.from_grid(PENDULUM.space, (10, 10))
MODEL = SampledModel(PENDULUM, CELLS, 0.25, samples=800, restarts=3)
TASK = Task(np.array([0.5, 0.0]), Box([2.9, -0.2], [3.1, 0.2]), 3.0)


def linear_scores(tasks: int, seed: int, exact_samples: int) -> tuple[Floats, Floats, Floats]:
    """Errors of log Z (N,) and alpha (N, 10), in standard errors, and alpha."""
    rng, log_z, scores, alphas = np.random.default_rng(seed), [], [], []
    for number in range(tasks):
        bridge = random_bridge(rng)
        passage = bridge.passage
        lower = rng.uniform(-3, 2, (10, 2))
        regions = Regions(WIDE.space, lower, lower + rng.uniform(0.2, 2, (10, 2)))
        model = SampledModel(
            WIDE, regions, passage.dt, passage.temperature, samples=1500, seed=number
        )
        horizon = passage.steps * passage.dt
        sampled = model.distribution(Task(passage.start, passage.goal, horizon))
        log_z.append((sampled.log_z - bridge.log_z) / sampled.log_z_error)
        paths = bridge.paths(exact_samples, rng)
        alpha = np.mean(~regions.violated_by(paths), axis=0)
        error = np.sqrt(alpha * (1 - alpha) / len(paths) + 1 / len(paths) ** 2)
        error = np.hypot(error, sampled.avoidance_errors())
        scores.append((sampled.avoidance_probabilities() - alpha) / error)
        alphas.append(alpha)
    return np.array(log_z), np.array(scores), np.array(alphas)


def test_linear_passages_have_the_closed_forms_log_z_and_the_bridges_probabilities():
    log_z, scores, _ = linear_scores(tasks=6, seed=0, exact_samples=4000)
    assert np.all(np.abs(log_z) < 3.2)  # by chance, one such test in a hundred fails
    assert np.mean(np.abs(scores) < 3) >= 0.99


@pytest.mark.long
def test_errors_of_many_linear_passages_are_as_large_as_said():
    # As many tasks as tell a coverage of 0.95 from one of 0.98 by some 200 pairs.
    log_z, scores, alpha = linear_scores(tasks=80, seed=1, exact_samples=20_000)
    between = (alpha > 0.02) & (alpha < 0.98)
    assert np.mean(np.abs(log_z) < 3) >= 0.99
    assert np.mean(np.abs(scores) < 3) >= 0.99
    assert 0.90 <= np.mean(np.abs(log_z) < 1.96) <= 1.0
    assert 0.90 <= np.mean(np.abs(scores[between]) < 1.96) <= 0.98
    assert 0.85 < np.std(scores[between]) < 1.15


def pendulum_gaps(
    cells: int, tasks: int, samples: int, torque: float = 6.0
) -> tuple[Floats, Floats, Floats]:
    """Sampled less tabular: Phi (N, 100) and log Z (N,), and the standard errors of Phi."""
    rng, gaps, apart = np.random.default_rng(7), [], 2 * torque / 24
    grid = Grid(PENDULUM.space, (cells, cells))
    actions = action_grid(PENDULUM, 25, Box([-torque], [torque]))
    coarse = Grid(PENDULUM.space, (60, 60))
    wide = Box([-torque - apart / 2], [torque + apart / 2])  # what the actions stand for
    tabular = discretize(PENDULUM, grid, actions, 0.25, CELLS)
    model = SampledModel(PENDULUM, CELLS, 0.25, samples=samples, limit=wide)
    for _ in range(tasks):
        start, goal = rng.uniform([0.0, -2.0], [2 * np.pi, 2.0], (2, 2))
        lower, upper = (corners[coarse.index(goal)] for corners in coarse.corners)
        task = Task(start, Box(lower + 1e-9, upper - 1e-9), 5.0)
        exact = TrajectoryDistribution.of_task(tabular, task, exact_ends=True)
        sampled = model.distribution(task)
        assert sampled.diagnosis.trusted
        phi = sampled.violation_probabilities() - exact.violation_probabilities()
        log_z = sampled.log_z - (exact.log_z[0, exact.start] + 20 * np.log(apart))
        gaps.append((phi, log_z, sampled.avoidance_errors()))
    phi, log_z, errors = (np.array(part) for part in zip(*gaps, strict=True))
    return phi, log_z, errors


@pytest.mark.parametrize("torque", [6.0, 2.0])
def test_a_pendulum_is_as_on_a_grid(torque):
    # 60 x 60 cells are off by 0.004 in the mean and 0.1 at most, as finer ones tell.
    phi, log_z, _ = pendulum_gaps(cells=60, tasks=1, samples=2000, torque=torque)
    assert np.mean(np.abs(phi)) < 0.01
    assert np.max(np.abs(phi)) < 0.15
    assert np.max(np.abs(log_z)) < 0.3


@pytest.mark.long
def test_a_pendulum_comes_nearer_to_the_grid_the_finer_it_is():
    coarse, fine = (pendulum_gaps(cells, tasks=4, samples=6000)[0] for cells in (60, 120))
    assert np.mean(np.abs(fine)) < 0.005
    assert np.max(np.abs(fine)) < 0.05
    assert np.mean(np.abs(fine)) < np.mean(np.abs(coarse))


def test_the_same_task_gives_the_same_samples_and_another_seed_others():
    first, again = (MODEL.distribution(TASK) for _ in range(2))
    other = replace(MODEL, seed=1).distribution(TASK)
    np.testing.assert_array_equal(first.paths, again.paths)
    np.testing.assert_array_equal(first.avoidance_replicates(3), again.avoidance_replicates(3))
    assert other.log_z != first.log_z
    assert abs(other.log_z - first.log_z) < 4 * np.hypot(other.log_z_error, first.log_z_error)


def test_replicates_and_samples_are_of_the_same_distribution():
    distribution = MODEL.distribution(TASK)
    alpha, errors = distribution.avoidance_probabilities(), distribution.avoidance_errors()
    replicates = distribution.avoidance_replicates(2000)
    between = (alpha > 0.1) & (alpha < 0.9)
    np.testing.assert_allclose(np.std(replicates, axis=0)[between], errors[between], rtol=0.1)
    # Every path crosses one of two halves of the angles, so that these err in opposite directions.
    paths = distribution.sample(4000, np.random.default_rng(0))
    again = np.mean(~CELLS.violated_by(paths), axis=0)
    assert np.max(np.abs(again - alpha)) < 0.04
    assert np.all(PENDULUM.space.contains(paths))
    assert np.all(distribution.passage.excess(paths[:, -1]) <= 1)


@pytest.mark.long
def test_phi_converges_as_the_hold_gets_shorter():
    holds = [1.0, 0.5, 0.25, 0.125]
    *coarse, finest = (
        replace(MODEL, dt=dt, samples=4000, restarts=6, substeps=round(dt / 0.03125)).distribution(
            Task(np.array([4.0, 1.0]), Box([1.0, -0.2], [1.2, 0.2]), 5.0)
        )
        for dt in [*holds, 0.03125]
    )
    phi, error = finest.violation_probabilities(), finest.avoidance_errors()
    gaps = []
    for each in coarse:
        apart = np.square(each.violation_probabilities() - phi)
        noise = np.square(each.avoidance_errors()) + np.square(error)
        gaps.append(np.sqrt(np.mean(apart - noise)))
    slope = np.polyfit(np.log(holds), np.log(gaps), 1)[0]
    assert 0.4 < slope < 1.2
    assert np.all(np.diff(gaps) < 0)
    assert gaps[-1] < 0.03


def test_a_goal_out_of_reach_is_impossible():
    model = replace(MODEL, limit=Box([-0.01], [0.01]))
    distribution = model.distribution(Task(np.array([0.0, 0.0]), Box.point([3.0, 0.0]), 0.5))
    assert not distribution.is_possible
    assert distribution.log_z == -np.inf
    assert not distribution.diagnosis.trusted
    with pytest.raises(ValueError, match="no sampled path reaches the goal"):
        distribution.avoidance_probabilities()


def test_a_diagnosis_says_what_is_wrong():
    well = SamplingDiagnosis(4000, 0.7, 1500.0, 0.2, np.ones(1), 0.0, 2)
    assert well.trusted
    thin = replace(well, effective=12.0, pareto_k=0.93, late=0.1)
    assert [phrase.split()[0] for phrase in thin.complaints] == ["12", "the", "the"]
    assert not thin.trusted


def test_a_model_and_tasks_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match=r"SampledModel\.samples must be positive: 0"):
        replace(MODEL, samples=0)
    with pytest.raises(ValueError, match="does not divide the horizon"):
        MODEL.distribution(replace(TASK, horizon=3.1))
    assert MODEL.passage(replace(TASK, horizon=3.1), round_horizon=True).steps == 12


def test_what_needs_cells_says_so_of_a_model_without_them():
    with pytest.raises(TypeError, match="needs a TabularModel; a SampledModel has no cells"):
        TrajectoryDistribution.of_task(MODEL, TASK)


def test_sets_truths_and_crossings_are_those_of_the_weighted_paths():
    distribution = MODEL.distribution(TASK)
    entered, weight = CELLS.violated_by(distribution.paths), distribution.weight
    phi = distribution.violation_probabilities()
    some = np.argsort(np.abs(phi - 0.4))[:2]
    members = np.isin(np.arange(100), some)
    free = ~entered[:, some].any(axis=1)
    beside = [np.sum(weight[free & ~entered[:, i]]) for i in range(100)]
    np.testing.assert_allclose(np.exp(distribution.log_avoidance_beside(members)), beside)
    under = distribution.under(members)
    np.testing.assert_allclose(under.log_z - distribution.log_z, np.log(np.sum(weight[free])))
    expected = weight[free] @ entered[free] / np.sum(weight[free])
    np.testing.assert_allclose(under.violation_probabilities(), expected, atol=1e-12)
    effective = np.sum(weight[free]) ** 2 / np.sum(np.square(weight[free]))
    assert under.diagnosis.effective == pytest.approx(effective)
    assert effective < distribution.diagnosis.effective
    surely = ~entered.any(axis=0)  # what all paths avoid no path moves
    assert surely.any()
    assert not distribution.influences()[:, surely].any()
    drawn = np.mean(distribution.crossings(4000, np.random.default_rng(0)), axis=0)
    assert np.max(np.abs(drawn - phi)) < 0.04  # five standard errors of 4000 draws
    assert not distribution.under(np.ones(100, dtype=bool)).is_possible


def test_a_goal_that_is_a_point_is_reached_within_the_tolerance_to_each_side():
    goal = Box([1.0, -np.inf], [1.0, np.inf])
    reached = replace(MODEL, tolerance=0.2).passage(replace(TASK, goal=goal)).goal
    np.testing.assert_allclose(reached.lower, [0.8, -np.inf])
    np.testing.assert_allclose(reached.upper, [1.2, np.inf])


def test_nothing_is_unavoidable_only_because_no_sample_avoids_it():
    distribution = MODEL.distribution(replace(TASK, start=np.array([0.5, 0.3])))
    forecast = forecast_of(distribution, 50)
    never = distribution.avoidance_probabilities() == 0
    assert never.any()  # the start's own region
    np.testing.assert_allclose(forecast.avoidance[never], 0.5 / distribution.diagnosis.effective)
    assert np.all(forecast.sampling.replicates > 0)
    assert forecast.sampling.unresolved(forecast.avoidance[None])[0, never].all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"samples": 2.5}, r"SampledModel\.samples must be a whole number from 0 on: 2\.5"),
        ({"substeps": np.inf}, "substeps must be a whole number"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"replicates": 0}, "replicates must be positive"),
        ({"temperature": np.inf}, "temperature must be finite"),
        ({"limit": Box([0.0], [0.0])}, "limit needs a range above 0 of each of 1 controls"),
        ({"limit": Box([-1.0, -1.0], [1.0, 1.0])}, "each of 1 controls"),
        ({"system": TelescopingPendulum()}, "do not fit a state space of 4"),
    ],
)
def test_numbers_that_cannot_be_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        replace(MODEL, **change)


@pytest.mark.parametrize(("linear", "cubic"), [(1.0, 50.0), (40.0, 0.0), (80.0, 0.0)])
def test_paths_that_diverge_have_no_weight(linear, cubic):
    """Where noise blows up, or the recursion does, what is left has finite probabilities."""
    space = StateSpace(Box([-3.0, -3.0], [3.0, 3.0]), [False, False], ("x", "y"))

    def rates(x, u):
        push = linear * x[..., 0] + cubic * x[..., 0] ** 3 + u[..., 0]
        return push, linear / 2 * x[..., 1] + 0.9 * u[..., 0] + 0.1 * u[..., 1]

    box = Box([-1.0, -1.0], [1.0, 1.0])
    system, regions = FunctionSystem(rates, space, box), Regions.from_grid(space, (3, 3))
    task = Task(np.array([-0.01, 0.0]), Box([-0.28, -0.3], [0.32, 0.3]), 1.0)
    model = SampledModel(system, regions, 0.1, samples=100, restarts=3, limit=box)
    with np.errstate(over="ignore", invalid="ignore"):
        distribution = model.distribution(task)
    assert not np.isnan(distribution.log_z)
    assert np.isfinite(distribution.paths).all()
    if distribution.is_possible:
        assert np.isfinite(distribution.violation_probabilities()).all()


def test_a_search_that_diverges_is_said_to():
    """x' = 5 x + 50 x^3 is infinite within 0.02 s from 1, whatever the control."""
    line = StateSpace(Box([-2.0], [2.0]), [False], ("x",))
    system = FunctionSystem(
        lambda x, u: (5 * x[..., 0] + 50 * x[..., 0] ** 3 + u[..., 0],), line, Box([-1.0], [1.0])
    )
    model = SampledModel(system, Regions.from_grid(line, (4,)), 0.1, samples=100)
    task = Task(np.array([1.0]), Box.point([1.5]), 2.0)
    with pytest.raises(ValueError, match=r"reaches the goal: the search .* diverged"):
        model.distribution(task).violation_probabilities()
    path = Demonstration.from_path(np.linspace(1, 1.5, 21)[:, None], 0.1, name="up")
    (told, _) = infer(model, [path]).warnings
    assert told.startswith("the samples of up are not to be believed: the search")


def test_tasks_at_once_are_as_one_by_one():
    wide = replace(TASK, goal=Box([1.0, -np.inf], [1.4, np.inf]), horizon=2.0)
    other = replace(TASK, start=np.array([4.0, 1.0]))
    tasks, model = [TASK, wide, other], replace(MODEL, samples=200, restarts=2)
    for task, at_once in zip(tasks, model.distributions(tasks), strict=True):
        alone = model.distribution(task)
        np.testing.assert_allclose(at_once.modes.cost, alone.modes.cost, rtol=1e-6)
        assert abs(at_once.log_z - alone.log_z) < 1e-4


def test_a_first_look_at_many_tasks_leaves_few_to_look_at_again():
    model = replace(MODEL, regions=Regions.from_grid(PENDULUM.space, (3, 3)), samples=400)
    ends = np.random.default_rng(0).uniform([0, -2], [6.2, 2], (5, 2, 2))
    tasks = [Task(start, Box(goal - 0.1, goal + 0.1), 2.0) for start, goal in ends]
    path = rollout(PENDULUM, [0.5, 0.0], np.full((200, 1), 0.5), 0.01)
    inference = infer(model, [Demonstration.from_path(path, 0.01)])
    looks = list[tuple[int, int]]()
    best = next_tasks(
        model, inference, tasks, count=1, progress=lambda done, of: looks.append((done, of))
    )
    assert looks == [(1, 5), (2, 5), (3, 5), (4, 5), (5, 5), (1, 3), (2, 3), (3, 3)]
    each = [next_tasks(model, inference, [task], count=1)[0].information for task in tasks]
    assert best[0].number == np.argmax(each)
    assert best[0].information == pytest.approx(max(each), abs=0.03)


def test_shares_of_a_pilot_that_left_the_state_space_are_even():
    np.testing.assert_allclose(spread(np.zeros(4)), 0.25)
