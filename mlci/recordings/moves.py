"""The moves of a finite world from a file: a table of text, or arrays of numpy.

A table of text has a row for each move, or for each state that may follow a move: columns `state`,
`action`, `next`, and where they matter `probability` and `reward`. So transitions are listed by
Gymnasium's toy worlds (`P[state][action]` holds probability, next state and reward) and by the
explicit files of the model checker PRISM.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.recordings.rows import Rows, canonical, number_of, read_rows
from mlci.recordings.table import Unusable
from mlci.spaces import Floats, Ints
from mlci.worlds.transitions import MOST_MOVES, WRITTEN, as_transitions


@dataclass(frozen=True, eq=False)
class Moves:
    """What can be done in a world, and what follows.

    Attributes:
        states: (S,) names of the states.
        actions: (A,) names of the actions.
        transitions: (S * A, S) sparse probabilities, as `Table.from_arrays` takes them.
        reward: (S, A) of each move; None where the file has none.
    """

    states: tuple[str, ...]
    actions: tuple[str, ...]
    transitions: scipy.sparse.csr_matrix
    reward: Floats | None


def read_moves(file: str | Path, states: Sequence[str] = (), actions: Sequence[str] = ()) -> Moves:
    """Read moves by the file's suffix.

    Args:
        file: text with columns `state`, `action`, `next` and perhaps `probability` and `reward`;
            or `.npz` with an array `successor` (S, A), -1 where there is no move, or `transitions`
            (S, A, S), and perhaps `reward`, which broadcasts to (S, A); or a sparse (S * A, S) as
            `scipy.sparse.save_npz` writes it.
        states: names of all states, in order. Without them those of the file count: whole numbers
            by size, others in order of their first row.
        actions: names of all actions, likewise.

    Raises:
        ValueError: what is wrong with the file, and in which line.
    """
    path = Path(file)
    if path.suffix.lower() == ".npz":
        return _of_arrays(path, states, actions)
    rows = read_rows(path, ("state", "action", "next"), ("probability", "reward"))
    if not rows.lines:
        raise Unusable("has no move below its header")
    columns = rows.columns
    for name in ("state", "action", "next"):
        if "" in columns[name]:
            line = rows.lines[columns[name].index("")]
            raise Unusable(f"line {line}: {name} is empty")
    pairs = [each for pair in zip(columns["state"], columns["next"], strict=True) for each in pair]
    state_names = tuple(states) or _in_order(pairs)
    action_names = tuple(actions) or _in_order(columns["action"])
    state = _numbers(rows, "state", state_names, "state")
    action = _numbers(rows, "action", action_names, "action")
    following = _numbers(rows, "next", state_names, "state")
    row = state * len(action_names) + action
    chance = _floats(rows, "probability") if "probability" in columns else np.ones(len(row))
    shape = len(state_names) * len(action_names), len(state_names)
    if shape[0] > MOST_MOVES:
        raise Unusable(
            f"{len(state_names)} states of {len(action_names)} actions take too much memory: use "
            "names of actions again, where they are taken in other states"
        )
    _refuse_repetition(rows, row, following)
    _refuse_wrong_sum(rows, row, chance)
    reward = None
    if "reward" in columns:
        reward = _rewards(rows, row, (len(state_names), len(action_names)))
    transitions = as_transitions(scipy.sparse.csr_matrix((chance, (row, following)), shape=shape))
    return Moves(state_names, action_names, transitions, reward)


def _of_arrays(file: Path, states: Sequence[str], actions: Sequence[str]) -> Moves:
    """The moves of an .npz file."""
    if file.exists() and not file.is_file():
        raise Unusable("is not a file")
    try:
        with np.load(file, allow_pickle=False) as arrays:
            content = {name: arrays[name] for name in arrays.files}
        sparse = scipy.sparse.load_npz(file) if {"data", "format"} <= content.keys() else None
    except FileNotFoundError:
        raise Unusable("there is no such file") from None
    except Exception as error:  # whatever numpy makes of a damaged file
        raise Unusable(f"is damaged, or no .npz file ({error})") from None
    given = [name for name in ("successor", "transitions") if name in content]
    if sparse is None and len(given) != 1:
        raise Unusable(
            "needs an array successor (S, A), or transitions (S, A, S); it holds "
            f"{', '.join(content) or 'nothing'}"
        )
    transitions = as_transitions(content[given[0]] if sparse is None else sparse)
    count = transitions.shape[1]
    shape = count, transitions.shape[0] // count
    names = []
    for given_names, size, what in ((states, shape[0], "states"), (actions, shape[1], "actions")):
        if given_names and len(given_names) != size:
            raise Unusable(f"has {size} {what}, and {len(given_names)} are named")
        names.append(tuple(given_names) or tuple(map(str, range(size))))
    reward = content.get("reward")
    if reward is not None:
        if reward.dtype.kind not in "biuf":
            raise Unusable(f"has a reward of {reward.dtype}, not of numbers")
        try:
            reward = np.broadcast_to(np.asarray(reward, dtype=float), shape).copy()
        except ValueError:
            raise Unusable(f"has a reward {reward.shape} that does not suit {shape}") from None
    return Moves(names[0], names[1], transitions, reward)


def _in_order(names: Sequence[str]) -> tuple[str, ...]:
    """Different names: whole numbers by size, others in order of appearance."""
    different = list(dict.fromkeys(map(canonical, names)))
    if all(name.removeprefix("-").isdigit() for name in different):
        return tuple(sorted(different, key=int))
    first = {canonical(name): name for name in reversed(names)}
    return tuple(first[name] for name in different)


def _numbers(rows: Rows, column: str, names: Sequence[str], what: str) -> Ints:
    """(R,) numbers of a column's names."""
    numbers = number_of(names, f"{what}s")
    found = np.array([numbers.get(canonical(name), -1) for name in rows.columns[column]])
    if len(lost := np.flatnonzero(found < 0)):
        entry = rows.columns[column][lost[0]]
        raise Unusable(
            f"line {rows.lines[lost[0]]}: there is no {what} {entry!r} among the {len(names)} that "
            "are named"
        )
    return found.astype(np.int64)


