"""Finite worlds from arrays: states and actions that have numbers, not positions.

`mlci.tabular` forms its arrays from a continuous system; here they are given. Trajectories of a
table whose moves are certain have the distributions of `mlci.worlds.first_exit`; where chance
decides what follows a move, the model is `mlci.worlds.causal_entropy`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy  # loads scipy.sparse when it is first used
from numpy.typing import ArrayLike

from mlci.regions import as_mask
from mlci.spaces import Bools, Floats, Ints
from mlci.worlds.transitions import ROUNDING, WRITTEN, as_transitions, in_range

_LARGEST_REWARD = 1e9  # [nat] whose sums are right to about 1e-6


@dataclass(frozen=True)
class TableRegion:
    """What can be forbidden in a table: the moves that any of the three names.

    Attributes:
        states: every move into or out of these states, if only by chance.
        actions: every move by these actions.
        moves: pairs of a state and an action.
    """

    states: Sequence[int] = ()
    actions: Sequence[int] = ()
    moves: Sequence[tuple[int, int]] = ()


@dataclass(frozen=True, eq=False)
class TablePath:
    """A path that somebody took through a table.

    Attributes:
        states: (K+1,) where it was.
        actions: (K,) what was done there.
        name: what tables and messages call it.

    Raises:
        ValueError: not one state more than actions.
    """

    states: Ints
    actions: Ints
    name: str = ""

    def __post_init__(self) -> None:
        for name in ("states", "actions"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.int64))
        if self.states.ndim != 1 or self.states.shape != (self.actions.size + 1,):
            raise ValueError(
                f"a path of {self.actions.size} actions needs one state more, "
                f"not {self.states.shape}"
            )

    @property
    def title(self) -> str:
        """Its name in a message."""
        return f"path {self.name!r}" if self.name else "a path"


@dataclass(frozen=True, eq=False)
class Table:
    """A finite Markov decision process of S states and A actions; `from_arrays` makes it.

    Attributes:
        transitions: (S * A, S) sparse: row s * A + a holds the probabilities of what follows action
            a in state s, and is empty where there is no such move.
        reward: (S, A) of a move, divided by the temperature [nat].
        allowed: (S, A) whether a move may be taken.
        start: (S,) probability of beginning in each state.
        goals: (G,) states that end a trajectory; no move leaves them.
        regions: the C hypotheses by name.
        crosses: (S * A, C) sparse boolean: the regions that each move belongs to.
        truth: (C,) mask of the regions that no move may belong to, see `under`.
    """

    transitions: scipy.sparse.csr_matrix
    reward: Floats
    allowed: Bools
    start: Floats
    goals: Ints
    regions: Mapping[str, TableRegion]
    crosses: scipy.sparse.csr_matrix
    truth: Bools

    @classmethod
    def from_arrays(
        cls,
        transitions: ArrayLike | scipy.sparse.csr_matrix,
        reward: ArrayLike,
        start: int | ArrayLike,
        goals: int | Iterable[int] = (),
        regions: Mapping[str, TableRegion] | None = None,
    ) -> Table:
        """A table of any origin.

        Args:
            transitions: (S, A) whole numbers, the successor of each move, -1 where there is none;
                or probabilities (S, A, S), or sparse (S * A, S), whose rows add up to 1, or to 0
                where there is no move.
            reward: what broadcasts to (S, A), such as rewards of states (S, 1) [nat].
            start: a state, or probabilities (S,).
            goals: states that end a trajectory.
            regions: hypotheses by name.

        Raises:
            ValueError: shapes that disagree, states or actions that do not exist, probabilities
                that are negative or do not add up, or rewards that are not finite.
        """
        chances = as_transitions(transitions)
        states = chances.shape[1]
        shape = states, chances.shape[0] // states
        rewards = np.array(np.broadcast_to(np.asarray(reward, dtype=float), shape))
        there = np.diff(chances.indptr).reshape(shape) > 0
        if not np.all(fine := np.abs(rewards[there]) <= _LARGEST_REWARD):
            raise ValueError(
                f"rewards over temperature must lie within {_LARGEST_REWARD:g} nat, so that their "
                f"sums keep their digits; one is {rewards[there][~fine][0]:g}"
            )
        listed = list(goals) if isinstance(goals, Iterable) else [goals]
        ends = in_range(listed, states, "goals")
        there[ends] = False
        named = dict(regions or {})
        return cls(
            transitions=chances,
            reward=rewards,
            allowed=there,
            start=_distribution(start, states),
            goals=np.unique(ends),
            regions=named,
            crosses=_crossings(chances, list(named.values())),
            truth=np.zeros(len(named), dtype=bool),
        )

    @property
    def states(self) -> int:
        """S, the number of states."""
        return int(self.reward.shape[0])

    @property
    def actions(self) -> int:
        """A, the number of actions."""
        return int(self.reward.shape[1])

    @cached_property
    def successor(self) -> Ints:
        """(S, A) state after a move; -1 where there is none.

        Raises:
            ValueError: chance decides what follows some move.
        """
        count = np.diff(self.transitions.indptr)
        if count.max(initial=0) > 1:
            state, action = divmod(int(np.argmax(count)), self.actions)
            raise ValueError(
                f"chance decides what follows action {action} in state {state}: trajectories of "
                "such a table are for mlci.worlds.causal_entropy"
            )
        successor = np.full(count.shape, -1, dtype=np.int64)
        successor[count > 0] = self.transitions.indices
        return successor.reshape(self.reward.shape)

    def mask(self, names: Iterable[str]) -> Bools:
        """(C,) mask of the regions with some names.

        Raises:
            ValueError: a name that no region has.
        """
        chosen, known = set(names), list(self.regions)
        if unknown := chosen.difference(known):
            raise ValueError(f"no region is called {', '.join(sorted(unknown))}; there are {known}")
        return np.isin(known, list(chosen))

    def under(self, truth: ArrayLike) -> Table:
        """The table under constraints: moves that belong to the regions of a mask are not allowed.

        Args:
            truth: (C,) mask over the regions, such as `table.mask(["action 5"])`.
        """
        mask = as_mask(truth, len(self.regions))
        belongs = self.crosses @ mask > 0
        allowed = self.allowed & ~belongs.reshape(self.allowed.shape)
        return replace(self, allowed=allowed, truth=self.truth | mask)

    def path(self, start: int, actions: ArrayLike, name: str = "") -> TablePath:
        """The path that some actions (K,) lead along.

        Raises:
            ValueError: an action that may not be taken, or a table of chance.
        """
        states = [start]
        for action in np.asarray(actions, dtype=np.int64):
            if not self.allowed[states[-1], action]:
                raise ValueError(f"action {action} may not be taken in state {states[-1]}")
            states.append(int(self.successor[states[-1], action]))
        return TablePath(np.array(states), np.asarray(actions), name)

    def moves_of(self, path: TablePath) -> Ints:
        """(K,) rows s * A + a of the moves of a path.

        Raises:
            ValueError: a state or an action that does not exist, a move that may not be taken, or
                one that does not lead to the state that follows.
        """
        in_range(path.states, self.states, f"states of {path.title}")
        in_range(path.actions, self.actions, f"actions of {path.title}")
        rows = path.states[:-1] * self.actions + path.actions
        leads = np.asarray(self.transitions[rows, path.states[1:]]).ravel() > 0
        if not np.all(may := self.allowed.ravel()[rows] & leads):
            k = int(np.argmin(may))
            raise ValueError(
                f"{path.title}, step {k}: the table has no move by action {path.actions[k]} from "
                f"state {path.states[k]} to {path.states[k + 1]}"
            )
        return np.asarray(rows)

    def crossed_by(self, path: TablePath) -> Bools:
        """(C,) the regions that some move of a path belongs to."""
        return np.asarray(self.crosses[self.moves_of(path)].sum(axis=0)).ravel() > 0


def _distribution(start: int | ArrayLike, states: int) -> Floats:
    """(S,) probabilities of beginning in each state."""
    array = np.asarray(start)
    if array.ndim == 0:
        begins = np.zeros(states)
        begins[in_range(array, states, "the start")] = 1.0
        return begins
    begins = array.astype(float)
    total = float(np.sum(begins))
    if begins.shape != (states,) or np.any(begins < 0) or not abs(total - 1) <= WRITTEN:
        raise ValueError(
            f"a start is a state, or ({states},) probabilities that add up to 1, not "
            f"{begins.shape} that add up to {total:.9g}"
        )
    return begins / total if abs(total - 1) > ROUNDING else begins


def _crossings(
    chances: scipy.sparse.csr_matrix, regions: Sequence[TableRegion]
) -> scipy.sparse.csr_matrix:
    """(S * A, C) boolean: which moves belong to which regions."""
    states = chances.shape[1]
    actions = chances.shape[0] // states
    inside = _incidence([region.states for region in regions], states, "states of a region")
    by = _incidence([region.actions for region in regions], actions, "actions of a region")
    pairs = [np.array(region.moves).reshape(-1, 2) for region in regions]
    rows = [
        in_range(pair[:, 0], states, "states of a region") * actions
        + in_range(pair[:, 1], actions, "actions of a region")
        for pair in pairs
    ]
    alone = _incidence(rows, chances.shape[0], "moves of a region")
    state, action = np.divmod(np.arange(chances.shape[0]), actions)
    belongs = inside[state] + chances @ inside + by[action] + alone
    return scipy.sparse.csr_matrix(belongs > 0)


def _incidence(members: Sequence[ArrayLike], count: int, what: str) -> scipy.sparse.csr_matrix:
    """(count, C) with a 1 for each of the numbers that C lists hold."""
    lists = [np.unique(in_range(each, count, what)) for each in members]
    column = np.repeat(np.arange(len(lists)), [len(each) for each in lists])
    row = np.concatenate([*lists, np.empty(0, dtype=np.int64)])
    return scipy.sparse.csr_matrix((np.ones(len(row)), (row, column)), shape=(count, len(lists)))
