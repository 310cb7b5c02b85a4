"""What every system must pass, by being listed in `listed_systems`."""

from __future__ import annotations

import ast
import inspect
import pkgutil

import numpy as np
import pytest
from listed_systems import LISTED, Listed
from scipy.integrate import solve_ivp

import mlci.zoo
from experiments.config.paths import CONF
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.grids import Grid
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.simulate import rollout
from mlci.spaces import Box
from mlci.system_check import check_affine, check_system
from mlci.tabular import action_grid, discretize

MOST_LINES = 40  # of a class, beside its docstring

each = pytest.mark.parametrize("listed", LISTED.values(), ids=LISTED.keys())


def drawn(listed: Listed, count: int) -> tuple[np.ndarray, np.ndarray]:
    """States and controls inside the boxes, away from their borders."""
    rng, boxes = np.random.default_rng(0), (listed.system.space.bounds, listed.system.control_box)
    states, controls = (
        rng.uniform(0.8 * box.lower + 0.2 * box.upper, 0.2 * box.lower + 0.8 * box.upper,
                    (count, box.dimension))
        for box in boxes
    )  # fmt: skip
    return states, controls


@each
def test_it_keeps_the_promises_of_a_system(listed: Listed) -> None:
    check_system(listed.system)
    check_affine(listed.system)


@each
def test_jacobians_are_the_slopes_of_the_dynamics(listed: Listed) -> None:
    system, (states, controls) = listed.system, drawn(listed, 9)
    by_state, by_control = system.jacobians(states, controls)
    step = 1e-5  # errors of order step^2 and rounding / step, both below 1e-9
    for d, nudge in enumerate(step * np.eye(states.shape[1])):
        ahead, behind = (system.dynamics(states + sign * nudge, controls) for sign in (1, -1))
        np.testing.assert_allclose(by_state[..., d], (ahead - behind) / (2 * step), atol=1e-8)
    for d, nudge in enumerate(step * np.eye(controls.shape[1])):
        ahead, behind = (system.dynamics(states, controls + sign * nudge) for sign in (1, -1))
        np.testing.assert_allclose(by_control[..., d], (ahead - behind) / (2 * step), atol=1e-8)


@each
def test_the_gradient_of_the_reward_is_its_slope(listed: Listed) -> None:
    system, (states, controls) = listed.system, drawn(listed, 9)
    gradient, hessian = system.reward_derivatives(states, controls)
    n, step = states.shape[1], 1e-4
    for d, nudge in enumerate(step * np.eye(controls.shape[1])):
        ahead, middle, behind = (
            system.running_reward(states, controls + sign * nudge) for sign in (1, 0, -1)
        )
        slope, bend = (ahead - behind) / (2 * step), (ahead - 2 * middle + behind) / step**2
        np.testing.assert_allclose(gradient[:, n + d], slope, atol=1e-6)
        np.testing.assert_allclose(hessian[:, n + d, n + d], bend, atol=1e-5)


@pytest.mark.parametrize("name", [name for name, it in LISTED.items() if it.kept is not None])
def test_what_is_conserved_stays(name: str) -> None:
    listed = LISTED[name]
    system = listed.conservative or listed.system
    states, _ = drawn(listed, 1)
    start = np.where(system.space.periodic, states[0], 0.5 * states[0])
    if name == "telescope":
        start[3] = 0.0  # a leg of constant length
    path = rollout(system, start, [listed.free] * 200, 0.01)
    kept = listed.kept(*path.T)
    np.testing.assert_allclose(kept, np.tile(kept[:, :1], (1, 201)), atol=1e-7)
    # It is no constant: another state has another value.
    assert np.max(np.abs(listed.kept(*(path[0] + 0.1)[:, None]) - kept[:, :1])) > 1e-3


@pytest.mark.parametrize("name", [name for name, it in LISTED.items() if it.closed is not None])
def test_a_constant_control_leads_where_the_formula_says(name: str) -> None:
    listed = LISTED[name]
    path = rollout(listed.system, listed.start, [listed.control] * 200, listed.time / 200)
    expected = listed.closed(listed.start, listed.control, listed.time)
    np.testing.assert_allclose(path[-1], expected, atol=1e-8)


