"""Recorded paths of a finite world: files with a row a step, columns `state` and `action`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mlci.recordings.columns import TRIALS
from mlci.recordings.files import find_files
from mlci.recordings.recording import Remark, shown_path
from mlci.recordings.rows import Rows, canonical, number_of, read_rows
from mlci.recordings.table import Unusable
from mlci.worlds.tables import Table, TablePath


class TableReadings(NamedTuple):
    """What came of reading files: paths, and what was wrong."""

    paths: list[TablePath]
    problems: list[Remark]


@dataclass(frozen=True)
class _Named:
    """A table, the names of its states and actions, their numbers, and the horizon."""

    table: Table
    states: Sequence[str]
    actions: Sequence[str]
    state_numbers: Mapping[str, int]
    action_numbers: Mapping[str, int]
    steps: int | None


def read_table_paths(
    paths: str | Path | Sequence[str | Path],
    table: Table,
    states: Sequence[str] = (),
    actions: Sequence[str] = (),
    steps: int | None = None,
) -> TableReadings:
    """Read paths; one that cannot be used does not stop the others.

    Args:
        paths: a folder, a glob pattern or a file, or several of them. Files are of text with a line
            of names, then a row a step: the `state`, and the `action` taken there. The last row of
            a path has no action; where moves are certain it may have one, and the state that
            follows is added. A column `trial` names paths of one file, else a file is a path.
        table: the world.
        states: (S,) names of its states; their numbers by default.
        actions: (A,) names of its actions; their numbers by default.
        steps: number of moves of every path, at most where the table has goals; None is any.

    Returns:
        The paths in the order of the files, each named after its file and trial; and what was
        wrong with the rest, by line.
    """
    of_states = tuple(states) or tuple(map(str, range(table.states)))
    of_actions = tuple(actions) or tuple(map(str, range(table.actions)))
    named = _Named(
        table,
        of_states,
        of_actions,
        number_of(of_states, "states"),
        number_of(of_actions, "actions"),
        steps,
    )
    files, problems = find_files([paths] if isinstance(paths, str | Path) else paths)
    found: list[TablePath] = []
    for file in files:
        shown, stem = shown_path(file), shown_path(Path(file.stem))
        try:
            rows = read_rows(file, ("state", "action"), TRIALS)
            trials = _trials(rows)
        except ValueError as error:
            problems.append(Remark(shown, str(error)))
            continue
        for trial, members in trials.items():
            title = f"{stem}_{trial}" if trial else stem
            try:
                found.append(_path(title, rows, members, named))
            except ValueError as error:
                problems.append(Remark(f"{shown}, trial {trial}" if trial else shown, str(error)))
    return TableReadings(found, problems)


def _trials(rows: Rows) -> dict[str, list[int]]:
    """The rows of each path, by the name of its trial."""
    column = next((rows.columns[name] for name in TRIALS if name in rows.columns), None)
    if not rows.lines:
        raise Unusable("has no step below its header")
    if column is None:
        return {"": list(range(len(rows.lines)))}
    trials: dict[str, list[int]] = {}
    for i, name in enumerate(column):
        if not name:
            raise Unusable(f"line {rows.lines[i]}: the trial has no name")
        trials.setdefault(name, []).append(i)
    return trials


def _path(title: str, rows: Rows, members: Sequence[int], named: _Named) -> TablePath:
    """A path from its rows, checked to be one of the table's."""
    lines, entries = [rows.lines[i] for i in members], rows.columns["action"]
    if lacking := [i for i in members[:-1] if not entries[i]]:
        raise Unusable(
            f"line {rows.lines[lacking[0]]}: has no action; only the last row of a path may lack it"
        )
    states = [_number(rows, "state", i, named.states, named.state_numbers) for i in members]
    done = [i for i in members if entries[i]]
    actions = [_number(rows, "action", i, named.actions, named.action_numbers) for i in done]
    if not actions:
        raise Unusable(f"line {lines[0]}: the path has no action")
    if not named.table.start[states[0]] > 0:
        raise Unusable(
            f"line {lines[0]}: the path begins in state {named.states[states[0]]!r}, where the "
            "world does not"
        )
    for k, (state, action) in enumerate(zip(states, actions, strict=False)):
        where = f"action {named.actions[action]!r} in state {named.states[state]!r}"
        following = states[k + 1] if k + 1 < len(states) else None
        try:
            end = _successor(state, action, following, named)
        except ValueError as error:
            raise Unusable(f"line {lines[k]}: {where} {error}") from None
    if len(actions) == len(states):
        states.append(end)
    _refuse_wrong_end(states, lines[-1], named)
    return TablePath(np.array(states), np.array(actions), title)


def _number(
    rows: Rows, column: str, row: int, names: Sequence[str], numbers: Mapping[str, int]
) -> int:
    """The number of a name in a file."""
    entry = rows.columns[column][row]
    if canonical(entry) not in numbers:
        some = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
        raise Unusable(f"line {rows.lines[row]}: there is no {column} {entry!r}; there are {some}")
    return numbers[canonical(entry)]


def _successor(state: int, action: int, following: int | None, named: _Named) -> int:
    """The state that follows a move; None where the file does not tell it.

    Raises:
        ValueError: a move that the world does not have, or that it leaves to chance.
    """
    table = named.table
    _, possible = table.transitions[state * table.actions + action].nonzero()
    if state in table.goals:
        raise ValueError("goes on from a goal, where a path ends")
    if not table.allowed[state, action]:
        raise ValueError("is no move of the world")
    if following is None and len(possible) > 1:
        raise ValueError("leads where chance decides; add a row with that state and no action")
    if following is not None and following not in possible:
        raise ValueError(f"never leads to state {named.states[following]!r}, which follows")
    return int(possible[0]) if following is None else following


def _refuse_wrong_end(states: Sequence[int], line: int, named: _Named) -> None:
    """Refuse a path that is too long or too short, or that does not end where it must."""
    table, steps = named.table, named.steps
    moves, at_goal = len(states) - 1, states[-1] in table.goals
    if steps is not None and (moves > steps or (moves < steps and not at_goal)):
        raise Unusable(f"line {line}: the path has {moves} moves, and the horizon is {steps}")
    if steps is None and len(table.goals) and not at_goal:
        goals = ", ".join(repr(named.states[goal]) for goal in table.goals[:8].tolist())
        raise Unusable(
            f"line {line}: the path ends in state {named.states[states[-1]]!r}, which is no goal; "
            f"goals are {goals}"
        )
