"""How well sets of hypotheses cover the truth, by several ways to infer them.

All of them see the same demonstrations, with the evidence of the model error:

* `single`: the best hypothesis of the ranking;
* `neighbourhood`: the most probable area of the ranking (`mlci.best_areas`);
* `greedy`: hypotheses added while each explains more than 0.1 nat a demonstration;
* `climb`: hypotheses added while the posterior of the set rises, by a prior under which neighbours
  are forbidden together, and pruned of those without which it is no less probable.

Where shapes are asked for, `experiments.point.shape_ways` adds areas of one or two of these.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import scipy  # loads scipy.sparse when it is first used

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.shape_ways import ShapeWays
from experiments.point.streams import Purpose, stream
from mlci.best_areas import most_probable_area
from mlci.credible_sets import neighbours
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.metrics import random_subsets
from mlci.regions import Regions
from mlci.sets.evidence import SetEvidence
from mlci.sets.posterior import SetPrior
from mlci.sets.selection import select_regions
from mlci.spaces import Bools, Floats, Ints

_LEAST = 0.1  # nat a demonstration, as published
_COLUMNS = (
    *("demonstrations", "subset", "method", "expected"),
    *("iou", "precision", "recall", "regions"),
)
_POINTS = 90_000  # at which hypotheses are compared with the truth


def area_tables(settings: Settings, point: PointInference) -> dict[str, pd.DataFrame]:
    """The tables `areas` and `area_map`.

    Returns:
        `areas`, a row a subset of the demonstrations and `method`: how many `regions` it takes,
        and of their union `iou` with the truth, `precision` and `recall`, shares of volume; and of
        areas of shapes the overlap that is `expected`. `area_map`, a row a hypothesis: its share
        `in_truth`; and for each number of demonstrations the mean share of it in the areas of
        `climb`, and of `shapes` where these are asked for; nan where there are fewer.
    """
    cells, asked = point.inference.hypotheses, settings.areas
    by_cells, by_shapes = _CellWays.of(settings, point), ShapeWays.of(settings, point)
    rng = stream(settings.seed, Purpose.AREAS, 0)
    most, count = max(asked.demonstrations), len(point.inference.names)
    by_size = {s.shape[1]: s for s in random_subsets(count, most, asked.subsets, rng)}
    rows: list[dict[str, object]] = []
    names = ("climb",) if by_shapes is None else ("climb", "shapes")
    columns = {
        f"{name}_{size}": np.full(len(cells), 0.0 if size in by_size else np.nan)
        for name in names
        for size in sorted(asked.demonstrations)
    }
    there = sorted(set(asked.demonstrations) & set(by_size))
    for size in there:
        for number, subset in enumerate(by_size[size]):
            opening = {"demonstrations": size, "subset": number}
            scores, mask = by_cells.scores(subset)
            shares = {"climb": mask.astype(float)}
            if by_shapes is not None:
                more, shares["shapes"] = by_shapes.scores(subset, (number, size))
                scores |= more
            rows += [
                {**opening, "method": method, "expected": np.nan, **row}
                for method, row in scores.items()
            ]
            for name, share in shares.items():
                columns[f"{name}_{size}"] += share / len(by_size[size])
    if by_shapes is not None and there:
        for size, method, row in by_shapes.chosen(there):
            rows.append({"demonstrations": size, "subset": 0, "method": method, **row})
    of_cells = {"hypothesis": np.arange(len(cells)), "in_truth": by_cells.in_truth}
    # Its columns are there also where too few demonstrations were kept for any row.
    return {
        "areas": pd.DataFrame(rows, columns=_COLUMNS),
        "area_map": pd.DataFrame({**of_cells, **columns}),
    }


@dataclass(frozen=True, eq=False)
class _CellWays:
    """Ways to infer an area as a set of hypotheses, and how these are scored.

    Attributes:
        settings: the point.
        inference: about the hypotheses, with the evidence of the model error.
        evidence: the same of sets of them.
        touching: who are neighbours.
        prior: of sets, for `climb`.
        inside: (C,) volume of each hypothesis in the truth.
        outside: (C,) its volume outside.
        missed: volume of the truth in no hypothesis.
    """

    settings: Settings
    inference: Inference
    evidence: SetEvidence
    touching: scipy.sparse.csr_matrix
    prior: SetPrior
    inside: Floats
    outside: Floats
    missed: float

    @classmethod
    def of(cls, settings: Settings, point: PointInference) -> _CellWays:
        """Those of a point."""
        inference = replace(
            point.inference,
            calibration=None,
            rates=Rates(settings.inference.model_error, point.inference.rates.rule_breaking),
        )
        cells, asked = inference.hypotheses, settings.areas
        evidence = SetEvidence.of(
            point.model,
            point.demonstrations,
            inference,
            hypotheses=point.hypotheses,
            exact_ends=settings.inference.exact_ends,
        )
        touching = neighbours(cells)
        prior = SetPrior.independent(len(cells), asked.log_odds, asked.adjacency, touching)
        volumes = _volumes(cells, settings.constraint)
        return cls(settings, inference, evidence, touching, prior, *volumes)

    @property
    def in_truth(self) -> Floats:
        """(C,) share of each hypothesis in the truth."""
        return self.inside / (self.inside + self.outside)

    def scores(self, subset: Ints) -> tuple[dict[str, dict[str, float]], Bools]:
        """How each way does with some demonstrations, by number; and the mask (C,) of `climb`."""
        seen, names = self.evidence.of_some(subset), self.inference.hypotheses.names
        gain = self.inference.of(subset).gain
        found = {
            "single": np.arange(len(names)) == int(np.argmax(gain)),
            "neighbourhood": most_probable_area(gain, self.touching),
            "greedy": select_regions(seen, names, _LEAST).mask,
            "climb": select_regions(seen, names, 0.0, prior=self.prior, prune=True).mask,
        }
        rows = {
            method: {
                **_scores(mask, self.inside, self.outside, self.missed),
                "regions": float(np.sum(mask)),
            }
            for method, mask in found.items()
        }
        return rows, found["climb"]


def _volumes(cells: Regions, truth: Regions) -> tuple[Floats, Floats, float]:
    """What of each hypothesis (C,) lies inside of the truth and outside, and the truth in none.

    Counted in points of a regular grid over the state space.
    """
    dimension = cells.space.dimension
    points = Grid(cells.space, (round(_POINTS ** (1 / dimension)),) * dimension).centers
    true = truth.signed_distance(points) < 0
    here = np.array(
        [
            cells.select(np.arange(len(cells)) == i).signed_distance(points) < 0
            for i in range(len(cells))
        ]
    )
    inside = np.sum(here & true, axis=1)
    return inside, np.sum(here, axis=1) - inside, float(np.sum(true & ~here.any(axis=0)))


def _scores(mask: Bools, inside: Floats, outside: Floats, missed: float) -> dict[str, float]:
    """Overlap of disjoint hypotheses with the truth; nan where there is nothing to divide by."""
    hit, wrong = float(np.sum(inside[mask])), float(np.sum(outside[mask]))
    truth = float(np.sum(inside)) + missed
    return {
        "iou": hit / (truth + wrong) if truth + wrong else np.nan,
        "precision": hit / (hit + wrong) if hit + wrong else np.nan,
        "recall": hit / truth if truth else np.nan,
    }
