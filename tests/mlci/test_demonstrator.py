import numpy as np
import pytest

from mlci.control.ilqr import Solution, optimize
from mlci.demonstrations import Demonstration, Task
from mlci.demonstrator import (
    Outcome,
    Trial,
    _best_of,
    crossing,
    demonstrate,
    enters,
    sample_trials,
)
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.simulate import RK4, euler_step, rollout
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum

PENDULUM = Pendulum()
DT = 0.01
START_BOX = Box(np.array([0.0, -2.0]), np.array([2 * np.pi, 2.0]))
TRUTH = Box(np.array([np.pi, 0.0]), np.array([1.2 * np.pi, 1.2]))
TRUTHS = Regions.from_boxes(PENDULUM.space, [TRUTH])


@pytest.fixture(scope="module")
def safe_set():
    return solve_safe_set(PENDULUM, Grid(PENDULUM.space, (81, 81)), TRUTHS)


@pytest.fixture(scope="module")
def safety_filter(safe_set):
    margin = border_margin(PENDULUM, safe_set, DT)
    return SafetyFilter(PENDULUM, safe_set, DT, margin)


@pytest.fixture(scope="module")
def study(safe_set, safety_filter):
    """Sixteen trials, and what became of them."""
    trials = draw(safe_set, trials=16, margin=safety_filter.margin)
    return trials, demonstrate(PENDULUM, trials, TRUTHS, safety_filter, dt=DT)


def draw(safe_set=None, **changes):
    """Trials of the pendulum, from seed 7 unless told otherwise."""
    options = {"trials": 4, "seed": 7, "horizon": 5.0, "dt": DT} | changes
    return sample_trials(PENDULUM, safe_set, START_BOX, **options)


def trial(start, goal, *levels, system=PENDULUM, horizon=5.0):
    """A trial between two states whose guesses are constant."""
    guesses = np.array([np.full((round(horizon / DT), 1), level) for level in levels])
    return Trial(Task(np.array(start), Box.point(goal), horizon), guesses)


def around(state, size=0.05):
    """A truth: a small box around a state of the pendulum."""
    return Regions.from_boxes(PENDULUM.space, [Box(state - size, state + size)])


def test_a_trial_does_not_depend_on_how_many_there_are():
    few, many, other = draw(trials=3), draw(trials=8), draw(trials=3, seed=8)
    for mine, same, different in zip(few, many, other, strict=False):
        assert np.array_equal(mine.task.start, same.task.start)
        assert np.array_equal(mine.task.goal.lower, same.task.goal.lower)
        assert np.array_equal(mine.guesses, same.guesses)
        assert not np.any(mine.task.start == different.task.start)
    drawn = [
        number
        for item in many
        for number in (*item.task.start, *item.task.goal.lower, *np.unique(item.guesses))
    ]
    assert len(set(drawn)) == 8 * (2 + 2 + 3 * 10)


def test_trials_may_be_drawn_in_batches():
    whole, part = draw(trials=8), draw(trials=3, first=5)
    for one, other in zip(whole[5:], part, strict=True):
        assert np.array_equal(one.task.start, other.task.start)
        assert np.array_equal(one.guesses, other.guesses)


def test_crossing_trials_are_those_whose_optimum_enters_the_truth():
    trials = draw(trials=8, first=7)  # two of them cross
    attempts = demonstrate(PENDULUM, trials, None, None, dt=DT)
    expected = []
    for item, attempt in zip(trials, attempts, strict=True):
        path = attempt.demonstration.states
        fine = path[:-1, None] + np.linspace(0, 1, 50)[:, None] * np.diff(path, axis=0)[:, None]
        angle, speed = fine[..., 0] % (2 * np.pi), fine[..., 1]
        through = (angle > np.pi) & (angle < 1.2 * np.pi) & (speed > 0) & (speed < 1.2)
        if attempt.outcome is Outcome.KEPT and through.any():
            expected.append(item)
    assert 0 < len(expected) < 8
    assert crossing(PENDULUM, trials, TRUTHS, dt=DT) == expected
    # Nobody who fails without a truth tells anything about it.
    assert crossing(PENDULUM, trials, TRUTHS, dt=DT, goal_tolerance=1e-12) == []


