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
from mlci.spaces import Bools, Floats, Ints

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


@dataclass(frozen=True, eq=False)
class SetsOfShapes:
    """The posterior of W sets of one or two shapes, exact for the drawn shapes.

    Attributes:
        members: (W, 2) numbers of the shapes of each set, the same twice where it is one shape.
        probability: (W,) of each, if anything is forbidden; empty where every shape is excluded.
        some: probability that anything is forbidden.
    """

    members: Ints
    probability: Floats
    some: float

    def draw(self, draws: int, rng: np.random.Generator) -> tuple[Ints, Floats]:
        """Which sets are drawn (B,), each once, and their shares (B,) of the draws."""
        drawn = rng.choice(len(self.members), draws, p=self.probability / self.probability.sum())
        met, times = np.unique(drawn, return_counts=True)
        return met, times / draws


def sets_of_shapes(
    evidence: ShapeEvidence,
    sizes: tuple[float, float, float] = SIZES,
    together: Bools | None = None,
) -> SetsOfShapes:
    """The posterior of some demonstrations; arguments as of `infer_area`."""
    if len(sizes) != 3 or min(sizes) < 0 or not np.isclose(sum(sizes), 1):
        raise ValueError(f"probabilities of nothing, one shape and two add up to 1, not {sizes}")
    count, feasible = evidence.inside.shape[1], evidence.feasible
    if together is not None and together.shape != (count, count):
        raise ValueError(f"pairs of {count} shapes do not fit a mask of shape {together.shape}")
    first, second = np.triu_indices(len(feasible))
    one, pairs = first == second, comb(count, 2)
    may = np.ones(len(first), dtype=bool)
    if together is not None:
        may = one | together[feasible[first], feasible[second]]
        pairs = int(np.sum(np.triu(together, 1)))
    with np.errstate(divide="ignore"):
        prior = np.log(sizes) - np.log([1, count, max(pairs, 1)])
    of_size = np.where(one, prior[1], prior[2])
    weight = np.where(may, evidence.pair_gains(feasible)[first, second] + of_size, -np.inf)
    total = scipy.special.logsumexp(np.append(weight, prior[0]))
    some = scipy.special.logsumexp(weight) if len(weight) else -np.inf
    if some == -np.inf:  # every shape is excluded
        return SetsOfShapes(np.zeros((0, 2), dtype=np.int64), np.zeros(0), 0.0)
    members = feasible[np.stack([first, second], axis=1)]
    return SetsOfShapes(members, np.exp(weight - some), float(np.exp(some - total)))


def infer_area(
    evidence: ShapeEvidence,
    rng: np.random.Generator,
    sizes: tuple[float, float, float] = SIZES,
    draws: int = DRAWS,
    together: Bools | None = None,
) -> AreaBelief:
    """The belief of some demonstrations.

    Args:
        evidence: of the demonstrations, for shapes and pairs of them.
        rng: of the draws.
        sizes: prior probabilities that nothing is forbidden, one shape, or two.
        draws: sets that are drawn from the posterior, to tell chances and the area.
        together: (C, C) which pairs may be forbidden together, such as
            `mlci.areas.prior_shapes.apart`; all by default.

    Raises:
        ValueError: probabilities that do not add up to 1, no draws, or a mask of another shape.
    """
    if draws < 1:
        raise ValueError(f"an area is told from at least one draw, not {draws}")
    sets, raster = sets_of_shapes(evidence, sizes, together), evidence.raster
    drawn = evidence.inside.shape[1]
    if not len(sets.members):
        nowhere = np.zeros(raster.size)
        none = np.array([1.0, 0, 0]), nowhere, nowhere > 0, np.nan, (), np.nan, drawn
        return AreaBelief(raster, *none)
    met, share = sets.draw(draws, rng)
    masks = evidence.of_sets(sets.members[met])
    area, overlap = best_area(masks, share)
    best = int(np.argmax(sets.probability))
    of_one = float(np.sum(sets.probability[sets.members[:, 0] == sets.members[:, 1]]))
    return AreaBelief(
        raster=raster,
        sizes=np.array([1 - sets.some, sets.some * of_one, sets.some * (1 - of_one)]),
        chance=sets.some * (share @ masks),
        area=area,
        overlap=overlap,
        shapes=tuple(sorted(set(sets.members[best].tolist()))),
        probability=float(sets.some * sets.probability[best]),
        drawn=drawn,
    )
