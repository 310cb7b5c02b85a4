"""Forming the tabular model, and log Z with the probability of entering each hypothesis.

What other packages offer of it: imitation has log Z and the expected visits of cells, irl-maxent
the policy without logarithms, quantecon the maximum in place of the log of a sum.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np

from mlci.grids import Grid
from mlci.maxent import TrajectoryDistribution
from mlci.regions import Regions
from mlci.spaces import Floats
from mlci.systems import Pendulum, TelescopingPendulum
from mlci.tabular import TabularModel, action_grid, discretize
from tests.benchmark import loops, plain
from tests.benchmark.contest import OURS, Contender, Contest, Work
from tests.benchmark.growth import Size, Torus, systems
from tests.benchmark.plain import Table, World
from tests.benchmark.timing import copy_rate, exp_seconds

_LOST = -1e4  # reward that keeps peers, who know no forbidden moves, from the cell of lost moves
_KINDS = (Pendulum, TelescopingPendulum, Torus)  # as `loops` numbers them


@dataclass(frozen=True, eq=False)
class PricedPlaces(Pendulum):
    """The pendulum with a reward of places alone, all that imitation and irl-maxent know.

    Nine actions cancel e^reward nearly, so that Z stays finite for who takes no logarithms.
    """

    def running_reward(self, states: Floats, controls: Floats) -> Floats:
        return -4 * np.log(9) - 0.4 * np.square(np.sin(states[..., 0])) + 0 * controls[..., 0]


def pendulum(system: Pendulum, goal: bool, steps: int = 20) -> World:
    """The paper's pendulum: 400 cells, 9 actions, 100 hypotheses."""
    grid = Grid(system.space, (20, 20))
    cells = grid.index([3.0, 0.0])[None] if goal else np.arange(grid.size)
    return World(
        "pendulum",
        system,
        grid,
        action_grid(system, 9),
        0.25,
        Regions.from_grid(system.space, (10, 10)),
        3,
        np.array([0.5, 0.0]),
        cells,
        steps,
    )


def _grown(size: Size, substeps: int) -> World:
    """A system, start and goal on which growth is measured, with 100 hypotheses."""
    system, start, goal = systems(size)
    grid = Grid(system.space, size.shape)
    return World(
        size.system,
        system,
        grid,
        action_grid(system, size.actions),
        size.dt,
        Regions.from_grid(system.space, (10, None, 10, None)),
        substeps,
        start,
        grid.cells_in(goal),
        size.steps,
    )


def telescope() -> World:
    """The paper's telescoping pendulum: 2500 cells, 15 actions, 100 hypotheses."""
    return _grown(Size(shape=(10, 5, 10, 5)), substeps=4)


def torus() -> World:
    """Four angles, 104 976 cells, most of which are active."""
    return _grown(Size("torus", (18,) * 4), substeps=3)


def size(world: World) -> str:
    """A world in words."""
    return (
        f"{world.name}, {world.grid.size} cells, {len(world.actions)} actions, "
        f"{len(world.regions)} hypotheses"
    )


def contests() -> Iterator[Contest]:
    """At the paper's two sizes, and at a hundred thousand cells."""
    for world in (pendulum(Pendulum(), True), telescope()):
        yield tabular_contest(world)
    for world in (pendulum(Pendulum(), True), telescope(), torus()):
        yield phi_contest(world)
    yield visits_contest(pendulum(PricedPlaces(), False))
    yield policy_contest(pendulum(PricedPlaces(), True, 800))


def tabular(world: World) -> TabularModel:
    """The project's tabular model, ready for inference."""
    model = discretize(world.system, world.grid, world.actions, world.dt, world.regions)
    _ = model.merged
    return model


def looped(world: World) -> Any:
    """Successors and kept regions by plain loops."""
    space = world.grid.space
    return loops.discretise(
        [isinstance(world.system, kind) for kind in _KINDS].index(True),
        world.grid.centers,
        world.actions,
        world.dt,
        world.substeps,
        np.stack([space.bounds.lower, space.bounds.upper]),
        space.periodic,
        np.array(world.grid.shape),
        *plain.corners_of(world.regions),
    )


@cache
def _tables(world: World) -> Table:
    """A plain table by plain loops, once."""
    successor, keeps = looped(world)
    return Table(successor, _reward(world), keeps == 0)


def _reward(world: World) -> Floats:
    """(S, A) rewards of moves."""
    centers = world.grid.centers[:, None]
    reward = world.system.running_reward(centers, world.actions[None]) * world.dt
    return np.ascontiguousarray(np.broadcast_to(reward, (world.grid.size, len(world.actions))))


