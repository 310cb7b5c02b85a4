"""Failure set or tube? Hypotheses that the demonstrations cannot tell from the first.

The *tube* of a region holds the cells from which no way leads that avoids the region for ever: the
complement of its viability kernel. A trajectory that enters the tube and not the region stays in
the tube, so one that ends in a goal outside the tube and enters it enters the region too. Hence
Phi of the region is at least Phi of any part of its tube, and so is its gain, as long as no
demonstration enters either: whatever is avoided because one could not turn back from there looks
like the region, and explains no more.

So the region is preferred to the parts of its tube: it says why they are avoided, and what to
avoid if the controls were others, of which its tube is a consequence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mlci.evidence import TIE
from mlci.inference import Inference
from mlci.merged_moves import MergedMoves
from mlci.regions import Regions
from mlci.spaces import Bools, Ints, middle_and_half
from mlci.tabular import TabularModel

_NAMED = 8  # of a class's members
NEAR = 0.1  # nat: evidence that differs by less does not tell regions apart


@dataclass(frozen=True, eq=False)
class TieClass:
    """Hypotheses that the demonstrations cannot tell from the first, by number, as they rank.

    Attributes:
        preferred: the first of the ranking, or the region in whose tube that lies, if their gains
            are nearly the same.
        same: others with the same gain as that.
        tube: others with nearly the same gain that lie in its tube.
    """

    preferred: int
    same: Ints
    tube: Ints

    @property
    def others(self) -> Ints:
        """The members beside the preferred one."""
        return np.append(self.same, self.tube)

    def summary(self, names: tuple[str, ...]) -> str:
        """What is in the class, in words; names are of all hypotheses."""
        first, parts = names[self.preferred], []
        if len(self.same):
            parts.append(f"{_listed(names, self.same)} with the same gain")
        if len(self.tube):
            parts.append(f"{_listed(names, self.tube)} in its tube, from where nothing avoids it")
        if not parts:
            return f"nothing ties with region {first}"
        return f"these demonstrations do not tell region {first} from {' and '.join(parts)}"

    def record(self, names: tuple[str, ...]) -> dict[str, Any]:
        """The class for programs, by names of all hypotheses."""
        return {
            "preferred": names[self.preferred],
            "same_gain": [names[i] for i in self.same],
            "in_its_tube": [names[i] for i in self.tube],
        }


def tie_class(
    model: TabularModel, inference: Inference, hypotheses: Bools | None = None
) -> TieClass:
    """The hypotheses that tie with the first, and which of them to prefer.

    Args:
        model: the tabular model.
        inference: about some of its regions.
        hypotheses: (C',) mask over the model's regions; None takes all.
    """
    of_model = np.arange(len(model.regions)) if hypotheses is None else np.flatnonzero(hypotheses)
    gain, order, _regions = inference.gain, inference.order, inference.hypotheses
    first = int(order[0])
    alone = TieClass(first, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    if not gain[first] > TIE:  # what explains nothing ties with all else that does not
        return alone
    with np.errstate(invalid="ignore"):
        apart = np.where(gain == gain[first], 0.0, gain[first] - gain)
    near = order[apart[order] < NEAR]
    if len(near) == 1:
        return alone
    chosen, inside = first, _near_in_tube(model, inference, near, first, of_model)
    for candidate in near[1:].tolist():
        theirs = _near_in_tube(model, inference, near, candidate, of_model)
        if theirs[near == chosen].all() and not inside[near == candidate].any():
            chosen, inside = candidate, theirs
    with np.errstate(invalid="ignore"):
        same = np.abs(gain[near] - gain[chosen]) <= TIE
    same |= gain[near] == gain[chosen]
    others = near != chosen
    return TieClass(chosen, near[others & same & ~inside], near[others & inside])


def tube_cells(moves: MergedMoves, region: int) -> Bools:
    """(S,) cells from which the region cannot be avoided for ever, though ways go on for ever.

    Args:
        moves: of all cells.
        region: number of the region.
    """
    entry = np.flatnonzero(moves.crossing_region == region)
    avoids = np.ones(len(moves.successor), dtype=bool)
    avoids[np.searchsorted(moves.crossing_begins, entry, side="right") - 1] = False
    allowed = moves.log_weight > -np.inf
    return _viable(moves, allowed) & ~_viable(moves, allowed & avoids)


def cells_inside(model: TabularModel, regions: Regions, number: int) -> Ints:
    """The cells whose centres lie in a region; if there are none, the one in its hull's middle."""
    space, box = regions.space, regions.box(number)
    inside = regions.shape(number).level(space, model.grid.centers) < 0
    if inside.any():
        return np.flatnonzero(inside)
    middle, _ = middle_and_half(box)
    bounds = (space.bounds.lower + space.bounds.upper) / 2
    return np.atleast_1d(model.grid.index(np.where(np.isfinite(middle), middle, bounds)))


def _near_in_tube(
    model: TabularModel, inference: Inference, near: Ints, region: int, of_model: Ints
) -> Bools:
    """Which near hypotheses lie in the tube of one of them: with all of their cells."""
    tube = tube_cells(model.merged, int(of_model[region]))
    cells = [cells_inside(model, inference.hypotheses, number) for number in near.tolist()]
    return np.array([bool(np.all(tube[each])) for each in cells]) | (near == region)


def _viable(moves: MergedMoves, allowed: Bools) -> Bools:
    """(S,) cells from which some way of allowed moves (W,) goes on for ever."""
    cell = np.repeat(np.arange(moves.states), np.diff(moves.begins))
    viable = np.ones(moves.states, dtype=bool)
    while True:
        goes_on = np.zeros(moves.states, dtype=bool)
        goes_on[cell[allowed & viable[moves.successor]]] = True
        if np.array_equal(goes_on, viable):
            return viable
        viable = goes_on


def _listed(names: tuple[str, ...], numbers: Ints) -> str:
    """Regions by name, the first few."""
    few = ", ".join(names[i] for i in numbers[:_NAMED])
    return few + (f" and {len(numbers) - _NAMED} more" if len(numbers) > _NAMED else "")
