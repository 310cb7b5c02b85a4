"""Answers for tests of the page: made by hand, of any size and with any names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mlci.answers import Answer, unseen
from mlci.demonstrations import Demonstration
from mlci.evidence import Rates
from mlci.inference import Inference
from mlci.misfit import Misfit
from mlci.regions import Regions
from mlci.spaces import Box, StateSpace
from mlci.support import support

CIRCLE = StateSpace(
    Box([0.0, -6.0], [2 * np.pi, 6.0]), [True, False], ("angle", "speed"), ("rad", "rad/s")
)


def wave(number: int, space: StateSpace = CIRCLE, name: str = "") -> Demonstration:
    """A path that winds, and sways in the other dimensions."""
    time, n = np.linspace(0, 1, 501), space.dimension
    bounds = space.bounds
    sway = np.sin(2 * np.pi * np.outer(time, 1 + np.arange(n)) + number)
    states = bounds.lower + bounds.widths * (0.5 + 0.15 * sway)
    states[:, space.periodic] += (2 * time * bounds.widths[0])[:, None]
    return Demonstration.from_path(states, 0.01, name=name or f"path_{number}")


def answer_of(
    regions: Regions, names: Sequence[str], rates: Rates | None = None
) -> tuple[Answer, list[Demonstration]]:
    """Of demonstrations with these names: what they enter is true, what was likely is random."""
    rng = np.random.default_rng(0)
    paths = [wave(j, regions.space, name) for j, name in enumerate(names)]
    violated = np.array([regions.violated_by(each.states) for each in paths])
    shape = violated.shape
    avoidance = np.where(rng.random(shape) < 0.3, 1.0, rng.random(shape) ** 0.2)
    avoidance[:, -1] = 1.0  # nobody could have shown the last one
    reachable = np.arange(len(names)) != 1
    avoidance[~reachable] = 1.0
    decided = np.zeros(shape, dtype=bool)
    decided[0, 0] = True
    inference = Inference(
        regions,
        tuple(names),
        avoidance,
        violated,
        reachable,
        rates=rates or Rates(0.1),
        decided_by_cell=decided,
    )
    none = np.full(shape[0], np.nan)
    return (
        Answer(
            inference=inference,
            support=support(inference),
            misfit=Misfit(violated.sum(axis=1), violated.sum(axis=1), none, none, none, none),
            unseen=unseen(inference),
            cut=np.zeros((shape[1], regions.space.dimension), dtype=bool),
            temperature=1.0,
            exact_ends=True,
        ),
        paths,
    )
