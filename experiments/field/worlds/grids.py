"""Worlds on a grid: eight moves, one start, one goal, states that are forbidden.

A hard constraint forbids moves that are meant to lead into a forbidden state. Where moves slip, it
forbids no slip: whoever slips in has broken nothing, and goes on from there.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from experiments.field.entries import Case
from mlci.rivals.agent import Agent
from mlci.rivals.problem import Beside, Problem, Shown
from mlci.spaces import Floats, Ints
from mlci.worlds.fixed_horizon import FixedHorizon
from mlci.worlds.tables import Table, TablePath, TableRegion

# Row and column of the eight moves.
MOVES = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j])


def successors(shape: tuple[int, int]) -> Ints:
    """(S, 8) where each move is meant to lead; -1 off the grid."""
    place = np.stack(np.unravel_index(np.arange(np.prod(shape)), shape), axis=-1)[:, None] + MOVES
    on_grid = np.all((place >= 0) & (place < shape), axis=-1)
    return np.where(on_grid, place[..., 0] * shape[1] + place[..., 1], -1)


def slippery(meant: Ints, slip: float) -> Floats:
    """(S, A, S) chances of moves that with a probability `slip` become any of all, itself included.

    Moves off the grid are no moves; of a slip that would leave it the others take the share.
    """
    states, actions = meant.shape
    chances = np.zeros((states, actions, states))
    for s in range(states):
        on_grid = np.flatnonzero(meant[s] >= 0)
        for a in on_grid:
            share = np.full(len(on_grid), slip / actions)
            share[on_grid == a] += 1 - slip
            np.add.at(chances[s, a], meant[s, on_grid], share / np.sum(share))
    return chances


def entering(meant: Ints, hypotheses: Iterable[Ints]) -> dict[str, TableRegion]:
    """Hypotheses, each of some states: the moves that are meant to lead into them."""
    return {
        f"{number}": TableRegion(
            moves=[(int(s), int(a)) for s, a in np.argwhere(np.isin(meant, states))]
        )
        for number, states in enumerate(hypotheses)
    }


def certain_avoidance(table: Table, steps: int) -> Beside:
    """log alpha of sets for the one start of a table whose moves are certain."""
    distribution, start = FixedHorizon(table, steps), int(np.argmax(table.start))
    return lambda mask: distribution.log_avoidance_beside(start, mask)


def violates(table: Table, path: TablePath) -> np.ndarray:
    """(C,) the hypotheses that some move of a path belongs to."""
    return (
        np.asarray(table.crosses[path.states[:-1] * table.actions + path.actions].sum(0)).ravel()
        > 0
    )


def grid_case(
    agent: Agent, shape: tuple[int, int], forbidden: Iterable[int], seed: int, count: int
) -> Case:
    """Demonstrations of an agent under the truth, where each state is a hypothesis.

    Args:
        agent: without a constraint.
        shape: rows and columns.
        forbidden: the states that are so.
        seed: of the demonstrations.
        count: how many.
    """
    states = agent.table.states
    truth = np.isin(np.arange(states), list(forbidden))
    paths = agent.under(truth).sample(count, np.random.default_rng(seed))
    beside = certain_avoidance(agent.table, agent.steps) if agent.is_certain else None
    shown = tuple(
        Shown(agent, path.states, path.actions, violates(agent.table, path), beside)
        for path in paths
    )
    places = np.stack(np.unravel_index(np.arange(states), shape), axis=-1).astype(float)
    problem = Problem(shown, shape, np.eye(states, dtype=bool), places)
    forbidden_moves = np.asarray(agent.table.crosses @ truth > 0)
    return Case(problem, truth.astype(float), forbidden_moves)