def _ours(world: World, model: TabularModel) -> tuple[float, Floats]:
    """log Z and Phi of the task, from a model that other tasks have used."""
    distribution = TrajectoryDistribution(model, world.start_cell, world.goal, world.steps)
    phi = distribution.violation_probabilities()
    return float(distribution.log_z[0, world.start_cell]), phi


def _theirs(world: World, successor: Any, keeps: Any, reward: Floats) -> tuple[float, Floats]:
    """log Z and Phi of the task by plain loops."""
    log_z, phi = loops.log_z_and_phi(
        successor, reward, keeps, world.start_cell, world.goal, world.steps
    )
    return float(log_z[0, world.start_cell]), phi


def _difference(one: tuple[float, Floats], other: tuple[float, Floats]) -> float:
    """Largest difference of log Z and of Phi."""
    return float(max(abs(one[0] - other[0]), np.max(np.abs(one[1] - other[1]))))


def tabular_contest(world: World) -> Contest:
    """Who forms the tabular model; judged by log Z and Phi of a task on it."""
    reward = _reward(world)
    reference = _theirs(world, *looped(world), reward)
    steps = world.grid.size * len(world.actions) * world.substeps

    def ours() -> Work:
        return lambda: tabular(world)

    def plain_loops() -> Work:
        return lambda: looped(world)

    def student() -> Work:
        return lambda: plain.discretise(world)

    def floor(_: TabularModel) -> tuple[float, str]:
        return exp_seconds(4 * steps), "a sine for each rate, at exp's rate"

    return Contest(
        "tabular model",
        size(world),
        [
            Contender(OURS, ours),
            Contender(
                "plain compiled loops",
                plain_loops,
                error=lambda found: _difference(_theirs(world, *found, reward), reference),
            ),
            Contender(
                "plain numpy",
                student,
                error=lambda table: _difference(plain.log_z_and_phi(world, table), reference),
            ),
        ],
        lambda model: _difference(_ours(world, model), reference),
        1e-9,
        "difference of log Z, Phi",
        floor,
    )


def phi_contest(world: World) -> Contest:
    """Who finds log Z and Phi of all hypotheses, the tabular model given."""
    model, table = tabular(world), _tables(world)
    keeps = (~table.crosses).view(np.uint8)
    reference = _theirs(world, table.successor, keeps, table.reward)
    contenders = [
        Contender(OURS, lambda: lambda: _ours(world, model)),
        Contender(
            "plain compiled loops",
            lambda: lambda: _theirs(world, table.successor, keeps, table.reward),
        ),
    ]
    if world.grid.size < 10_000:
        contenders.append(
            Contender("plain numpy", lambda: lambda: plain.log_z_and_phi(world, table))
        )
    return Contest(
        "log Z and Phi",
        f"{size(world)}, {world.steps} steps",
        contenders,
        lambda found: _difference(found, reference),
        1e-9,
        "difference of log Z, Phi",
        lambda _: phi_floor(world, table),
    )


