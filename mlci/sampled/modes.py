"""The locally optimal ways of a passage: where the density of its paths has its modes.

The optimiser of the demonstrator starts from many first guesses towards each winding of the goal,
winding by winding in both directions for as long as these still bring ways that are not too dear.
The goal is a Gaussian here, see `Passage.goal_price`.
"""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mlci.control.ilqr import optimize
from mlci.demonstrator import first_guesses
from mlci.sampled.passage import Passage
from mlci.spaces import Bools, Floats, Ints, StateSpace
from mlci.wrapped import Wrapped

GOAL_SHARE = 0.7  # of a goal's half width: the Gaussian that loses fewest samples on a box
_HOLD = 0.5  # s for which a first guess holds a control
_CUT = 12.0  # nat: ways so much less likely than the best do not count
_SAME = 0.3  # squared distance of controls, in their free standard deviations, of equal ways
_ITERATIONS = 60
_TOLERANCE = 1e-6  # of a cost; the policy round a way corrects for what is left
_TURNS = 6  # windings on each side are looked at no further

Ways = tuple[Floats, Floats, Floats, Floats]  # states, controls, goals and costs of first guesses


@dataclass(frozen=True, eq=False)
class Unrolled(Wrapped):
    """A system whose space does not wrap: states that are whole turns apart are different."""

    @property
    def space(self) -> StateSpace:
        space = self.system.space
        return StateSpace(space.bounds, np.zeros_like(space.periodic), space.names, space.units)


