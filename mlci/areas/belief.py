"""Belief over what is forbidden, if it is nothing, one shape, or two, and the area to name for it.

Shapes that were drawn from a prior (`mlci.areas.prior_shapes`) are equally probable, and so are
their pairs. The posterior of all of these is exact for the drawn shapes. Of the area it says how
probable it is that each point is forbidden, and which area is expected to overlap best with what is
(`mlci.areas.overlap`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np
import scipy  # loads scipy.special when it is first used

from mlci.areas.evidence import ShapeEvidence
from mlci.areas.overlap import best_area
from mlci.credible_sets import Area, joined_areas
from mlci.grids import Grid
from mlci.regions import Regions
from mlci.spaces import Bools, Floats

DRAWS = 500  # of the posterior, from which the area is told
SIZES = (0.5, 0.1, 0.4)  # prior of nothing, one shape, two


@dataclass(frozen=True, eq=False)
class AreaBelief:
    """What is believed of a forbidden area, on the P points of a raster.

    Attributes:
        raster: its cells are the points.
        sizes: (3,) probability that nothing is forbidden, one shape, or two.
        chance: (P,) probability that a point is forbidden.
        area: (P,) the area with the largest expected overlap, if anything is forbidden.
        overlap: that expected intersection over union, if anything is; right if model and prior
            are, and nan where demonstrations exclude every shape.
        shapes: numbers of the most probable shape or two, nothing left out of account.
        probability: of these.
        drawn: how many shapes were drawn, of which these are some.
    """

    raster: Grid
    sizes: Floats
    chance: Floats
    area: Bools
    overlap: float
    shapes: tuple[int, ...]
    probability: float
    drawn: int

    @property
    def parts(self) -> tuple[Area, ...]:
        """The parts of the area that hang together, largest first, with hulls.

        Numbers are of points. The probability is the largest chance of its points: at least so
        probable it is that something of the part is forbidden.
        """
        bounded = [count if count > 1 else None for count in self.raster.shape]
        points = Regions.from_grid(self.raster.space, bounded)
        parts = joined_areas(
            points, np.flatnonzero(self.area), lambda group: float(np.max(self.chance[group]))
        )
        return tuple(sorted(parts, key=lambda part: -len(part.regions)))


def infer_area(
    evidence: ShapeEvidence,
    rng: np.random.Generator,
    sizes: tuple[float, float, float] = SIZES,
    draws: int = DRAWS,
) -> AreaBelief:
    """The belief of some demonstrations.

    Args:
        evidence: of the demonstrations, for shapes and pairs of them.
        rng: of the draws.
        sizes: prior probabilities that nothing is forbidden, one shape, or two.
        draws: sets that are drawn from the posterior, to tell chances and the area.

    Raises:
        ValueError: probabilities that do not add up to 1, or no draws.
    """
    if len(sizes) != 3 or min(sizes) < 0 or not np.isclose(sum(sizes), 1):
        raise ValueError(f"probabilities of nothing, one shape and two add up to 1, not {sizes}")
    if draws < 1:
        raise ValueError(f"an area is told from at least one draw, not {draws}")
    count, feasible = evidence.inside.shape[1], evidence.feasible
    first, second = np.triu_indices(len(feasible))
    one = first == second
    with np.errstate(divide="ignore"):
        prior = np.log(sizes) - np.log([1, count, max(comb(count, 2), 1)])
    weight = evidence.pair_gains(feasible)[first, second] + np.where(one, prior[1], prior[2])
    total = scipy.special.logsumexp(np.append(weight, prior[0]))
    some = scipy.special.logsumexp(weight) if len(weight) else -np.inf
    raster, inside = evidence.raster, evidence.inside
    if some == -np.inf:  # every shape is excluded
        nowhere = np.zeros(raster.size)
        none = np.array([1.0, 0, 0]), nowhere, nowhere > 0, np.nan, (), np.nan, count
        return AreaBelief(raster, *none)
    probability = np.exp(weight - some)  # if anything is forbidden
    of_some, of_one = np.exp(some - total), float(np.sum(probability[one]))

    drawn = rng.choice(len(weight), draws, p=probability / np.sum(probability))
    met, times = np.unique(drawn, return_counts=True)
    masks = (inside[:, feasible[first[met]]] | inside[:, feasible[second[met]]]).T
    share = times / draws
    area, overlap = best_area(masks, share)
    best = int(np.argmax(weight))
    return AreaBelief(
        raster=raster,
        sizes=np.array([1 - of_some, of_some * of_one, of_some * (1 - of_one)]),
        chance=of_some * (share @ masks),
        area=area,
        overlap=overlap,
        shapes=tuple(sorted({int(feasible[first[best]]), int(feasible[second[best]])})),
        probability=float(of_some * probability[best]),
        drawn=count,
    )