def phi_floor(world: World, table: Table) -> tuple[float, str]:
    """An exponential for each different move of a cell, and the traffic of alpha.

    Each step reads the row of alpha of each successor of each cell that carries probability, and
    writes the cell's own, at the rate of a copy whose arrays are as large as the rows of two steps.
    """
    log_z, _ = loops.log_z_and_phi(
        table.successor,
        table.reward,
        (~table.crosses).view(np.uint8),
        world.start_cell,
        world.goal,
        world.steps,
    )
    cells, moves = table.successor.shape
    cell = np.repeat(np.arange(cells), moves)
    kept = table.successor.ravel() < cells
    pairs = np.unique(cell[kept] * (cells + 1) + table.successor.ravel()[kept])
    packed = np.packbits(table.crosses.reshape(cells * moves, -1), axis=1)[kept]
    key = np.column_stack([cell[kept], table.successor.ravel()[kept]]).astype(np.int64)
    rows = np.concatenate([key.view(np.uint8).reshape(len(key), -1), packed], axis=1)
    different = np.unique(
        np.ascontiguousarray(rows).view(f"V{rows.shape[1]}").ravel(), return_index=True
    )[1]
    exps = np.bincount(cell[kept][different], minlength=cells)
    reads = np.bincount(pairs // (cells + 1), minlength=cells)
    active = log_z[:-1, :-1] > -np.inf
    count = int(np.sum(active @ exps))
    width = len(world.regions) * 8
    traffic = int(np.sum(active @ reads) + np.sum(active)) * width
    rate = copy_rate(max(1 << 12, int(np.max(active.sum(axis=1))) * width))
    return exp_seconds(count) + traffic / rate, "exponentials, traffic of alpha"


def visits_contest(world: World) -> Contest:
    """log Z with what is expected of each cell (peers) or of each hypothesis (this project)."""
    model, table = tabular(world), _tables(world)
    lost_too = np.append(world.goal, world.grid.size)  # peers count ways that leave at the end
    their_log_z = plain.log_partition(table, lost_too, world.steps)
    where = plain.visits(table, their_log_z, world.start_cell)
    keeps = (~table.crosses).view(np.uint8)
    reference = _theirs(world, table.successor, keeps, table.reward)

    def imitation() -> Work:
        from imitation.algorithms.mce_irl import mce_occupancy_measures, mce_partition_fh
        from seals.base_envs import TabularModelPOMDP

        dense, start = dense_transitions(table), np.zeros(world.grid.size + 1)
        start[world.start_cell] = 1.0
        reward = np.append(table.reward[:, 0], _LOST)
        env = TabularModelPOMDP(
            transition_matrix=dense,
            observation_matrix=np.eye(len(start)),
            reward_matrix=reward,
            horizon=world.steps,
            initial_state_dist=start,
        )

        def work() -> tuple[Floats, Floats]:
            values, _, policy = mce_partition_fh(env)
            return values[0], mce_occupancy_measures(env, pi=policy)[0]

        return work

    def of_visits(found: tuple[Floats, Floats]) -> float:
        """Difference of log Z and of visits."""
        values, visited = found
        return float(
            max(
                abs(values[world.start_cell] - their_log_z[0, world.start_cell]),
                np.max(np.abs(visited[:, :-1] - where)),
            )
        )

    return Contest(
        "log Z with Phi or visits",
        f"{size(world)}, {world.steps} steps, any goal",
        [
            Contender(f"{OURS}: log Z and Phi", lambda: lambda: _ours(world, model)),
            Contender("imitation: log Z and visits", imitation, error=of_visits),
            quantecon(world, table),
        ],
        lambda found: _difference(found, reference),
        1e-8,
        "difference of log Z, Phi or visits",
    )


def dense_transitions(table: Table) -> Floats:
    """(S+1, A, S+1), the last cell for moves that leave the grid."""
    cells, moves = table.successor.shape
    dense = np.zeros((cells + 1, moves, cells + 1))
    dense[np.arange(cells)[:, None], np.arange(moves), table.successor] = 1.0
    dense[cells, :, cells] = 1.0
    return dense


def quantecon(world: World, table: Table) -> Contender:
    """Backward induction with a maximum in place of the log of a sum: fewer terms, no Phi."""
    cells, moves = table.successor.shape

    def prepare() -> Work:
        from quantecon.markov import DiscreteDP, backward_induction
        from scipy import sparse

        rewards = np.append(table.reward.ravel(), np.zeros(1))
        columns = np.append(table.successor.ravel(), cells)
        count = len(columns)
        chances = sparse.csr_matrix((np.ones(count), columns, np.arange(count + 1)))
        state = np.append(np.repeat(np.arange(cells), moves), cells)
        action = np.append(np.tile(np.arange(moves), cells), 0)
        with warnings.catch_warnings():  # no discount: for a finite horizon it needs none
            warnings.simplefilter("ignore")
            problem = DiscreteDP(rewards, chances, 1.0, state, action)
        last = np.zeros(cells + 1)
        last[-1] = _LOST
        return lambda: backward_induction(problem, world.steps, last)[0]

    def error(values: Floats) -> float:
        expected = np.append(np.zeros(cells), _LOST)
        for _ in range(world.steps):
            expected[:cells] = np.max(table.reward + expected[table.successor], axis=1)
        return float(np.max(np.abs(values[0] - expected)))

    return Contender("quantecon: maximum, no Phi", prepare, error=error)


def policy_contest(world: World) -> Contest:
    """log Z over the steps that irl-maxent takes, twice the cells, and the first policy."""
    model, table = tabular(world), _tables(world)
    log_z = plain.log_partition(table, world.goal, world.steps)
    first = np.exp(table.reward + log_z[1, table.successor] - log_z[0, : world.grid.size, None])[
        world.start_cell
    ]

    def ours() -> Work:
        def work() -> Floats:
            task = TrajectoryDistribution(model, world.start_cell, world.goal, world.steps)
            cells, policy = task.policy(0)
            assert cells.tolist() == [world.start_cell]
            return policy[0]

        return work

    def irl_maxent() -> Work:
        from irl_maxent.maxent import local_action_probabilities

        transitions = np.ascontiguousarray(dense_transitions(table)[:-1, :, :-1].transpose(0, 2, 1))
        reward = table.reward[:, 0]
        return lambda: local_action_probabilities(transitions, world.goal, reward)[world.start_cell]

    return Contest(
        "log Z and first policy",
        f"{size(replace(world))}, {world.steps} steps",
        [Contender(OURS, ours), Contender("irl-maxent", irl_maxent)],
        lambda policy: float(np.max(np.abs(policy - first))),
        1e-9,
        "difference of the policy",
    )
