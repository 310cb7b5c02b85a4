"""Where baselines put the truth, on the same random subsets of demonstrations as ours."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.baselines import BASELINES
from mlci.evidence import log_evidence, rank_scores, total_gain
from mlci.maxent import TrajectoryDistribution
from mlci.metrics import random_subsets
from mlci.spaces import Floats

SIZES = (1, 3, 5, 9, 20)  # numbers of demonstrations that are compared
OURS, PAPER = "ours", "paper"  # our evidence with its rates, and the paper's


def baseline_table(settings: Settings, point: PointInference) -> pd.DataFrame:
    """A row a method and number of demonstrations.

    Returns:
        `method`, a name of `mlci.baselines.BASELINES`, `ours` or `paper`; `demonstrations`; and
        over random subsets, the same for all methods, `rank`, the mean rank of the truth,
        `log_rank`, the mean of its natural logarithm, `top`, how often it is among the first
        `ranks.top`, and `first`, how often it is first alone. Missing without a truth that covers a
        hypothesis.
    """
    inference, model = point.inference, point.tabular
    truth = inference.hypotheses.inside(settings.constraint)
    rng = stream(settings.seed, Purpose.BASELINES, 0)
    parts = {
        name: each.parts(model, point.demonstrations, settings.baselines.paths, rng)
        for name, each in BASELINES.items()
    }
    subsets = random_subsets(
        len(inference.names), max(SIZES), settings.ranks.subsets,
        stream(settings.seed, Purpose.SUBSETS, 0),
    )  # fmt: skip
    paper = _paper_evidence(point)
    rows = []
    for numbers in subsets:
        if numbers.shape[1] not in SIZES or not truth.any():
            continue
        entered = np.any(inference.violated[numbers], axis=1)
        scores = {OURS: total_gain(inference.evidence[numbers]), PAPER: total_gain(paper[numbers])}
        for name, each in BASELINES.items():
            combined = each.combine(parts[name][:, point.hypotheses][numbers])
            scores[name] = np.where(entered, -np.inf, combined)
        for name, score in scores.items():
            rank = np.min(rank_scores(score, score > -np.inf)[:, truth], axis=1)
            rows.append(
                {
                    "method": name,
                    "demonstrations": numbers.shape[1],
                    "rank": np.mean(rank),
                    "log_rank": np.mean(np.log(rank)),
                    "top": np.mean(rank <= settings.ranks.top),
                    "first": np.mean(rank == 1),
                }
            )
    return pd.DataFrame(
        rows, columns=["method", "demonstrations", "rank", "log_rank", "top", "first"]
    )


def _paper_evidence(point: PointInference) -> Floats:
    """(N, C) of trajectories from cell to cell, without rates."""
    inference = point.inference
    avoidance = np.ones(inference.avoidance.shape)
    for j, demonstration in enumerate(point.demonstrations):
        distribution = TrajectoryDistribution.of_task(
            point.tabular, demonstration.task, round_horizon=True
        )
        if distribution.is_possible:
            avoidance[j] = distribution.avoidance_probabilities()[point.hypotheses]
    return log_evidence(avoidance, inference.violated)