def test_starts_and_goals_fill_the_safe_part_of_the_box(safe_set):
    trials = draw(safe_set, trials=300, margin=0.1)
    states = np.array([[item.task.start, item.task.goal.upper] for item in trials]).reshape(-1, 2)
    assert np.all(START_BOX.contains(states))
    assert np.all(safe_set.value(states) >= 0.1)
    everywhere = np.random.default_rng(0).uniform(START_BOX.lower, START_BOX.upper, (20_000, 2))
    safe = everywhere[safe_set.value(everywhere) >= 0.1]
    share, exact = (np.histogram2d(*sample.T, bins=2)[0] / len(sample) for sample in (states, safe))
    np.testing.assert_allclose(share, exact, atol=0.06)


def test_guesses_are_held_and_fill_the_control_box():
    guesses = np.array([item.guesses for item in draw(trials=20, hold=0.8)])
    assert guesses.shape == (20, 3, 500, 1)
    levels = guesses[:, :, ::80]
    assert np.array_equal(np.repeat(levels, 80, axis=2)[:, :, :500], guesses)
    assert np.abs(levels).max() <= 2
    assert np.quantile(levels, [0.1, 0.9]) == pytest.approx([-1.6, 1.6], abs=0.2)


def test_a_goal_may_be_a_region():
    offsets = Box(np.array([-0.2, -np.inf]), np.array([0.3, np.inf]))
    for point, region in zip(draw(), draw(goal_offsets=offsets), strict=True):
        assert np.array_equal(region.task.goal.lower, point.task.goal.lower + offsets.lower)
        assert np.array_equal(region.task.goal.upper, point.task.goal.lower + offsets.upper)


def test_what_is_kept_obeys_the_dynamics_the_truth_and_the_task(study):
    trials, attempts = study
    kept = [attempt for attempt in attempts if attempt.outcome is Outcome.KEPT]
    assert len(kept) > 12
    assert not [item for item in attempts if item.outcome is Outcome.TRUTH_ENTERED]
    for item, attempt in zip(trials, attempts, strict=True):
        shown = attempt.demonstration
        assert shown.task is item.task
        again = rollout(PENDULUM, item.task.start, shown.controls, DT, step=euler_step)
        np.testing.assert_allclose(shown.states, again, atol=1e-12)
    for attempt in kept:
        last, goal = attempt.demonstration.states[-1], attempt.demonstration.task.goal.lower
        turn = (last[0] - goal[0] + np.pi) % (2 * np.pi) - np.pi
        assert np.hypot(turn, last[1] - goal[1]) == pytest.approx(attempt.miss, abs=1e-12)
        assert attempt.miss <= 0.05
        angle = attempt.demonstration.states[:, 0] % (2 * np.pi)
        speed = attempt.demonstration.states[:, 1]
        assert not np.any((angle > np.pi) & (angle < 1.2 * np.pi) & (speed > 0) & (speed < 1.2))
        assert np.max(np.abs(speed)) <= 6


def test_demonstrator_moves_by_its_integrator_and_stays_out_of_the_truth(safe_set, safety_filter):
    trials = draw(safe_set, trials=4, margin=safety_filter.margin, horizon=3.0)
    exact = SafetyFilter(PENDULUM, safe_set, DT, safety_filter.margin, integrator=RK4)
    attempts = demonstrate(PENDULUM, trials, TRUTHS, exact, dt=DT, integrator=RK4)
    outcomes = [attempt.outcome for attempt in attempts]
    assert Outcome.TRUTH_ENTERED not in outcomes
    assert outcomes.count(Outcome.KEPT) >= 2
    for attempt in attempts:
        path = attempt.demonstration
        again = rollout(PENDULUM, path.task.start, path.controls, DT)
        np.testing.assert_allclose(path.states, again, atol=1e-12)
        # The motion in which the truth is looked for leads from sample to sample.
        ends = rollout(PENDULUM, path.states[:-1], path.controls[:, None], DT, 11)[:, -1]
        np.testing.assert_allclose(path.states[1:], ends, atol=1e-9)


