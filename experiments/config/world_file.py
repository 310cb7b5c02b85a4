"""The file of a finite world, read and checked: its table, and what its states are called."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from experiments.config.problems import ConfigError, checked
from experiments.config.settings.world import WorldSettings, names_of
from mlci.recordings.moves import Moves, read_moves
from mlci.recordings.rows import canonical, number_of
from mlci.worlds.tables import Table, TableRegion


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
    path = Path(file).expanduser()
    try:
        tree = yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: byte {error.start} is not UTF-8") from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        raise ConfigError(f"{file}{line}: not valid YAML") from None
    if not isinstance(tree, dict):
        raise ConfigError(f"{file}: holds no keys with values, such as moves: moves.csv")
    try:
        settings = checked(WorldSettings, tree)
    except ConfigError as error:
        raise ConfigError("\n".join(f"{file}: {line}" for line in str(error).split("\n"))) from None
    try:
        moves = read_moves(
            path.parent / settings.moves, names_of(settings.states), names_of(settings.actions)
        )
    except ValueError as error:
        raise ConfigError(f"{path.parent / settings.moves}: {error}") from None
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
    begins: Any = np.zeros(len(moves.states))
    if isinstance(settings.start, str):
        begins = state(settings.start, "start")
    else:
        for name, probability in settings.start.items():
            begins[state(name, "start")] += probability
    table = Table.from_arrays(
        moves.transitions,
        reward / settings.temperature,
        begins,
        [state(name, "goals") for name in settings.goal_names],
    )
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
    yield from single
    taken = dict(single)
    for name, one in sets.items():
        where = f"hypotheses.sets.{name}"
        if name in taken:
            raise ValueError(f"{where}: a hypothesis of `each` has this name; take another")
        if not (one.states or one.actions or one.moves):
            raise ValueError(f"{where}: forbids nothing; give states, actions or moves")
        yield (
            name,
            TableRegion(
                [state(each_state, where) for each_state in one.states],
                [action(each_action, where) for each_action in one.actions],
                [(state(s, where), action(a, where)) for s, a in one.moves],
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
