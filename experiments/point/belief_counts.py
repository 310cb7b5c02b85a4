"""Whether what is believed with probability p is so in a share p of simulated worlds.

A world has one hypothesis for its truth, or none, as often as the prior says. In it, demonstrations
are shown from two sources. Those of the `demonstrator` are the study's own; how far off the
posterior is for them is the error of the tabular model. Those of the `model` are drawn from the
tabular model under the truth, and for them the posterior must be exactly calibrated, or a formula
is wrong. For that, tasks must tell nothing of the truth: a set's tasks are drawn without regard to
it, and a set with a task that cannot be solved under the truth shows nothing, but counts as drawn.
(Whoever drew such tasks anew would see more of the tasks that the truth allows, and the posterior,
which takes tasks as given, would be off.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.evidence import confidence, printed_confidence
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.simulate import step_count
from mlci.spaces import Bools, Floats, Ints
from mlci.tabular import TabularModel

# Probabilities are counted between these; most hypotheses are unlikely, so the first are narrow.
EDGES = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0)
_DECIMALS = 9  # of a probability that is put into a bin: what differs beyond is rounding
COLUMNS = ["source", "prior", "sets", "set", "demonstrations", "belief", "bin", "count"]
COLUMNS += ["predicted", "hits"]
_DRAWS = 1000  # of a task until one can be solved


def belief_counts(settings: Settings, point: PointInference) -> pd.DataFrame:
    """What is believed of one world, counted by how probable it is believed to be.

    Args:
        settings: the point; its truth is one hypothesis, or nothing.
        point: its model, and what its own demonstrations say.

    Returns:
        A row a source, set, number of demonstrations, kind of belief and bin: `prior` of the
        world; how many `sets` were drawn; how many beliefs fell into the bin (`count`), the sum of
        their probabilities (`predicted`), and how many were right (`hits`).
    """
    inference, calibration = point.inference, settings.calibration
    hypotheses, cell = len(inference.hypotheses), settings.truth.number
    truth = np.arange(hypotheses) == (-1 if cell is None else cell)
    prior_none = inference.prior_none
    world = {"prior": prior_none if cell is None else (1 - prior_none) / hypotheses}
    longest = max(calibration.demonstrations)
    of_demonstrator = [
        inference.of(slice(first, first + longest))
        for first in range(0, len(inference.names) - longest + 1, longest)
    ]
    constrained = point.tabular.under(point.truth)
    of_model = [
        _model_set(settings, point, constrained, number) for number in range(calibration.sets)
    ]
    rows = []
    for source, sets in (("demonstrator", of_demonstrator), ("model", of_model)):
        for number, of_set in enumerate(sets):
            for count in calibration.demonstrations:
                if count > len(of_set.names):
                    continue
                opening = {"source": source, **world, "sets": len(sets), "set": number}
                for belief, probability, right in _beliefs(of_set.of(slice(count)), truth):
                    for counted in _binned(probability, right):
                        rows.append(
                            {**opening, "demonstrations": count, "belief": belief, **counted}
                        )
    return pd.DataFrame(rows, columns=COLUMNS)


def _beliefs(inference: Inference, truth: Bools) -> Iterator[tuple[str, Floats, Bools]]:
    """Each kind of belief: its name, probabilities and whether each is right.

    `each` is the exact posterior of every hypothesis, and `none` that there is no constraint. The
    others are of the most likely hypothesis: its exact posterior (`selected`), and (12), corrected
    and as printed, with P(C) as the paper means it, the probability that there is a constraint.
    """
    ranking, prior = inference.ranking, 1 - inference.prior_none
    yield "each", ranking.posterior, truth
    yield "none", np.array([ranking.posterior_none]), np.array([not truth.any()])
    best = int(ranking.order[0])
    if not ranking.feasible[best]:
        return
    right, avoidance = truth[[best]], inference.forecast[:, best]
    yield "selected", ranking.posterior[[best]], right
    yield "corrected", np.array([confidence(prior, avoidance)]), right
    yield "printed", np.array([printed_confidence(prior, avoidance)]), right


def bins_of(probability: Floats) -> Ints:
    """(B,) numbers of the bins of probabilities; 0 is below 0, one more than the last above 1."""
    rounded = np.round(probability, _DECIMALS)
    place = np.searchsorted(EDGES, rounded, side="right")
    return np.where(rounded == EDGES[-1], len(EDGES) - 1, place)


def _binned(probability: Floats, right: Bools) -> Iterator[dict[str, float]]:
    """Counts of each bin that holds something."""
    place = bins_of(probability)
    for number in np.unique(place):
        inside = place == number
        yield {
            "bin": int(number),
            "count": int(np.sum(inside)),
            "predicted": float(np.sum(probability[inside])),
            "hits": int(np.sum(right[inside])),
        }


def _model_set(
    settings: Settings, point: PointInference, constrained: TabularModel, number: int
) -> Inference:
    """Demonstrations from the tabular model under the truth, up to the first that there is not."""
    world = 0 if settings.truth.number is None else settings.truth.number + 1
    rng = stream(settings.seed, Purpose.MODEL_DEMONSTRATIONS, world, number)
    avoidance, violated = [], []
    for _ in range(max(settings.calibration.demonstrations)):
        distribution = _possible_task(settings, point.tabular, rng)
        under_truth = TrajectoryDistribution(
            constrained, distribution.start, distribution.goal, distribution.steps
        )
        if not under_truth.is_possible:
            break
        cells, moves = under_truth.sample(1, rng)
        violated.append(point.tabular.crossed(cells[0, :-1], moves[0])[point.hypotheses])
        avoidance.append(distribution.avoidance_probabilities()[point.hypotheses])
    shape = len(avoidance), len(point.inference.hypotheses)
    return Inference(
        point.inference.hypotheses,
        tuple(map(str, range(len(avoidance)))),
        np.reshape(avoidance, shape),
        np.reshape(violated, shape).astype(bool),
        np.ones(len(avoidance), dtype=bool),
        point.inference.prior_none,
    )


def _possible_task(
    settings: Settings, model: TabularModel, rng: np.random.Generator
) -> TrajectoryDistribution:
    """A task from the task box that the tabular agent can do where nothing is forbidden.

    Raises:
        RuntimeError: it can do none of many.
    """
    steps, box = (
        step_count(settings.horizon, settings.dt),
        settings.tasks.start_box(model.grid.space),
    )
    for _ in range(_DRAWS):
        start, goal = model.grid.index(rng.uniform(box.lower, box.upper, (2, len(box.lower))))
        distribution = TrajectoryDistribution(model, start, goal, steps)
        if distribution.is_possible:
            return distribution
    raise RuntimeError(
        f"none of {_DRAWS} tasks can be solved by the tabular agent: take a longer time step, more "
        "cells or transition.samples=3"
    )