def test_attempt_is_the_cheapest_that_can_be_kept():
    # To wind backwards is dearer here; the truth bars the cheaper way.
    item = trial([0.5, 0.0], [3.0, 0.0], 0.0, -1.0)
    points = np.array([[0.5, 0.0]] * 2), np.array([[3.0, 0.0]] * 2)
    solution = optimize(PENDULUM, points[0], points[1], points[1], item.guesses, DT)
    cheap, dear = np.argsort(solution.cost)
    assert solution.cost[cheap] < solution.cost[dear] - 1
    (free,) = demonstrate(PENDULUM, [item], None, None, dt=DT)
    assert (free.outcome, free.restart) == (Outcome.KEPT, cheap)
    assert free.cost == solution.cost[cheap]
    assert np.array_equal(free.demonstration.states, solution.states[cheap])
    barred = around(solution.states[cheap, 250])
    (other,) = demonstrate(PENDULUM, [item], barred, None, dt=DT)
    assert (other.outcome, other.restart) == (Outcome.KEPT, dear)
    both = barred.joined(around(solution.states[dear, 250]))
    (none,) = demonstrate(PENDULUM, [item], both, None, dt=DT)
    assert (none.outcome, none.restart) == (Outcome.TRUTH_ENTERED, cheap)


def test_every_reason_is_named_and_the_gravest_wins():
    item = trial([0.5, 0.0], [3.0, 0.0], 1.0)
    slow = Pendulum(speed_limit=0.2)
    barred = around(np.array([0.5, 0.1]))

    def outcome(system, truth, iterations):
        (attempt,) = demonstrate(system, [item], truth, None, dt=DT, iterations=iterations)
        return attempt.outcome

    assert outcome(PENDULUM, None, 10) is Outcome.KEPT
    assert outcome(PENDULUM, None, 0) is Outcome.GOAL_MISSED
    assert outcome(slow, None, 10) is Outcome.BOUNDS_LEFT
    assert outcome(slow, None, 0) is Outcome.BOUNDS_LEFT
    assert outcome(PENDULUM, barred, 0) is Outcome.TRUTH_ENTERED
    assert outcome(slow, barred, 0) is Outcome.TRUTH_ENTERED


def test_limited_demonstrator_stays_in_the_control_box_and_out_of_the_truth(
    safe_set, safety_filter
):
    trials = draw(safe_set, trials=5, margin=safety_filter.margin, horizon=2.0)
    relaxed = SafetyFilter(PENDULUM, safe_set, DT, safety_filter.margin, 0.2)
    for filter_, limit in (
        (safety_filter, None),
        (safety_filter, PENDULUM.control_box),
        (relaxed, PENDULUM.control_box),
    ):
        attempts = demonstrate(PENDULUM, trials, TRUTHS, filter_, dt=DT, limit=limit)
        peak = max(np.max(np.abs(each.demonstration.controls)) for each in attempts)
        assert peak > 3.0 if limit is None else peak <= 2.0
        outcomes = [each.outcome for each in attempts]
        assert Outcome.TRUTH_ENTERED not in outcomes
        assert outcomes.count(Outcome.KEPT) >= 2


def test_demonstrator_that_may_not_wind_goes_at_most_half_a_turn(safe_set):
    trials = draw(safe_set, trials=10, dt=0.02)
    way = {}
    for wind in (True, False):
        attempts = demonstrate(PENDULUM, trials, None, None, dt=0.02, wind=wind)
        paths = [a.demonstration.states[:, 0] for a in attempts if a.outcome is Outcome.KEPT]
        assert len(paths) >= 7
        way[wind] = np.array([np.abs(path[-1] - path[0]) for path in paths])
    assert np.max(way[True]) > np.pi + 0.1
    assert np.max(way[False]) <= np.pi + 0.05


def test_motion_between_samples_counts():
    # From rest under u = 1 for 1 s: x = v^2 / 2, below the chord from (0, 0) to (0.5, 1).
    mass = DoubleIntegrator()
    states, controls = np.array([[[0.0, 0.0], [0.5, 1.0]]]), np.ones((1, 1, 1))

    def entered(lower, upper):
        truth = Regions.from_boxes(mass.space, [Box(np.array(lower), np.array(upper))])
        return enters(mass, truth, states, controls, 1.0).tolist()

    assert entered([0.10, 0.4], [0.15, 0.6]) == [True]  # the motion passes, the chord does not
    assert entered([0.24, 0.4], [0.26, 0.6]) == [True]  # the chord passes, the motion does not
    assert entered([0.4, 0.4], [0.5, 0.6]) == [False]
    assert entered([-0.1, -0.1], [0.0, 0.0]) == [False]  # they touch a corner


def test_impossible_studies_are_refused(safe_set):
    with pytest.raises(ValueError, match=r"0\.3 s does not divide the horizon of 5\.0 s"):
        draw(dt=0.3)
    with pytest.raises(ValueError, match="needs 2 finite sides"):
        sample_trials(PENDULUM, None, Box.point([0.0]), trials=1, seed=0, horizon=5.0, dt=DT)
    with pytest.raises(ValueError, match=r"none of 10000 states .* V >= 0\.0"):
        sample_trials(
            PENDULUM, safe_set, Box.point([3.3, 0.6]), trials=1, seed=0, horizon=5.0, dt=DT
        )


