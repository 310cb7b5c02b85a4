"""How many demonstrations it takes if each task is chosen for what it teaches, or is random.

The tasks are those of the point's demonstrations, and there are two sources of demonstrations.
Those of the `demonstrator` are the study's own; those of the `model` are drawn from the tabular
model under the truth, between cells, and the paper's evidence is right for them. Each repetition
takes a random part of the tasks, its *pool*. A chosen task is the one of the pool that promises
most information after the demonstrations before it (`mlci.next_task`); its own demonstration is not
looked at. Random tasks come in random order.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from experiments.config.settings import Settings
from experiments.point.inference import PointInference
from experiments.point.streams import Purpose, stream
from mlci.best_areas import area_scores
from mlci.credible_sets import neighbours
from mlci.demonstrations import Task
from mlci.evidence import posterior, rank_evidence, total_gain
from mlci.inference import Inference
from mlci.maxent import TrajectoryDistribution
from mlci.next_task import plausible, simulate_tasks
from mlci.preparation import prepare
from mlci.region_sizes import weights_by_size
from mlci.spaces import Bools, Ints
from mlci.task_outcomes import TaskOutcomes

SURE = 0.95  # posterior of the truth
EARLY = 5  # demonstrations after which the best regions and areas are compared with the truth

_OF_MODEL = 2  # streams of its demonstrations; 0 and 1 are of the sources' pools

COLUMNS = ["source", "repetition", "way", "tried", "sure", "settled"]
COLUMNS += ["best_overlaps", "two_overlap", "area_overlaps"]
_LIKELIEST = ("likeliest_overlaps", "likeliest_precision", "likeliest_share")  # area
COLUMNS += _LIKELIEST


@dataclass(frozen=True, eq=False)
class _Pool:
    """Tasks and what there is of each.

    Attributes:
        outcomes: what a demonstration of each of N tasks may show.
        shown: the inference from the N demonstrations of a repetition, by its number.
    """

    outcomes: list[TaskOutcomes]
    shown: Callable[[int], Inference]


def next_task_table(settings: Settings, point: PointInference) -> pd.DataFrame:
    """A row a source, repetition and way to pick tasks, `chosen` or `random`.

    Returns:
        `tried`, how many demonstrations were made; `sure`, after how many the truth came first
        with a posterior above 0.95, and `settled`, from how many on it came first until all were
        made, both missing where that never was; and, after five, whether the best region, both of
        the best two, and the most probable area of the credible set overlap the truth; and of the
        most probable area (`mlci.best_areas`) whether it does, the share of its regions that do,
        and the share of all regions that it takes.
    """
    pools = {"model": _model_pool(settings, point), "demonstrator": _own_pool(settings, point)}
    rows = []
    for number, (source, pool) in enumerate(pools.items()):
        for repetition in range(settings.next_task.repetitions):
            rng = stream(settings.seed, Purpose.NEXT_TASK, number, repetition)
            order = rng.permutation(len(pool.outcomes))[: settings.next_task.pool]
            shown, most = pool.shown(repetition), min(settings.next_task.most, len(order))
            for way, picked in (
                ("chosen", chosen_order(pool.outcomes, shown, order, most)),
                ("random", order[:most]),
            ):
                opening = {"source": source, "repetition": repetition, "way": way, "tried": most}
                found = found_after(shown.of(picked), shown.hypotheses.inside(settings.constraint))
                rows.append({**opening, **found, **_early(settings, shown.of(picked[:EARLY]))})
    return pd.DataFrame(rows, columns=COLUMNS)


def chosen_order(outcomes: list[TaskOutcomes], shown: Inference, pool: Ints, most: int) -> Ints:
    """The tasks of a pool in the order in which they are chosen, `most` of them."""
    left = pool.tolist()
    picked: list[int] = []
    prior = shown.prior_none, weights_by_size(shown.hypotheses, shown.size_prior)
    for _ in range(most):
        belief = plausible(np.append(*posterior(total_gain(shown.evidence[picked]), *prior)))
        best = max(left, key=lambda number: float(outcomes[number].information(belief)))
        left.remove(best)
        picked.append(best)
    return np.array(picked, dtype=np.int64)


def found_after(inference: Inference, truth: Bools) -> dict[str, float]:
    """After how many of the demonstrations, in their order, the truth (C,) is found."""
    count = len(inference.names)
    if not (count and truth.any()):
        return {"sure": np.nan, "settled": np.nan}
    prior = inference.prior_none, weights_by_size(inference.hypotheses, inference.size_prior)
    evidence, violated = inference.evidence, inference.violated
    rankings = [rank_evidence(evidence[:n], violated[:n], *prior) for n in range(1, count + 1)]
    rank = np.array([ranking.rank for ranking in rankings])
    leads = np.min(rank[:, truth], axis=1) < np.min(rank[:, ~truth], axis=1, initial=np.inf)
    belief = np.array([ranking.posterior for ranking in rankings])
    sure = leads & (np.sum(belief[:, truth], axis=1) > SURE)
    return {
        "sure": int(np.argmax(sure)) + 1 if sure.any() else np.nan,
        "settled": int(np.max(np.flatnonzero(~leads), initial=-1)) + 2 if leads[-1] else np.nan,
    }


def _early(settings: Settings, inference: Inference) -> dict[str, float]:
    """What of the first demonstrations' answer overlaps the truth."""
    overlaps = inference.hypotheses.overlaps(settings.constraint)
    if len(inference.names) < EARLY or not overlaps.any():
        return dict.fromkeys(("best_overlaps", "two_overlap", "area_overlaps", *_LIKELIEST), np.nan)
    best, areas = overlaps[inference.order[:2]], inference.credible.areas
    hypotheses = inference.hypotheses
    likeliest = area_scores(inference.gain[None], neighbours(hypotheses), overlaps)
    values = (likeliest.overlap, likeliest.precision, likeliest.share)
    return {
        **dict(zip(_LIKELIEST, (float(value[0]) for value in values), strict=True)),
        "best_overlaps": int(best[0]),
        "two_overlap": int(np.all(best)),
        "area_overlaps": int(bool(areas) and np.any(overlaps[areas[0].regions])),
    }


