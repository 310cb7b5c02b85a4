"""What a person should be told of an inference: the credible set, what it rests on, and doubts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mlci.demonstrations import Demonstration
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.json_numbers import finite
from mlci.misfit import SAMPLES, Misfit, misfit
from mlci.models import Model, distribution_of
from mlci.next_task import NextTask
from mlci.rank_errors import RankErrors, rank_errors, sampling_record
from mlci.regions import Regions
from mlci.shapes.membership import volume_share
from mlci.shapes.shape import Cuboid
from mlci.size_bias import SizeBias, size_bias
from mlci.soft.weight import WeightEstimate
from mlci.spaces import Bools, Ints
from mlci.support import Support, support
from mlci.tabular import TabularModel
from mlci.temperature import TemperatureEstimate
from mlci.ties import TieClass, tie_class

# Demonstrations without a constraint would enter such a region in less than one set of this size
# in 20, so that avoiding it says nothing.
_RARELY_ENTERED = 0.05
_SAME_SIDE = 1e-6  # of a cell


@dataclass(frozen=True, eq=False)
class Answer:
    """An inference, and how to read it.

    Attributes:
        inference: from N demonstrations about C hypotheses.
        support: what the first region's gain rests on.
        misfit: how the demonstrations compare with the model's own trajectories.
        unseen: numbers of the regions that none of the tasks could have shown.
        cut: (C, n) whether a hypothesis has a side in a dimension that is no border of cells.
        temperature: of the model.
        exact_ends: whether its trajectories begin and end at states, not at cells.
        temperature_estimate: the temperature that the demonstrations look like, if it is known.
        doubts: about the recordings themselves, such as `mlci.recordings.plausibility.summary`.
        ties: the hypotheses that the demonstrations cannot tell from the first, if that is known.
        weights: soft or hard? What `mlci.soft.weight.estimate_weights` made of some regions.
        next_tasks: what to record next, as `mlci.next_task.next_tasks` chose it.
    """

    inference: Inference
    support: Support
    misfit: Misfit
    unseen: Ints
    cut: Bools
    temperature: float
    exact_ends: bool
    temperature_estimate: TemperatureEstimate | None = None
    doubts: tuple[str, ...] = ()
    ties: TieClass | None = None
    weights: tuple[WeightEstimate, ...] = ()
    next_tasks: tuple[NextTask, ...] = ()

    @cached_property
    def size_bias(self) -> SizeBias | None:
        """How gains go with the sizes of regions; None where all are of one size."""
        return size_bias(self.inference)

    @cached_property
    def rank_errors(self) -> RankErrors | None:
        """How surely ranks are known; None where nothing is sampled."""
        return None if self.inference.sampling is None else rank_errors(self.inference)

    @property
    def assumptions(self) -> list[str]:
        """What the answer takes for granted, a phrase each."""
        inference = self.inference
        breaking = inference.rule_breaking
        estimate = self.temperature_estimate
        of_rules = f"{inference.rates.rule_breaking:g}" if breaking is None else f"{breaking}"
        return [
            "at most one region is forbidden",
            f"prior of none {inference.prior_none:g}, {_shared(inference.size_prior)}",
            f"model error {inference.rates.model_error:g}"
            if inference.calibration is None
            else "evidence calibrated as if people moved like the simulated demonstrator",
            f"rule breaking {of_rules}",
            f"temperature {self.temperature:g}"
            if estimate is None
            else f"temperature {self.temperature:g} ({estimate.summary()})",
            f"paths begin and end at {'states' if self.exact_ends else 'cells'}",
            str(inference.crossing),
            *([] if inference.sampling is None else ["probabilities from sampled paths, no cells"]),
        ]

    def record(self) -> dict[str, Any]:
        """The answer for programs, fit for JSON: infinite and missing numbers are None."""
        inference, names = self.inference, self.inference.hypotheses.names
        credible = inference.credible
        space, first = inference.hypotheses.space, self.support.region
        return {
            "first": {
                "region": names[first],
                "gain": finite(inference.gain[first]),
                "posterior": float(inference.posterior[first]),
            },
            "posterior_none": inference.posterior_none,
            "credible_set": {
                "share": credible.share,
                "probability": credible.probability,
                "no_constraint": credible.has_none,
                "regions": [names[i] for i in credible.regions],
                "areas": [
                    {
                        "regions": [names[i] for i in area.regions],
                        "probability": area.probability,
                        "lower": dict(zip(space.names, map(finite, area.hull.lower), strict=True)),
                        "upper": dict(zip(space.names, map(finite, area.hull.upper), strict=True)),
                    }
                    for area in credible.areas
                ],
            },
            "assumptions": self.assumptions,
            "crossing": asdict(inference.crossing),
            "demonstrations": [
                {
                    "name": name,
                    "share_of_gain": float(self.support.share[j]),
                    "first_without": names[self.support.first_without[j]],
                    "regions": int(self.misfit.count[j]),
                    "regions_p": finite(self.misfit.count_p[j]),
                    "distance": float(self.misfit.distance[j]),
                    "distance_p": finite(self.misfit.distance_p[j]),
                    "unlike_p": finite(self.misfit.unlike_p[j]),
                }
                for j, name in enumerate(inference.names)
            ],
            "temperature_estimate": None
            if self.temperature_estimate is None
            else self.temperature_estimate.record(),
            "sampling": self.rank_errors and sampling_record(inference, self.rank_errors),
            "tie_class": self.ties and self.ties.record(names),
            "weights": [estimate.record() for estimate in self.weights],
            "size_bias": None if self.size_bias is None else self.size_bias.record(),
            "next_tasks": [each.record(space) for each in self.next_tasks],
            "unseen": [names[i] for i in self.unseen],
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        """What a reader should know before believing the answer, those of the recordings first."""
        phrases = [*self.doubts, *self.inference.warnings]
        phrases += self.misfit.warnings(self.inference.names)
        if self.temperature_estimate is not None:
            phrases += self.temperature_estimate.warnings
        if len(self.unseen):
            phrases.append(
                f"none of the tasks could have shown {len(self.unseen)} of {len(self.cut)} "
                "regions, which hardly any path enters: that they are avoided says nothing"
            )
        if self.size_bias is not None:
            phrases += self.size_bias.warnings
        if np.any(self.cut):
            space = self.inference.hypotheses.space
            sides = " and ".join(
                space.names[d].replace("_", " ") for d in np.flatnonzero(np.any(self.cut, axis=0))
            )
            phrases.append(
                f"the grid cuts {int(np.sum(np.any(self.cut, axis=1)))} of {len(self.cut)} "
                f"regions: their borders in {sides} are no borders of cells"
            )
        return phrases


def answer(
    model: Model,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    *,
    hypotheses: Bools | None = None,
    round_horizon: bool = False,
    exact_ends: bool = True,
    samples: int = SAMPLES,
    simulated: ArrayLike = (),
    temperature: TemperatureEstimate | None = None,
    doubts: Sequence[str] = (),
    weights: Sequence[WeightEstimate] = (),
    next_tasks: Sequence[NextTask] = (),
) -> Answer:
    """Look at an inference from all sides.

    Args:
        model: the model.
        demonstrations: the N that the inference is from.
        inference: what `infer` made of them, with the arguments below.
        hypotheses: (C',) mask over the model's regions; None takes all.
        round_horizon: as of `infer`.
        exact_ends: as of `infer`.
        samples: as of `misfit`.
        simulated: as of `misfit`: `Calibration.excess`, where there is a calibration.
        temperature: what `mlci.temperature.estimate_temperature` made of the demonstrations.
        doubts: about the recordings themselves.
        weights: what `mlci.soft.weight.estimate_weights` made of the demonstrations.
        next_tasks: what `mlci.next_task.next_tasks` says is to be recorded next.
    """
    distributions = (
        distribution_of(model, each.task, round_horizon=round_horizon, exact_ends=exact_ends)
        for each in demonstrations
    )
    cut, ties = of_cells(model, inference, hypotheses)
    return Answer(
        inference=inference,
        support=support(inference),
        misfit=misfit(
            distributions,
            inference.phi,
            inference.violated,
            hypotheses=hypotheses,
            samples=samples,
            simulated=simulated,
        ),
        unseen=unseen(inference),
        cut=cut,
        temperature=model.temperature,
        exact_ends=exact_ends,
        temperature_estimate=temperature,
        doubts=tuple(doubts),
        ties=ties,
        weights=tuple(weights),
        next_tasks=tuple(next_tasks),
    )


@singledispatch
def of_cells(
    model: Model, inference: Inference, hypotheses: Bools | None
) -> tuple[Bools, TieClass | None]:
    """What only cells tell: `Answer.cut` and `Answer.ties`; nothing without cells."""
    return np.zeros(inference.hypotheses.lower.shape, dtype=bool), None


@of_cells.register
def _(
    model: TabularModel, inference: Inference, hypotheses: Bools | None
) -> tuple[Bools, TieClass | None]:
    return cut_by(model.grid, inference.hypotheses), tie_class(model, inference, hypotheses)


def unseen(inference: Inference) -> Ints:
    """Numbers of the regions that no demonstration violates and that none was likely to.

    Without a constraint, N such demonstrations would be expected to enter them less than 0.05
    times.
    """
    expected = np.sum(inference.phi[inference.reachable], axis=0)
    return np.flatnonzero((expected < _RARELY_ENTERED) & ~np.any(inference.violated, axis=0))


def cut_by(grid: Any, regions: Regions) -> Bools:
    """(C, n) whether a region has a side, within the bounds, that is no border of equal cells.

    The border of a shape that is not its own hull counts in each dimension that it depends on.
    """
    cut = np.zeros((len(regions), regions.space.dimension), dtype=bool)
    if not isinstance(grid, Grid):
        return cut
    origin, bounds = grid.corners[0][0], regions.space.bounds
    for side in (regions.lower, regions.upper):
        inside = np.isfinite(side) & (
            regions.space.periodic | ((side > bounds.lower) & (side < bounds.upper))
        )
        cells = np.where(inside, (side - origin) / grid.widths, 0.0)
        cut |= np.abs(cells - np.round(cells)) > _SAME_SIDE
    for i in np.flatnonzero(~regions.are_boxes).tolist():
        shapes = regions.shape(i), Cuboid(regions.box(i))
        size, of_hull = (volume_share(regions.space, shape) for shape in shapes)
        if size < of_hull * (1 - _SAME_SIDE):  # a side that is not along the axes
            cut[i] = np.isfinite(regions.lower[i])
    return cut


def _shared(size_prior: float) -> str:
    """How the prior goes to regions."""
    power = f"by size to the power of {-size_prior:g}" if size_prior else "equally"
    return f"the rest shared {power}"