@pytest.mark.parametrize(
    ("start", "horizon", "message"),
    [
        ([0.0], 5.0, r"finite start of shape \(2,\)"),
        ([0.0, np.nan], 5.0, "finite start"),
        ([0.0, 0.0], 0.0, "horizon must be positive, not 0"),
        ([0.0, 0.0], np.inf, "horizon must be positive, not inf"),
    ],
)
def test_task_checks_itself(start, horizon, message):
    with pytest.raises(ValueError, match=message):
        Task(np.array(start), Box.point([1.0, 0.0]), horizon)


def test_trial_checks_itself():
    with pytest.raises(ValueError, match=r"guesses \(R, K, m\), not \(3, 500\)"):
        Trial(Task(np.zeros(2), Box.point([1.0, 0.0]), 5.0), np.zeros((3, 500)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"states": np.zeros((1, 2))}, r"'lift' needs states of shape \(K\+1, 2\).*\(1, 2\)"),
        ({"states": np.zeros((11, 3))}, r"\(11, 3\)"),
        ({"controls": np.zeros((11, 1))}, r"controls of shape \(10, m\), not \(11, 1\)"),
        ({"states": np.pad([[np.nan, 0]], ((7, 3), (0, 0)))}, "states that are not .* sample 7"),
        ({"controls": np.full((10, 1), np.inf)}, "controls that are not finite, .* sample 0"),
        ({"states": np.full((11, 2), 0.5)}, r"starts at \[0\.5 0\.5\], its task at"),
        ({"times": np.arange(11) * 0.2}, r"lasts 2\.0 s, but its task 1\.0 s"),
        ({"times": np.arange(10) * 0.1}, r"needs 11 times, not \(10,\)"),
        ({"times": np.arange(1, 12) * 0.1}, r"needs times that rise from 0, not \[0\.1"),
        ({"times": np.array([0.0] * 10 + [1.0])}, "needs times that rise from 0"),
    ],
)
def test_demonstration_checks_itself(changes, message):
    given = {"states": np.zeros((11, 2)), "controls": np.zeros((10, 1))}
    given = given | {"times": np.arange(11) * 0.1} | changes
    task = Task(np.zeros(2), Box.point([1.0, 0.0]), 1.0)
    with pytest.raises(ValueError, match=message):
        Demonstration(task, given["states"], given["controls"], given["times"], "lift")


def test_of_equal_restarts_the_first_is_taken_whatever_the_rounding():
    path = np.full((4, 3, 2), [0.5, 0.0])
    for lowest in ([0.5, 0.5 + 1e-15], [0.5 + 1e-15, 0.5]):
        cost = np.array([*lowest, 0.4, 0.3])
        solution = Solution(path, np.zeros((4, 2, 1)), np.zeros((4, 2)), cost[None])
        failures = np.zeros((3, 4), bool)
        failures[2, 3] = True  # the cheapest of the second task misses its goal
        tasks = [trial([0.5, 0.0], [3.0, 0.0], 0.0).task] * 2
        attempts = _best_of(2, tasks, solution, failures, np.zeros(4), 2.5)
        assert [attempt.restart for attempt in attempts] == [0, 0]


def test_a_path_that_runs_away_is_one_that_left_the_bounds():
    """x' = x^3 under Euler overflows within a few steps, whatever the optimiser tries first."""
    space = StateSpace(Box([-3.0], [3.0]), [False], ("x",), ("m",))
    system = FunctionSystem(lambda x, u: (x[..., 0] ** 3 + u[..., 0],), space, Box([-1.0], [1.0]))
    task = Task(np.array([2.9]), Box.point([0.0]), 3.0)
    trial = Trial(task, np.full((1, 30, 1), 1.0))
    with np.errstate(over="ignore", invalid="ignore"):
        (attempt,) = demonstrate(system, [trial], None, None, dt=0.1, iterations=1)
    states = attempt.demonstration.states
    assert attempt.outcome is Outcome.BOUNDS_LEFT
    assert np.all(np.isfinite(states))
    assert states[1] == pytest.approx(2.9 + 0.1 * (2.9**3 + 1))
    assert states[-1] == states[-2]
    assert not np.isfinite(attempt.cost)
