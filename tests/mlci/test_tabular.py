"""The discretisation against one cell, one action, one region at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp
from toy_models import toy_model

from mlci.demonstrations import Task
from mlci.diagnosis import diagnose
from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.misfit import sample_crossings
from mlci.paths import substep_count
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator, FunctionSystem, Pendulum, System
from mlci.tabular import TabularModel, action_grid, discretize


def reference_segment(system: System, start: np.ndarray, control: np.ndarray, dt: float):
    """A dense, tightly integrated path (2001, n) of one move."""
    solution = solve_ivp(
        lambda _, x: system.dynamics(x, control),
        (0, dt),
        start,
        t_eval=np.linspace(0, dt, 2001),
        rtol=1e-10,
        atol=1e-12,
    )
    return solution.y.T


@pytest.mark.parametrize(
    ("system", "shape", "dt"),
    [(Pendulum(), (10, 10), 0.5), (Pendulum(), (14, 9), 1.0), (DoubleIntegrator(), (12, 8), 0.8)],
)
def test_moves_match_an_ode_solver(system: System, shape: tuple[int, int], dt: float) -> None:
    grid, actions = Grid(system.space, shape), action_grid(system, 3)
    regions = Regions.from_grid(system.space, (10, 10))
    mdp = discretize(system, grid, actions, dt, regions)
    crosses = mdp.kept.crosses.toarray().reshape(grid.size, 3, -1)
    checked = 0
    for cell in range(0, grid.size, 3):
        for a in range(3):
            path = reference_segment(system, grid.centers[cell], actions[a], dt)
            if not np.all(system.space.contains(path)):
                edge = np.max(np.abs(path[:, 1])) - system.space.bounds.upper[1]
                assert not allowed(mdp)[cell, a] or edge < 1e-3
                continue
            inside = np.all(
                (system.space.wrap(path)[:, None] > regions.lower)
                & (system.space.wrap(path)[:, None] < regions.upper),
                axis=2,
            )
            # A region that the path only grazes, for under 5 of 2001 samples, may go either way.
            samples = inside.sum(axis=0)
            sure = (samples == 0) | (samples > 5)
            np.testing.assert_array_equal(crosses[cell, a, sure & (samples > 5)], True)
            assert crosses[cell, a, samples == 0].sum() <= 1
            assert mdp.kept.successor[cell, a] == grid.index(path[-1]) or _near_edge(grid, path[-1])
            assert mdp.kept.reward[cell, a] == pytest.approx(-float(actions[a, 0] ** 2) * dt)
            checked += 1
    assert checked > 50


def allowed(model: TabularModel) -> np.ndarray:
    """(S, M) whether a move stays in the space and out of the truth."""
    return model.kept.allowed(model.truth)


def _near_edge(grid: Grid, state: np.ndarray) -> bool:
    position = (grid.space.wrap(state) - grid.space.bounds.lower) / grid.widths
    return bool(np.any(np.abs(position - np.round(position)) < 1e-4))


def test_a_thin_constraint_between_a_cell_and_its_successor_is_caught() -> None:
    """A tenth of a cell wide, strictly inside a move, for every move that jumps far enough."""
    system = Pendulum()
    grid, actions = Grid(system.space, (20, 20)), action_grid(system, 5)
    cell = int(grid.index([1.0, 4.0]))
    path = reference_segment(system, grid.centers[cell], actions[2], 0.5)
    middle, width = path[1000], grid.widths / 10
    thin = Regions.from_boxes(system.space, [Box(middle - width / 2, middle + width / 2)])
    mdp = discretize(system, grid, actions, 0.5, thin)
    assert grid.index(path[-1]) == mdp.kept.successor[cell, 2]
    assert int(grid.index(middle)) not in (cell, mdp.kept.successor[cell, 2])
    assert mdp.kept.crosses.toarray().reshape(grid.size, 5)[cell, 2]
    assert not allowed(mdp.under([True]))[cell, 2]


def test_a_move_goes_round_the_way_it_turns() -> None:
    """At 9 rad/s for 0.5 s the short way round is the wrong one; a chord spans a quarter turn."""
    circle = StateSpace(Box([0.0], [2 * np.pi]), [True], ("angle",), ("rad",))
    rotor = FunctionSystem(lambda x, u: (u[..., 0],), circle, Box([-9.0], [9.0]))
    grid, regions = Grid(circle, (8,)), Regions.from_grid(circle, (16,))
    model = discretize(rotor, grid, [[9.0], [-9.0]], 0.5, regions)
    assert substep_count(rotor, grid, model.actions, 0.5) == 3  # 4.5 rad in steps below pi / 2
    crosses = model.kept.crosses.toarray().reshape(8, 2, 16)
    for cell in range(8):
        for move, turn in enumerate((1, -1)):
            begin = grid.centers[cell, 0]
            path = np.linspace(begin, begin + turn * 4.5, 4001) % (2 * np.pi)
            passed = np.unique((path[1:-1] // (np.pi / 8)).astype(int))
            assert np.flatnonzero(crosses[cell, move]).tolist() == passed.tolist()


def test_a_path_that_leaves_the_bounds_and_returns_is_not_allowed() -> None:
    """Thrown up against the limit of position, the mass would come back within the step."""
    system = DoubleIntegrator(position_limit=1.0, speed_limit=2.0, control_limit=2.0)
    grid = Grid(system.space, (10, 10))
    mdp = discretize(system, grid, [[-2.0]], 1.0, Regions.from_grid(system.space, (2, 2)))
    cell = int(grid.index([0.9, 1.0]))
    end = reference_segment(system, grid.centers[cell], np.array([-2.0]), 1.0)[-1]
    assert system.space.contains(end)
    assert not allowed(mdp)[cell, 0]


def test_cell_averaged_model_is_the_mixture_over_start_points() -> None:
    """Phi of the k = 2 model equals that of the MDP whose actions are (action, start) pairs."""
    system = DoubleIntegrator()
    grid, actions = Grid(system.space, (6, 6)), action_grid(system, 3)
    regions = Regions.from_grid(system.space, (3, 3))
    averaged = discretize(system, grid, actions, 1.0, regions, samples=2)
    assert averaged.moves == 3 * 4
    np.testing.assert_array_equal(averaged.action, np.repeat(np.arange(3), 4))
    starts = grid.points_inside(2)
    for move in (0, 5, 11):
        end = starts[:, move % 4] @ np.array([[1.0, 0.0], [1.0, 1.0]])
        end = end + np.array([0.5, 1.0]) * actions[move // 4]
        expected = np.where(allowed(averaged)[:, move], grid.index(end), -1)
        np.testing.assert_array_equal(averaged.kept.successor[:, move], expected)
    distribution = TrajectoryDistribution(averaged, 14, [21], 4)
    assert distribution.is_possible
    assert np.all(distribution.violation_probabilities() <= 1)


def test_one_sample_is_the_centre_model() -> None:
    system = Pendulum()
    grid = Grid(system.space, (8, 8))
    regions = Regions.from_grid(system.space, (4, 4))
    actions = action_grid(system, 3)
    centre = discretize(system, grid, actions, 0.5, regions)
    # An odd subdivision has the centre as its middle point.
    third = discretize(system, grid, actions, 0.5, regions, samples=3)
    np.testing.assert_array_equal(centre.kept.successor, third.kept.successor[:, 4::9])


def test_blocks_of_cells_join_without_a_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    system = Pendulum()
    arguments = (
        system,
        Grid(system.space, (7, 9)),
        action_grid(system, 3),
        0.5,
        Regions.from_grid(system.space, (5, 5)),
    )
    whole = discretize(*arguments, samples=2)
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", 50)
    monkeypatch.setattr("mlci.tabular.PATHS_AT_ONCE", 30)
    told: list[tuple[int, int]] = []
    pieces = discretize(*arguments, samples=2, progress=lambda *count: told.append(count))
    np.testing.assert_array_equal(whole.kept.successor, pieces.kept.successor)
    np.testing.assert_array_equal(whole.kept.reward, pieces.kept.reward)
    assert (whole.kept.crosses != pieces.kept.crosses).nnz == 0
    assert told == sorted(told)
    assert told[-1] == (63, 63)
    assert len(told) > 10


def test_temperature_divides_the_reward() -> None:
    system = Pendulum()
    arguments = (
        system,
        Grid(system.space, (4, 4)),
        action_grid(system, 3),
        0.5,
        Regions.from_grid(system.space, (2, 2)),
    )
    cold = discretize(*arguments, temperature=0.5)
    np.testing.assert_allclose(cold.kept.reward, 2 * discretize(*arguments).kept.reward)


@pytest.mark.parametrize("samples", [1, 2])
def test_another_temperature_is_as_good_as_a_fresh_model(samples: int) -> None:
    """Also what is merged, and under a truth."""
    system = DoubleIntegrator()
    regions = Regions.from_grid(system.space, (2, 2))
    arguments = system, Grid(system.space, (6, 5)), action_grid(system, 3), 0.5, regions, samples
    fresh = discretize(*arguments, temperature=0.3).under([True, False, False, False])
    model = discretize(*arguments, temperature=2.0)
    assert model.merged.log_weight.size > 0  # held before the temperature changes
    changed = model.under([True, False, False, False]).with_temperature(0.3)
    assert changed.temperature == 0.3
    np.testing.assert_allclose(changed.kept.reward, fresh.kept.reward, rtol=1e-14)
    np.testing.assert_array_equal(allowed(changed), allowed(fresh))
    np.testing.assert_array_equal(changed.truth, fresh.truth)
    start, goal = 17, np.arange(30)
    both = [TrajectoryDistribution(each, start, goal, 4) for each in (changed, fresh)]
    assert both[0].is_possible
    np.testing.assert_allclose(both[0].log_z, both[1].log_z, rtol=1e-13)
    np.testing.assert_allclose(*(each.avoidance_probabilities() for each in both), rtol=1e-13)
    for temperature in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match=f"positive and finite, not {temperature}"):
            model.with_temperature(temperature)
        with pytest.raises(ValueError, match=f"positive and finite, not {temperature}"):
            discretize(*arguments, temperature=temperature)


def test_action_grid_spans_the_control_box() -> None:
    np.testing.assert_allclose(action_grid(Pendulum(), 5)[:, 0], [-2, -1, 0, 1, 2])
    np.testing.assert_allclose(action_grid(Pendulum(), [1]), [[0.0]])
    for count in (np.int64(3), [np.int64(3)], np.array([3])):
        np.testing.assert_allclose(action_grid(Pendulum(), count)[:, 0], [-2, 0, 2])
    with pytest.raises(ValueError, match=r"whole counts of at least 1, not 2\.5"):
        action_grid(Pendulum(), 2.5)
    with pytest.raises(ValueError, match="counts of at least 1, not"):
        action_grid(Pendulum(), 0)
    with pytest.raises(ValueError, match="counts of at least 1, not"):
        action_grid(Pendulum(), [3, 3])


def test_a_truth_is_a_mask_over_the_regions() -> None:
    """Forbidden are the moves that cross any of its regions, and no others; a number is no mask."""
    system = Pendulum()
    regions = Regions.from_grid(system.space, (4, 4)).joined(
        Regions.from_boxes(system.space, [Box([3.2, 0.1], [3.6, 0.9])], ["truth"])
    )
    model = discretize(system, Grid(system.space, (9, 9)), action_grid(system, 3), 0.5, regions)
    crosses = model.kept.crosses.toarray().reshape(81, 3, 17)
    both = model.under(regions.mask(["truth", "5"]))
    forbidden = crosses[..., 16] | crosses[..., 5]
    assert 0 < forbidden.sum() < 100
    np.testing.assert_array_equal(allowed(both), allowed(model) & ~forbidden)
    np.testing.assert_array_equal(allowed(model.under(np.zeros(17, bool))), allowed(model))
    in_turn = model.under(regions.mask(["truth"])).under(regions.mask(["5"]))
    np.testing.assert_array_equal(allowed(in_turn), allowed(both))
    np.testing.assert_array_equal(in_turn.truth, both.truth)
    assert np.flatnonzero(both.truth).tolist() == [5, 16]
    for wrong in ([16], 16, np.ones(16, bool), np.ones((1, 17), bool), np.ones(17)):
        with pytest.raises(ValueError, match="mask over 17 regions needs as many truth values"):
            model.under(wrong)


def test_errors_print_the_shapes() -> None:
    good = toy_model(
        np.zeros((3, 2), int), np.zeros((3, 2)), np.ones((3, 2), bool), np.eye(6, 4) > 0
    )
    assert good.action.tolist() == [0, 1]
    for field, value in {
        "samples": 2,
        "actions": np.zeros((4, 1)),
        "grid": Grid(good.grid.space, (4,)),
        "regions": Regions.from_grid(good.grid.space, (3,)),
    }.items():
        with pytest.raises(ValueError, match=r"3 cells|4 cells") as refusal:
            replace(good, **{field: value})
        assert "successor (3, 2)" in str(refusal.value)
        assert "do not agree" in str(refusal.value)
    for field, value in {
        "reward": np.zeros((2, 2)),
        "crosses": sparse.csr_matrix((5, 4), dtype=bool),
        "successor": np.zeros(6, int),
    }.items():
        with pytest.raises(ValueError, match=r"successor \(.*do not agree"):
            replace(good.kept, **{field: value})
    beyond = replace(good.kept, successor=np.full((3, 2), 3))
    with pytest.raises(ValueError, match="a move leads to no cell"):
        replace(good, kept=beyond)
    with pytest.raises(ValueError, match="time step must be positive and finite, not 0"):
        replace(good, dt=0.0)


def test_moves_that_are_not_kept_are_followed_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that needs single moves gives the same bits from a model too large to keep them."""
    system = Pendulum()
    regions = Regions.from_grid(system.space, (5, 5))
    arguments = system, Grid(system.space, (9, 8)), action_grid(system, 3), 0.5, regions, 2
    kept = discretize(*arguments)
    monkeypatch.setattr("mlci.tabular.MOST_KEPT", kept.states * kept.moves - 1)
    monkeypatch.setattr("mlci.tabular._MOVES_AT_ONCE", 40)
    progress: list[tuple[int, int]] = []
    large = discretize(*arguments, progress=lambda *count: progress.append(count))
    assert large.kept is None
    assert progress[-1] == (72, 72)
    assert len(progress) > 10
    truth, task = np.arange(25) == 13, Task([0.4, -1.0], Box.point([1.7, 0.5]), 2.0)
    kept, large = kept.under(truth), large.under(truth)
    for model in (kept, kept.with_temperature(0.4)):
        other = large.with_temperature(model.temperature)
        assert diagnose(other) == diagnose(model)
        for exact_ends in (False, True):
            one, two = (
                TrajectoryDistribution.of_task(each, task, exact_ends=exact_ends)
                for each in (model, other)
            )
            np.testing.assert_allclose(two.log_z, one.log_z, rtol=1e-13)
            both = one.avoidance_probabilities(), two.avoidance_probabilities()
            np.testing.assert_allclose(*both, rtol=1e-12)
            drawn = [sample_crossings(each, 50, np.random.default_rng(0)) for each in (one, two)]
            np.testing.assert_array_equal(*drawn)
            assert 0 < np.sum(drawn[0]) < drawn[0].size
