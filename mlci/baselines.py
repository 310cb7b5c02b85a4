"""Other ways to rank regions by demonstrations, to be compared with: scores, and no evidence.

Each looks for what demonstrators might be expected to do and do not, and scores regions that no
demonstration enters; one that some demonstration enters comes last. None asks how probable avoiding
a region by chance was, which is what Phi tells; so none has a posterior.

* `visits`: expected less empirical visits. What imitation by matching of feature expectations
  (Abbeel and Ng 2004; Ziebart et al. 2008) and Scobee and Sastry (2020, section V) look at. The
  expected ones are of the unconstrained agent in the same tasks, the empirical ones 0 where nobody
  enters.
* `crossings`: the share of sampled unconstrained paths that cross a region, counted over all tasks:
  an estimate of the mean of Phi over tasks, by so many draws. It adds where the likelihood
  multiplies: a region that one task would certainly enter counts no more than one that ten tasks
  would enter with probability .1, although avoiding the first is no chance at all.
* `nearest`: minus the distance from a region to the nearest demonstration, since one who keeps out
  of it passes its border.
* `uniform`: 0 for all, so that they tie: what a rank is worth by guessing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mlci.demonstrations import Demonstration
from mlci.maxent import TrajectoryDistribution
from mlci.misfit import sample_crossings
from mlci.spaces import Floats
from mlci.tabular import TabularModel

Parts = Callable[[TabularModel, Sequence[Demonstration], int, np.random.Generator], Floats]


@dataclass(frozen=True)
class Baseline:
    """A method that scores regions by what each demonstration says.

    Attributes:
        parts: model, N demonstrations, number of sampled paths and generator to (N, C).
        combine: parts (..., N, C) to scores (..., C), the larger the sooner.
    """

    parts: Parts
    combine: Callable[[Floats], Floats]

    def score(
        self,
        model: TabularModel,
        demonstrations: Sequence[Demonstration],
        paths: int,
        rng: np.random.Generator,
    ) -> Floats:
        """(C,) the score of each region; -inf where a demonstration enters it.

        Args:
            model: the tabular model, whose regions are scored.
            demonstrations: at least one.
            paths: sampled paths for each task.
            rng: of these paths.

        Raises:
            ValueError: no demonstrations, or no paths where some are needed.
        """
        if not demonstrations:
            raise ValueError("a score needs demonstrations, and there are none")
        entered = [model.regions.violated_by(each.states) for each in demonstrations]
        scores = self.combine(self.parts(model, demonstrations, paths, rng))
        return np.where(np.any(entered, axis=0), -np.inf, scores)


def visits(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    _paths: int = 0,
    _rng: np.random.Generator | None = None,
) -> Floats:
    """(N, C) expected number of time steps, start and end counted, in cells whose centre is inside.

    Less those of the demonstration at the model's time steps. The agent goes from cell to cell; 0
    is expected where it cannot do the task.
    """
    centers, found = model.grid.centers, np.zeros((len(demonstrations), len(model.regions)))
    inside = _levels(model, centers) < 0
    for row, demonstration in zip(found, demonstrations, strict=True):
        times = np.arange(0, demonstration.times[-1] + model.dt / 2, model.dt)
        nearest = np.abs(demonstration.times - times[:, None]).argmin(axis=1)
        row -= np.sum(_levels(model, demonstration.states[nearest]) < 0, axis=0)
        distribution = _distribution(model, demonstration)
        if distribution.is_possible:
            row += occupancy(distribution) @ inside
    return found


def occupancy(distribution: TrajectoryDistribution) -> Floats:
    """(S,) expected number of times in each cell, the start and the end counted."""
    states = distribution.model.states
    now = np.bincount([distribution.start], minlength=states).astype(float)
    total = now.copy()
    for t in range(distribution.steps):
        cells, probabilities = distribution.policy(t)
        successor, _ = distribution.model.policy_moves(cells)
        flow = (now[cells, None] * probabilities).ravel()
        moving = flow > 0
        now = np.bincount(successor.ravel()[moving], weights=flow[moving], minlength=states)
        total += now
    return total


def crossings(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    paths: int,
    rng: np.random.Generator,
) -> Floats:
    """(N, C) share of sampled unconstrained paths of each task that cross each region.

    Paths go from cell to cell; 0 where the tabular agent cannot do the task.

    Raises:
        ValueError: no paths.
    """
    if paths < 1:
        raise ValueError(f"crossings are counted over 1 path of a task or more, not {paths}")
    found = np.zeros((len(demonstrations), len(model.regions)))
    for row, demonstration in zip(found, demonstrations, strict=True):
        distribution = _distribution(model, demonstration)
        if distribution.is_possible:
            row[:] = np.mean(sample_crossings(distribution, paths, rng), axis=0)
    return found


def nearest(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    _paths: int = 0,
    _rng: np.random.Generator | None = None,
) -> Floats:
    """(N, C) minus the Euclidean distance in raw units from a region to the nearest sample."""
    return np.array([-np.min(_levels(model, each.states), axis=0) for each in demonstrations])


def uniform(
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    _paths: int = 0,
    _rng: np.random.Generator | None = None,
) -> Floats:
    """(N, C) zeros."""
    return np.zeros((len(demonstrations), len(model.regions)))


def _mean(parts: Floats) -> Floats:
    """Over demonstrations."""
    return np.asarray(np.mean(parts, axis=-2))


def _largest(parts: Floats) -> Floats:
    """Over demonstrations."""
    return np.asarray(np.max(parts, axis=-2))


BASELINES = {
    "visits": Baseline(visits, _mean),
    "crossings": Baseline(crossings, _mean),
    "nearest": Baseline(nearest, _largest),
    "uniform": Baseline(uniform, _mean),
}


def _distribution(model: TabularModel, demonstration: Demonstration) -> TrajectoryDistribution:
    """The unconstrained agent's, from cell to cell."""
    return TrajectoryDistribution.of_task(model, demonstration.task, round_horizon=True)


def _levels(model: TabularModel, states: Floats) -> Floats:
    """(K, C) signed distance of states (K, n) to each region."""
    regions = model.regions
    each = [regions.shape(i).level(regions.space, states) for i in range(len(regions))]
    return np.stack(each, axis=1)
