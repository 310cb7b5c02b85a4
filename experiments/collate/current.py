"""Whether a study's tables are those that collating would make now; light, as many sweeps ask."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.collate.cases import case_names
from experiments.tracking.files import digest
from experiments.tracking.forms import sound_study
from experiments.tracking.points import Point
from experiments.tracking.study import Study, collated
from experiments.tracking.study_tables import table_changes
from experiments.tracking.trees import canonical_json

Records = Mapping[str, Mapping[str, Any]]


def made_of(records: Records, study: Study | None) -> str:
    """Hash of all that tables are made of: what points wrote, and the study's cases and examples.

    Args:
        records: of the points, by identity; each has the digests of the point's tables.
        study: the study as it is planned; None if it is not.
    """
    names = case_names(study.points) if study else {}
    examples = study.examples if study else {}
    return digest(canonical_json([records, list(names.items()), examples]))


def is_current(points: Sequence[Point], folder: Path, *, mixed: bool = False) -> bool:
    """Whether the tables of a study are there, and collating would change nothing.

    What the study lists is compared with what it would list, and not with what it listed before a
    sweep: one that was stopped has written its plan, and no table.

    Args:
        points: the points, in any order; each finished, and its files whole.
        folder: the study's folder.
        mixed: whether points may come from different versions of the source.
    """
    study = sound_study(folder)
    if study is None or study.collated is None:
        return False
    listed, changes = study.collated, table_changes(study)
    records = {point.identity: point.note("record") or {} for point in points}
    if {*listed.points} != {*records} or not all(records.values()):
        return False
    in_order = {identity: records[identity] for identity in listed.points}
    now = collated(in_order, listed.tables, listed.kept, made_of(records, study))
    is_listed = now == listed and (mixed or len(now.sources) <= len(now.systems))
    return is_listed and not changes.missing and not changes.damaged