@dataclass(frozen=True, eq=False)
class Modes:
    """The M ways that were found, the cheapest first; there may be none.

    Attributes:
        states: (M, T+1, n) path, not wrapped.
        controls: (M, T, m) controls.
        goals: (M, n) middle of the goal, by the winding that the way takes.
        cost: (M,) minus log density, but for a constant [nat].
        restarts: (M,) first guesses that led to it.
        late: (M,) whether only the second half of the guesses did.
    """

    states: Floats
    controls: Floats
    goals: Floats
    cost: Floats
    restarts: Ints
    late: Bools

    def __len__(self) -> int:
        return len(self.cost)

    def joined(self, other: Modes) -> Modes:
        """These ways, then the other's."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Modes(*(np.concatenate(pair) for pair in pairs))


def find_modes(passage: Passage, restarts: int, rng: np.random.Generator) -> Modes:
    """The locally optimal ways of a passage.

    Args:
        passage: start, goal, dynamics and reward.
        restarts: first guesses for each winding; the first of them is a control that is at rest in
            the middle of its range.
        rng: draws the others.
    """
    return find_modes_of([passage], restarts, [rng])[0]


def find_modes_of(
    passages: Sequence[Passage], restarts: int, rngs: Sequence[np.random.Generator]
) -> list[Modes]:
    """The locally optimal ways of many passages at once, which is much faster than one by one.

    Args:
        passages: that differ by start and goal alone, and not by the goal's widths.
        restarts: as of `find_modes`.
        rngs: a generator for each passage.

    Raises:
        ValueError: passages that differ by more.
    """
    if len({_shared(passage) for passage in passages}) > 1:
        raise ValueError("passages whose modes are looked for at once have goals of other widths")
    found: list[list[Ways]] = [[] for _ in passages]
    rings = [_rings(passage) for passage in passages]
    going = [(i, turns) for i, ring in enumerate(rings) for turns in itertools.islice(ring, 1)]
    while going:
        numbers = [i for i, _ in going]
        solved = _solve(
            [passages[i] for i in numbers],
            [turns for _, turns in going],
            restarts,
            [rngs[i] for i in numbers],
        )
        for i, ways in zip(numbers, solved, strict=True):
            found[i].append(ways)
        best = {i: min(float(np.min(ways[-1])) for ways in found[i]) for i in numbers}
        near = [i for i in numbers if not float(np.min(found[i][-1][-1])) > best[i] + _CUT]
        going = [(i, turns) for i in near for turns in itertools.islice(rings[i], 1)]
    return [
        _first_distinct(passage, restarts, ways)
        for passage, ways in zip(passages, found, strict=True)
    ]


def _shared(passage: Passage) -> tuple[Hashable, ...]:
    """What passages have in common whose modes are looked for at once."""
    numbers = passage.steps, passage.dt, passage.temperature, passage.substeps
    return id(passage.system), id(passage.limit), *numbers, passage.half.tobytes()


def _rings(passage: Passage) -> Iterator[Floats]:
    """Windings (L, n): those up to a turn from the goal that is nearest, two turns, three ..."""
    round_ = np.flatnonzero(passage.system.space.periodic & np.isfinite(passage.half))
    for ring in range(1, _TURNS + 1 if len(round_) else 2):
        least = 0 if ring == 1 else ring
        ways = [
            way
            for way in itertools.product(range(-ring, ring + 1), repeat=len(round_))
            if least <= sum(map(abs, way)) <= ring
        ]
        turns = np.zeros((len(ways), passage.system.space.dimension))
        turns[:, round_] = ways
        yield turns


def _solve(
    passages: Sequence[Passage],
    turns: Sequence[Floats],
    restarts: int,
    rngs: Sequence[np.random.Generator],
) -> list[Ways]:
    """What the optimiser makes of first guesses towards some windings (L, n) of each passage."""
    passage, box = passages[0], passages[0].system.control_box
    per_hold, widths = max(1, round(_HOLD / passage.dt)), passage.system.space.bounds.widths
    goals, guesses = list[Floats](), list[Floats]()
    for each, windings, rng in zip(passages, turns, rngs, strict=True):
        goals.append(np.repeat(each.nearest_goal + windings * widths, restarts, axis=0))
        count = len(goals[-1])
        guesses.append(first_guesses(rng, box, passage.steps, per_hold, count))
        guesses[-1][::restarts] = (box.lower + box.upper) / 2
    counts = [len(each) for each in goals]
    starts = np.repeat([each.start for each in passages], counts, axis=0)
    of_all = improve(passage, starts, np.concatenate(goals), np.concatenate(guesses))
    parts = [np.split(each, np.cumsum(counts)[:-1]) for each in of_all]
    return list(zip(*parts, strict=True))


def improve(passage: Passage, starts: Floats, goals: Floats, guesses: Floats) -> Ways:
    """What the optimiser makes of first guesses (B, T, m) from starts to goals (B, n)."""
    free = np.isinf(passage.half)
    solution = optimize(
        Unrolled(passage.system),
        starts,
        np.where(free, -np.inf, goals),
        np.where(free, np.inf, goals),
        guesses,
        passage.dt,
        goal_weight=1.0,
        goal_scale=np.sqrt(passage.goal_price(GOAL_SHARE)),
        iterations=_ITERATIONS,
        tolerance=_TOLERANCE,
        limit=passage.limit,
        integrator=passage.integrator,
    )
    return solution.states, solution.controls, goals, solution.cost / passage.temperature


def _first_distinct(passage: Passage, restarts: int, parts: Sequence[Ways]) -> Modes:
    """The distinct ways of guesses of which each winding has some, one after the other."""
    states, controls, goals, cost = map(np.concatenate, zip(*parts, strict=True))
    number = np.arange(len(cost))
    is_late = number % restarts >= restarts / 2
    return distinct(passage, Modes(states, controls, goals, cost, np.ones_like(number), is_late))


def distinct(passage: Passage, ways: Modes) -> Modes:
    """The ways that are not too dear, in order, equal ones merged into the cheapest of them."""
    controls, cost = ways.controls, ways.cost
    deviation = passage.temperature / (2 * passage.dt)
    numbers: list[int] = []
    counts: list[int] = []
    late: list[bool] = []
    for way in np.argsort(cost, kind="stable").tolist():
        if not cost[way] <= np.min(cost) + _CUT or cost[way] == np.inf:
            break
        apart = controls[numbers] - controls[way]
        near = np.flatnonzero(np.sum(np.square(apart), axis=(1, 2)) < _SAME * deviation)
        if len(near):
            counts[near[0]] += int(ways.restarts[way])
            late[near[0]] &= bool(ways.late[way])
        else:
            numbers.append(way)
            counts.append(int(ways.restarts[way]))
            late.append(bool(ways.late[way]))
    return Modes(
        states=ways.states[numbers],
        controls=controls[numbers],
        goals=ways.goals[numbers],
        cost=cost[numbers],
        restarts=np.array(counts, dtype=np.int64),
        late=np.array(late, dtype=bool),
    )
