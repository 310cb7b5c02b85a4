"""Belief over areas that have a shape, where a config asks for it: its table and its record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from experiments.config.settings import ModelSettings
from mlci.areas.belief import AreaBelief, infer_area
from mlci.areas.evidence import ShapeEvidence
from mlci.areas.prior_shapes import apart, draw_shapes
from mlci.demonstrations import Demonstration
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.json_numbers import finite
from mlci.spaces import Bools
from mlci.tabular import TabularModel

_POINTS = 2304  # of the raster, 48 x 48 where two dimensions are bounded


def area_belief(
    settings: ModelSettings,
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    rng: np.random.Generator,
) -> AreaBelief | None:
    """What demonstrations say of an area of one or two shapes; None where nobody asks.

    Args:
        settings: what shapes are drawn.
        model: the tabular model.
        demonstrations: the N demonstrations.
        inference: what they say of hypotheses, for its rate of rule breaking.
        rng: of shapes, trajectories and draws of the posterior.
    """
    if not settings.inference.shapes.count:
        return None
    evidence = shape_evidence(settings, model, demonstrations, inference, rng)
    together = pairs_together(settings, evidence)
    return infer_area(evidence, rng, sizes(settings), together=together)


def sizes(settings: ModelSettings) -> tuple[float, float, float]:
    """Prior probabilities that nothing is forbidden, one shape, or two."""
    some, pair = 1 - settings.inference.prior, settings.inference.shapes.pair
    return 1 - some, some * (1 - pair), some * pair


def pairs_together(settings: ModelSettings, evidence: ShapeEvidence) -> Bools | None:
    """(C, C) which pairs of shapes may be forbidden together; None where all may."""
    return apart(evidence.inside) if settings.inference.shapes.apart else None


def shape_evidence(
    settings: ModelSettings,
    model: TabularModel,
    demonstrations: Sequence[Demonstration],
    inference: Inference,
    rng: np.random.Generator,
) -> ShapeEvidence:
    """What demonstrations say of shapes; a calibration says nothing of these, the model error does.

    Shapes are bounded in the dimensions in which cells of `hypotheses.shape` are.
    """
    asked, space = settings.inference.shapes, settings.model.space
    free = free_dimensions(settings)
    shapes = draw_shapes(
        space,
        asked.count,
        asked.smallest,
        asked.largest,
        rng,
        free=free,
        boxes=asked.kind == "boxes",
    )
    side = round(_POINTS ** (1 / int(np.sum(~free))))
    return ShapeEvidence.of(
        model,
        demonstrations,
        shapes,
        Grid(space, tuple(np.where(free, 1, side).tolist())),
        Rates(settings.inference.model_error, inference.rates.rule_breaking),
        samples=asked.samples,
        rng=rng,
        exact_ends=settings.inference.exact_ends,
    )


def free_dimensions(settings: ModelSettings) -> Bools:
    """(n,) the dimensions that cells of hypotheses leave free."""
    cells, dimension = settings.hypotheses.shape, settings.model.space.dimension
    return np.array([count is None for count in cells or (1,) * dimension])


def area_table(belief: AreaBelief) -> pd.DataFrame:
    """A row a point of the raster: its number and place, its `chance`, and whether it is `inside`.

    Dimensions that no shape bounds are left out.
    """
    raster, space = belief.raster, belief.raster.space
    places = {
        name: raster.centers[:, d] for d, name in enumerate(space.names) if raster.shape[d] > 1
    }
    return pd.DataFrame(
        {"point": np.arange(raster.size), **places, "chance": belief.chance, "inside": belief.area}
    )


def area_record(belief: AreaBelief) -> dict[str, Any]:
    """The belief for programs, fit for JSON."""
    names = belief.raster.space.names
    parts = [
        {
            "lower": dict(zip(names, map(finite, part.hull.lower), strict=True)),
            "upper": dict(zip(names, map(finite, part.hull.upper), strict=True)),
            "probability": part.probability,
        }
        for part in belief.parts
    ]
    return {
        "none": float(belief.sizes[0]),
        "one_shape": float(belief.sizes[1]),
        "two_shapes": float(belief.sizes[2]),
        "expected_overlap": finite(belief.overlap),
        "parts": parts,
    }
