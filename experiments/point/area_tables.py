"""How well sets of hypotheses cover the truth, by several ways to infer them.

All of them see the same demonstrations, with the evidence of the model error:

* `single`: the best hypothesis of the ranking;
* `neighbourhood`: the most probable area of the ranking (`mlci.best_areas`);
* `greedy`: hypotheses added while each explains more than 0.1 nat a demonstration;
* `climb`: hypotheses added while the posterior of the set rises, by a prior under which neighbours
  are forbidden together, and pruned of those without which it is no less probable.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.best_areas import most_probable_area
from mlci.credible_sets import neighbours
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.metrics import random_subsets
from mlci.regions import Regions
from mlci.sets.evidence import SetEvidence
from mlci.sets.posterior import SetPrior
from mlci.sets.selection import select_regions
from mlci.spaces import Bools, Floats

_LEAST = 0.1  # nat a demonstration, as published
_POINTS = 90_000  # at which hypotheses are compared with the truth


def area_tables(settings: Settings, point: PointInference) -> dict[str, pd.DataFrame]:
    """The tables `areas` and `area_map`.

    Returns:
        `areas`, a row a subset of the demonstrations and `method`: how many `regions` it takes,
        and of their union `iou` with the truth, `precision` and `recall`, shares of volume.
        `area_map`, a row a hypothesis: its share `in_truth`; and for each number of demonstrations
        the share of subsets in whose `climb` it is, nan where there are fewer demonstrations.
    """
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
    inside, outside, missed = _volumes(cells, settings.constraint)
    rng = stream(settings.seed, Purpose.AREAS, 0)
    most, count = max(asked.demonstrations), len(inference.names)
    by_size = {s.shape[1]: s for s in random_subsets(count, most, asked.subsets, rng)}
    rows, shares = [], {}
    for size in sorted(set(asked.demonstrations) & set(by_size)):
        shares[size] = np.zeros(len(cells))
        for number, subset in enumerate(by_size[size]):
            seen = evidence.of_some(subset)
            gain = inference.of(subset).gain
            found = {
                "single": np.arange(len(cells)) == int(np.argmax(gain)),
                "neighbourhood": most_probable_area(gain, touching),
                "greedy": select_regions(seen, cells.names, _LEAST).mask,
                "climb": select_regions(seen, cells.names, 0.0, prior=prior, prune=True).mask,
            }
            shares[size] += found["climb"] / len(by_size[size])
            rows += [
                {
                    "demonstrations": size,
                    "subset": number,
                    "method": method,
                    **_scores(mask, inside, outside, missed),
                    "regions": int(np.sum(mask)),
                }
                for method, mask in found.items()
            ]
    none = np.full(len(cells), np.nan)
    columns = {f"climb_{size}": shares.get(size, none) for size in sorted(asked.demonstrations)}
    of_cells = {"hypothesis": np.arange(len(cells)), "in_truth": inside / (inside + outside)}
    return {"areas": pd.DataFrame(rows), "area_map": pd.DataFrame({**of_cells, **columns})}


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