@each
def test_moves_lead_where_the_dynamics_do(listed: Listed) -> None:
    """By an integrator of scipy's, which shares no code."""
    system, n = listed.system, listed.system.space.dimension
    grid = Grid(system.space, (13, 11)[:n] if n == 2 else (4, 3, 3, 3, 3, 3)[:n])
    actions, dt = action_grid(system, 3), 0.4
    regions = Regions.from_grid(system.space, (2,) + (None,) * (n - 1))
    moves = discretize(system, grid, actions, dt, regions).moves_of(np.arange(grid.size))
    rng, compared = np.random.default_rng(1), 0
    for cell in rng.choice(grid.size, 12, replace=False).tolist():
        action = int(rng.integers(len(actions)))
        motion = solve_ivp(
            lambda _, x, u=actions[action]: system.dynamics(x, u), (0, dt), grid.centers[cell],
            rtol=1e-10, atol=1e-12, max_step=dt / 40,
        )  # fmt: skip
        if not system.space.contains(motion.y.T).all():
            assert moves.successor[cell, action] == -1
            compared += 1
            continue
        # Neither integrator decides about a state that is as good as on a border between cells.
        ends = grid.index(motion.y[:, -1] + 1e-4 * grid.widths * np.array([[-1], [0], [1]]))
        if ends[0] == ends[1] == ends[2]:
            assert moves.successor[cell, action] == ends[1]
            compared += 1
    assert compared >= 6


@each
def test_a_tiny_inference_has_a_belief(listed: Listed) -> None:
    system, n = listed.system, listed.system.space.dimension
    bounds = system.space.bounds
    box = Box(0.7 * bounds.lower + 0.3 * bounds.upper, 0.3 * bounds.lower + 0.7 * bounds.upper)
    free = Box(np.full(n, -0.6) * bounds.widths, np.full(n, 0.6) * bounds.widths)
    trials = sample_trials(
        system, None, box, trials=3, seed=0, horizon=1.0, dt=0.1, restarts=1, goal_offsets=free
    )
    attempts = demonstrate(system, trials, None, None, dt=0.1, iterations=3)
    kept = [each.demonstration for each in attempts if each.outcome is Outcome.KEPT]
    assert kept
    hypotheses = Regions.from_grid(system.space, (3, 3) + (None,) * (n - 2))
    grid = Grid(system.space, (9, 9)[:n] if n == 2 else (3,) * n)
    model = discretize(system, grid, action_grid(system, 3), 0.5, hypotheses)
    inference = infer(model, kept)
    assert inference.reachable.all()  # any goal will do
    assert inference.posterior.sum() + inference.posterior_none == pytest.approx(1.0)
    assert np.all(inference.gain[~inference.violated.any(axis=0)] >= 0)


def test_every_system_is_listed() -> None:
    modules = {module.name for module in pkgutil.iter_modules(mlci.zoo.__path__)} - {"parts"}
    listed = {type(it.system).__module__.rpartition(".")[2] for it in LISTED.values()}
    assert modules | {"systems"} == listed
    assert {it.config for it in LISTED.values()} <= {f.stem for f in CONF.glob("system/*.yaml")}


@each
def test_its_class_is_short(listed: Listed) -> None:
    kind = type(listed.system)
    if kind.__module__.startswith("mlci.zoo"):
        (tree,) = ast.parse(inspect.getsource(kind)).body
        docstring = tree.body[0]
        lines = tree.end_lineno - tree.lineno - (docstring.end_lineno - docstring.lineno)
        assert lines < MOST_LINES


@pytest.mark.parametrize("kind", [type(it.system) for it in LISTED.values()])
@pytest.mark.parametrize("value", [0.0, np.inf])
def test_a_parameter_that_is_not_positive_is_refused(kind: type, value: float) -> None:
    if kind.__module__.startswith("mlci.zoo"):
        for name in kind.__dataclass_fields__:
            with pytest.raises(ValueError, match=rf"{kind.__name__}\.{name} must be positive"):
                kind(**{name: value})