def _floats(rows: Rows, column: str) -> Floats:
    """(R,) numbers of a column."""
    values = np.empty(len(rows.lines))
    for i, entry in enumerate(rows.columns[column]):
        try:
            values[i] = float(entry)
        except ValueError:
            values[i] = np.nan
        if not np.isfinite(values[i]):
            raise Unusable(f"line {rows.lines[i]}: {column} {entry!r} is not a finite number")
    return values


def _refuse_repetition(rows: Rows, row: Ints, following: Ints) -> None:
    """Refuse a second row of the same move and next state."""
    _, first, copies = np.unique(
        np.stack([row, following]), axis=1, return_index=True, return_inverse=True
    )
    again = np.flatnonzero(first[copies.ravel()] != np.arange(len(row)))
    if len(again):
        line, before = rows.lines[again[0]], rows.lines[first[copies.ravel()[again[0]]]]
        raise Unusable(f"line {line} tells the same move to the same state as line {before}")


def _refuse_wrong_sum(rows: Rows, row: Ints, chance: Floats) -> None:
    """Refuse moves whose probabilities do not add up to 1."""
    total = np.bincount(row, weights=chance)[row]
    if len(negative := np.flatnonzero(chance < 0)):
        entry = rows.columns["probability"][negative[0]]
        raise Unusable(f"line {rows.lines[negative[0]]}: probability {entry} is negative")
    if len(wrong := np.flatnonzero(np.abs(total - 1) > WRITTEN)):
        i = wrong[0]
        move = f"{rows.columns['action'][i]!r} in state {rows.columns['state'][i]!r}"
        raise Unusable(
            f"line {rows.lines[i]}: probabilities of what follows action {move} add up to "
            f"{total[i]:.9g}, not 1"
            + ("; a column probability tells them" if "probability" not in rows.columns else "")
        )


def _rewards(rows: Rows, row: Ints, shape: tuple[int, int]) -> Floats:
    """(S, A) of moves; 0 where there is no move."""
    values, reward = _floats(rows, "reward"), np.zeros(shape)
    reward.ravel()[row] = values
    if len(odd := np.flatnonzero(reward.ravel()[row] != values)):
        raise Unusable(
            f"line {rows.lines[odd[0]]}: rewards of one move differ; a reward is of state and "
            "action, so write their mean by probability"
        )
    return reward
