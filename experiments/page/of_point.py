"""The page of a point of a study, from its config and what the store holds of it."""

from __future__ import annotations

import numpy as np

from experiments.config.read import settings_of_record
from experiments.config.settings import Settings
from experiments.config.settings.controls import ranges_of
from experiments.lookback.archive import ArchiveError, Facts
from experiments.page.beliefs import belief_sentences
from experiments.page.document import page
from experiments.page.words import where
from experiments.point.inference import infer_point, point_answer
from experiments.point.truth_draw import with_truth
from experiments.tracking.points import State
from experiments.tracking.store import Store
from mlci.inference import Inference
from mlci.misfit import listed

_SHORT = 12  # characters of an identity in the title


def point_page(facts: Facts) -> str:
    """The page of a finished point, its truth outlined.

    The ranking is computed again, as a point keeps no evidence of single demonstrations; what takes
    time comes from the store.

    Raises:
        ArchiveError: the point has not finished, or with other source, whose numbers are not those
            that would be shown.
    """
    identity = facts.point.identity
    if not facts.record:
        raise ArchiveError(f"{identity}: has not finished; run it first")
    if facts.state is not State.DONE:
        raise ArchiveError(f"{identity}: the source has changed since it ran; run it again first")
    store = Store(facts.point.results / "store")
    settings = with_truth(settings_of_record(facts.record["config"]), store)
    inferred = infer_point(settings, store)
    calibration, names = inferred.calibration, settings.model.space.names
    concerns, tasks = [], len(inferred.numbers)
    if inferred.diagnosis is not None:
        concerns = inferred.diagnosis.concerns(names, inferred.unreachable, tasks)
    return page(
        point_answer(settings, inferred),
        inferred.demonstrations,
        title=f"Point {identity[:_SHORT]}: what simulated demonstrators avoided",
        about=_about(settings, inferred.inference),
        beliefs=belief_sentences(inferred.beliefs),
        assumed=[] if calibration is None else [calibration.summary()],
        doubtful=concerns,
        truth=settings.constraint,
    )


def _about(settings: Settings, inference: Inference) -> str:
    """What the point is, and where the ranking has the truth."""
    options = ", ".join(f"{name} {value}" for name, value in settings.columns.items())
    truth, regions = settings.constraint, inference.hypotheses
    if settings.truth.controls:
        controls = listed(ranges_of(settings.truth.controls, settings.model).names)
        return f"{options}. Forbidden in truth: {controls}."
    if not len(truth):
        return f"{options}. Nothing is forbidden in truth."
    boxes = "; ".join(where(truth, i) for i in range(len(truth)))
    covered = np.flatnonzero(regions.inside(truth))
    found = [f"{regions.names[i]} at place {inference.ranking.rank[i]:g}" for i in covered]
    inside = f"Regions inside it: {listed(found)}." if found else "No region lies inside it."
    return f"{options}. Forbidden in truth: {boxes}. {inside}"