def _own_pool(settings: Settings, point: PointInference) -> _Pool:
    """The point's demonstrations, of tasks that the tabular model can do."""
    tasks = [each.task for each in point.demonstrations]
    simulated = _simulated(
        settings, point, point.inference, tasks, exact_ends=settings.inference.exact_ends
    )
    possible = np.flatnonzero([each is not None for each in simulated])
    shown = point.inference.of(possible)
    return _Pool([each for each in simulated if each is not None], lambda _: shown)


def _model_pool(settings: Settings, point: PointInference) -> _Pool:
    """Demonstrations of the same tasks by the tabular agent under the truth, between cells."""
    constrained, repetitions = point.tabular.under(point.truth), settings.next_task.repetitions
    tasks, crossed = [], []
    for number, demonstration in enumerate(point.demonstrations):
        under_truth = TrajectoryDistribution.of_task(constrained, demonstration.task)
        if under_truth.is_possible:
            rng = stream(settings.seed, Purpose.NEXT_TASK, _OF_MODEL, number)
            cells, moves = under_truth.sample(repetitions, rng)
            crossed.append(point.tabular.crossed(cells[:, :-1], moves)[:, point.hypotheses])
            tasks.append(demonstration.task)
    prepared = prepare(point.tabular, tasks, hypotheses=point.hypotheses, exact_ends=False)
    shown = [
        Inference(
            prepared.hypotheses,
            tuple(map(str, range(len(tasks)))),
            prepared.avoidance,
            np.array([of_task[repetition] for of_task in crossed], dtype=bool),
            prepared.reachable,
            settings.inference.prior,
            size_prior=settings.inference.size_prior,
        )
        for repetition in range(repetitions if tasks else 0)
    ]
    simulated = _simulated(settings, point, shown[0], tasks, exact_ends=False) if shown else []
    return _Pool([each for each in simulated if each is not None], shown.__getitem__)


def _simulated(
    settings: Settings,
    point: PointInference,
    inference: Inference,
    tasks: list[Task],
    *,
    exact_ends: bool,
) -> list[TaskOutcomes | None]:
    """What demonstrations of tasks may show."""
    return simulate_tasks(
        point.tabular,
        inference,
        tasks,
        hypotheses=point.hypotheses,
        samples=settings.next_task.samples,
        seed=settings.seed,
        exact_ends=exact_ends,
    )
