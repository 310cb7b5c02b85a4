"""Credible sets: the fewest hypotheses that hold a share of the posterior, joined into areas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.sparse when it is first used

from mlci.evidence import rank_scores
from mlci.regions import Regions
from mlci.spaces import Box, Floats, Ints, middle_and_half

_ROUNDING = 1e-12  # of a probability: sums may be this much short of a share
_DECIMALS = 9  # of the probability of an area: those that differ beyond are equal
_SLACK = 1e-9  # of the bounds: sides closer than this are the same side, as in `Regions`


@dataclass(frozen=True, eq=False)
class Area:
    """Regions of a credible set that hang together by common borders.

    Attributes:
        regions: (B,) their numbers, ascending.
        probability: posterior probability that one of them is the constraint.
        hull: the smallest box that holds them; free where they are, or where they go all round a
            periodic dimension, in which it begins within the bounds and may end beyond them.
    """

    regions: Ints
    probability: float
    hull: Box


@dataclass(frozen=True, eq=False)
class CredibleSet:
    """The fewest of the regions and "no constraint" that hold a share of the posterior.

    Attributes:
        share: the share that was asked for.
        regions: (B,) numbers of the regions, the most probable first, ties by number.
        has_none: whether "no constraint" belongs to it.
        probability: what it holds, at least `share`.
        areas: its regions, joined with their neighbours; the most probable first.
    """

    share: float
    regions: Ints
    has_none: bool
    probability: float
    areas: tuple[Area, ...]

    def __str__(self) -> str:
        none = "no constraint" if self.has_none else ""
        regions = f"{counted(len(self.regions), 'region')} in {counted(len(self.areas), 'area')}"
        return " and ".join(filter(None, [none, regions if len(self.regions) else ""]))


def credible_set(
    hypotheses: Regions, posterior: Floats, posterior_none: float, share: float = 0.95
) -> CredibleSet:
    """The credible set of a posterior under "at most one constraint".

    Args:
        hypotheses: the C regions.
        posterior: (C,) probability of each being the one constraint.
        posterior_none: probability that there is none.
        share: of the posterior, in (0, 1].

    Raises:
        ValueError: a share out of range.
    """
    regions, has_none, probability = most_probable(posterior, posterior_none, share)
    areas = joined_areas(
        hypotheses, np.sort(regions), lambda group: float(np.sum(posterior[group]))
    )
    return CredibleSet(
        share=share,
        regions=regions,
        has_none=has_none,
        probability=probability,
        areas=tuple(sorted(areas, key=lambda area: -round(area.probability, _DECIMALS))),
    )


def most_probable(
    posterior: Floats, posterior_none: float, share: float = 0.95
) -> tuple[Ints, bool, float]:
    """The fewest hypotheses that hold a share of the posterior; arguments as of `credible_set`.

    Returns:
        Their numbers, the most probable first; whether "no constraint" is among them; and what all
        of them hold.

    Raises:
        ValueError: a share out of range.
    """
    if not 0 < share <= 1:
        raise ValueError(f"the share of a credible set must lie in (0, 1], not {share}")
    probability = np.append(posterior_none, posterior)  # "no constraint" wins ties
    with np.errstate(divide="ignore"):
        rank = rank_scores(np.log(probability), probability > 0)
    order = np.argsort(rank, kind="stable")
    held = np.cumsum(probability[order])
    count = min(int(np.searchsorted(held, share - _ROUNDING)) + 1, len(order))
    numbers = order[:count]
    return numbers[numbers > 0] - 1, bool(np.any(numbers == 0)), float(held[count - 1])


def neighbours(regions: Regions) -> scipy.sparse.csr_matrix:
    """(C, C) sparse: which regions overlap, or touch along a side and not in a corner alone."""
    boxes = [middle_and_half(regions.box(i)) for i in range(len(regions))]
    middle, half = np.array(boxes).reshape(-1, 2, regions.space.dimension).transpose(1, 0, 2)
    slack, rows = _SLACK * regions.space.bounds.widths, []
    for i in range(len(regions)):
        # How far apart two regions are in each dimension; below 0 where they overlap.
        gap = np.abs(regions.space.difference(middle, middle[i])) - (half + half[i])
        touches = np.all(gap <= slack, axis=1) & (np.sum(gap > -slack, axis=1) <= 1)
        rows.append(scipy.sparse.csr_matrix(touches))
    return scipy.sparse.vstack(rows, format="csr")


def joined_areas(
    hypotheses: Regions, numbers: Ints, probability: Callable[[Ints], float]
) -> list[Area]:
    """Some regions, joined with their neighbours among them, in order of their first regions.

    Args:
        hypotheses: the C regions.
        numbers: (B,) numbers of the regions, ascending.
        probability: of regions that are one area, by their numbers.
    """
    return [
        Area(group, probability(group), _hull(hypotheses, group))
        for group in _joined(hypotheses, numbers)
    ]


def _joined(hypotheses: Regions, numbers: Ints) -> list[Ints]:
    """Some regions in groups that hang together by common borders."""
    if not len(numbers):
        return []
    mask = np.isin(np.arange(len(hypotheses)), numbers)
    from scipy.sparse import csgraph

    count, group = csgraph.connected_components(neighbours(hypotheses.select(mask)), directed=False)
    return [numbers[group == k] for k in range(count)]


def _hull(hypotheses: Regions, numbers: Ints) -> Box:
    """The smallest box that holds some regions."""
    lower, upper = hypotheses.lower[numbers], hypotheses.upper[numbers]
    bounds = hypotheses.space.bounds
    low, high = np.min(lower, axis=0), np.max(upper, axis=0)
    for d in np.flatnonzero(hypotheses.space.periodic & np.isfinite(low) & np.isfinite(high)):
        begin, end = _arc(lower[:, d], upper[:, d], float(bounds.widths[d]))
        turns = np.floor((begin - bounds.lower[d]) / bounds.widths[d] + _SLACK)
        shift = turns * bounds.widths[d] if np.isfinite(begin) else 0.0
        low[d], high[d] = begin - shift, end - shift
    return Box(low, high)


def _arc(lower: Floats, upper: Floats, period: float) -> tuple[float, float]:
    """The ends of the shortest arc of a circle that holds some arcs; infinite if it closes."""
    arcs, slack = np.unique(np.stack([lower, upper], axis=1), axis=0), _SLACK * period
    # The shortest arc begins where one of them does: how far does each reach from there?
    ahead = np.mod(arcs[:, 0] - arcs[:, :1] + slack, period) - slack
    extent = np.max(ahead + arcs[:, 1] - arcs[:, 0], axis=1)
    best = int(np.argmin(extent))
    if extent[best] >= period - slack:
        return -np.inf, np.inf
    return float(arcs[best, 0]), float(arcs[best, 0] + extent[best])


def counted(count: int, noun: str) -> str:
    """A count with its noun."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
