"""The file of a finite world, read and checked: its table, and what its states are called."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.config.memory import machine_memory
from experiments.config.problems import ConfigError, checked
from experiments.config.settings.world import WorldSettings, names_of
from experiments.config.yaml_text import read_yaml
from mlci.recordings.moves import Moves, read_moves
from mlci.recordings.recording import shown_path
from mlci.recordings.rows import canonical, number_of
from mlci.worlds.causal_entropy import states_without_goal
from mlci.worlds.first_exit import FirstExit
from mlci.worlds.inference import is_certain
from mlci.worlds.tables import Table, TableRegion
from mlci.worlds.transitions import WRITTEN

_BYTES_A_STEP = 24  # and state: log Z or values, and copies while they are read


@dataclass(frozen=True, eq=False)
class World:
    """A finite world, as its files tell it.

    Attributes:
        table: with its hypotheses.
        states: (S,) names of the states.
        actions: (A,) names of the actions.
        horizon: number of moves of a path; None is any.
        discount: what a reward one step later counts.
        temperature: what rewards were divided by.
    """

    table: Table
    states: tuple[str, ...]
    actions: tuple[str, ...]
    horizon: int | None
    discount: float
    temperature: float


def read_world(file: str | Path) -> World:
    """Read the file of a world, and the file of moves that it names.

    Raises:
        ConfigError: what is wrong, in which file.
    """
    tree = read_yaml(file)
    if not isinstance(tree, dict):
        raise ConfigError(f"{file}: holds no keys with values, such as moves: moves.csv")
    try:
        settings = checked(WorldSettings, tree)
    except ConfigError as error:
        raise ConfigError("\n".join(f"{file}: {line}" for line in str(error).split("\n"))) from None
    table = Path(file).expanduser().parent / settings.moves
    try:
        moves = read_moves(table, names_of(settings.states), names_of(settings.actions))
    except ValueError as error:
        raise ConfigError(f"{shown_path(table)}: {error}") from None
    try:
        return _world(settings, moves)
    except ValueError as error:
        raise ConfigError(f"{file}: {error}") from None


def _world(settings: WorldSettings, moves: Moves) -> World:
    """The world of checked settings.

    Raises:
        ValueError: names that nothing has, or what `Table.from_arrays` refuses.
    """
    state = _finder(moves.states, "state")
    action = _finder(moves.actions, "action")
    if (settings.reward is None) == (moves.reward is None):
        raise ValueError(
            f"reward: give one of all moves here, or rewards in {settings.moves}, and not both"
        )
    reward = np.float64(settings.reward) if moves.reward is None else moves.reward
    with np.errstate(over="ignore"):  # refused below, as too large
        rewards = reward / settings.temperature
    begins = np.zeros(len(moves.states))
    given = {settings.start: 1.0} if isinstance(settings.start, str) else settings.start
    for name, probability in given.items():
        begins[state(name, "start")] += probability
    if not abs(float(np.sum(begins)) - 1) <= WRITTEN:
        raise ValueError(
            f"start: probabilities must add up to 1, not {np.sum(begins):.9g}; write a state, or "
            "{state: probability, ...}"
        )
    table = Table.from_arrays(
        moves.transitions,
        rewards,
        begins,
        [state(name, "goals") for name in settings.goal_names],
    )
    _refuse_endless(settings, moves, table)
    regions = dict(_regions(settings, moves, table, state, action))
    if not regions:
        raise ValueError("hypotheses: there are none; give each: [states], or sets")
    return World(
        Table.from_arrays(moves.transitions, table.reward, begins, table.goals, regions),
        moves.states,
        moves.actions,
        settings.horizon,
        settings.discount,
        settings.temperature,
    )


def _refuse_endless(settings: WorldSettings, moves: Moves, table: Table) -> None:
    """Refuse a world in which paths of any length cannot end, and one of too many steps.

    Raises:
        ValueError: what is wrong.
    """
    steps = settings.horizon or 0
    if (memory := steps * table.states * _BYTES_A_STEP) > machine_memory():
        raise ValueError(
            f"horizon: {steps} moves among {table.states} states take about {memory / 1e9:.3g} GB, "
            f"more than the {machine_memory() / 1e9:.3g} GB of this machine; take fewer, or null"
        )
    if steps or settings.discount < 1:
        return
    if not len(table.goals):
        raise ValueError("goals: there are none, so that no path ends; give goals, or a horizon")
    if is_certain(table):
        lost = np.flatnonzero(table.start) if FirstExit(table).hopeless else np.array([], dtype=int)
    else:
        lost = states_without_goal(table)
    if len(lost):
        some = ", ".join(repr(moves.states[i]) for i in lost[:8]) + ", ..." * (len(lost) > 8)
        raise ValueError(
            f"goals: none can be reached from state {some}, where the start leads; give other "
            "goals, or a horizon"
        )


def _regions(
    settings: WorldSettings,
    moves: Moves,
    table: Table,
    state: Callable[[str, str], int],
    action: Callable[[str, str], int],
) -> Iterator[tuple[str, TableRegion]]:
    """The hypotheses by name: each state, each action, each move, then the named ones."""
    each, sets = settings.hypotheses.each, settings.hypotheses.sets
    single: list[tuple[str, TableRegion]] = []
    if "states" in each:
        single += [(f"state {n}", TableRegion(states=[i])) for i, n in enumerate(moves.states)]
    if "actions" in each:
        single += [(f"action {n}", TableRegion(actions=[i])) for i, n in enumerate(moves.actions)]
    if "moves" in each:
        single += [
            (f"{moves.actions[a]} in {moves.states[s]}", TableRegion(moves=[(s, a)]))
            for s, a in np.argwhere(table.allowed).tolist()
        ]
    taken = dict(single)
    yield from taken.items()
    for name, one in sets.items():
        where = f"hypotheses.sets.{name}"
        if name in taken:
            raise ValueError(f"{where}: a hypothesis of `each` has this name; take another")
        if not (one.states or one.actions or one.moves):
            raise ValueError(f"{where}: forbids nothing; give states, actions or moves")
        pairs = [(state(s, where), action(a, where)) for s, a in one.moves]
        for (s, a), (state_name, action_name) in zip(pairs, one.moves, strict=True):
            if not table.allowed[s, a]:
                raise ValueError(f"{where}: there is no move {action_name!r} in {state_name!r}")
        yield (
            name,
            TableRegion(
                [state(each_state, where) for each_state in one.states],
                [action(each_action, where) for each_action in one.actions],
                pairs,
            ),
        )


def _finder(names: Sequence[str], what: str) -> Callable[[str, str], int]:
    """A function from a name, and the key that it stands at, to its number."""
    numbers = number_of(names, f"{what}s")

    def find(name: str, key: str) -> int:
        if canonical(name) not in numbers:
            some = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
            raise ValueError(f"{key}: there is no {what} {name!r}; there are {some}")
        return numbers[canonical(name)]

    return find
