"""The list of all figures, and how those that a study's tables allow are drawn."""

from __future__ import annotations

import io
import itertools
import signal
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd
from joblib import Parallel, delayed

from experiments.tracking.figure_notes import (
    figure_note,
    is_current,
    made_of,
    read_note,
    sentence,
    write_note,
)
from experiments.tracking.files import replace_file
from experiments.tracking.names import inner_path, is_name
from experiments.tracking.study_tables import TableError, read_tables
from paper_figures import (
    area_cover,
    arms,
    baselines,
    calibration_diagram,
    cell_errors,
    choice_effects,
    chosen_tasks,
    control_limits,
    dimensions,
    dynamics,
    early_overlap,
    final_state_error,
    forecast_diagram,
    hypothesis_map,
    overview,
    rank_curve,
    readings,
    rule_breaking,
    sampled_models,
    sampled_trajectories,
    soft_weights,
    start_points,
    state_space,
    success,
    success_cases,
    time_and_memory,
    transfer,
    violation_distance,
    wrong_model,
)
from paper_figures.rows import Unsuited
from paper_figures.style import save

# Every figure, by the name of its module, which its files have too. A module has
#   TABLES        the tables that it needs, each with the columns that it needs of it;
#   draw(**them)  the figure; it may raise Unsuited;
#   facts(**them) what the caption must say, a fact a line;
#   EACH          a column, if there is to be one figure for each of its values.
FIGURES: Mapping[str, ModuleType] = {
    module.__name__.rpartition(".")[2]: module
    for module in (
        overview,
        state_space,
        final_state_error,
        violation_distance,
        rank_curve,
        sampled_trajectories,
        hypothesis_map,
        calibration_diagram,
        forecast_diagram,
        start_points,
        time_and_memory,
        choice_effects,
        readings,
        area_cover,
        wrong_model,
        rule_breaking,
        chosen_tasks,
        early_overlap,
        soft_weights,
        sampled_models,
        transfer,
        control_limits,
        cell_errors,
        success,
        success_cases,
        baselines,
        dynamics,
        arms,
        dimensions,
    )
}


@dataclass
class Drawing:
    """The figures of a study, or of one module in it.

    Attributes:
        study: the study's folder.
        images: the PNG of each figure; a PDF and the caption's facts as text are beside it.
        notes: what is listed of each figure, by its name.
        reasons: for each module that drew nothing, why.
        damage: which tables are not as they were written.
        is_current: whether all was drawn before, and nothing is drawn again.
    """

    study: Path
    images: list[Path] = field(default_factory=list)
    notes: dict[str, dict[str, Any]] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    is_current: bool = False

    def __str__(self) -> str:
        """Why there are no images."""
        reasons = "; ".join(f"{name}: {reason}" for name, reason in self.reasons.items())
        return (
            f"the tables in {self.study / 'tables'} make no figure ({reasons}); run the study "
            f"first, python experiments/run.py -m experiment={self.study.name}"
        )


def draw_studies(
    studies: Sequence[Path], jobs: int = 1, *, again: bool = False
) -> Iterator[Drawing]:
    """Draw every figure that the tables of each study allow into its folder `figures`.

    A study whose tables, and the code that draws, are those of its figures is left as it is.

    Args:
        studies: their folders.
        jobs: processes that draw, as joblib counts them; -1 for one a core.
        again: whether what would stay the same is drawn too.

    Yields:
        the drawing of each study, in their order, once its figures are written and listed.
    """
    changed = {study: _made_of(study) for study in studies if again or not is_current(study)}
    parallel = Parallel(n_jobs=jobs, return_as="generator")
    usual = signal.signal(signal.SIGINT, signal.SIG_IGN)  # inherited by workers: joblib stops them
    try:
        tasks = [delayed(_draw)(study, name) for study in changed for name in FIGURES]
        parts = parallel(tasks) if tasks else iter(())  # joblib warns of what nobody asks for
    finally:
        signal.signal(signal.SIGINT, usual)
    for study in studies:
        if study in changed:
            yield _listed(study, itertools.islice(parts, len(FIGURES)), changed[study])
        else:
            notes = read_note(study)
            images = [study / "figures" / f"{name}.png" for name in notes]
            yield Drawing(study, images, notes, is_current=True)


def _made_of(study: Path) -> str:
    """What the figures of a study are made of; nothing if its tables cannot be read."""
    try:
        return made_of(study)
    except OSError:
        return ""


def _draw(study: Path, name: str) -> Drawing:
    """Draw the figures of one module."""
    module, drawing, source = FIGURES[name], Drawing(study), sentence(study)
    try:
        folder = inner_path(study.parent, study.name, "figures")
        contents = _contents(study, module)
        for suffix, tables in _versions(module, contents):
            path = folder / f"{name}{suffix}"
            drawing.images.append(save(module.draw(**tables), path, source))
            text = f"{module.facts(**tables)}\n\nSource: {source}.\n"
            replace_file(path.with_name(path.name + ".txt"), text.encode())
            files = {f"{table}.csv": content for table, content in contents.items()}
            drawing.notes[path.name] = figure_note(path, name, files)
    except Unsuited as reason:
        drawing.reasons[name] = str(reason)
    except TableError as error:
        drawing.reasons[name] = str(error)
        drawing.damage.append(str(error))
    return drawing


def _contents(study: Path, module: ModuleType) -> dict[str, bytes]:
    """The files of the tables that a module needs."""
    try:
        return read_tables(study, module.TABLES)
    except FileNotFoundError as error:
        raise Unsuited(f"there is no table {Path(error.filename).stem}") from None


def _versions(
    module: ModuleType, contents: Mapping[str, bytes]
) -> Iterator[tuple[str, dict[str, pd.DataFrame]]]:
    """The tables of each figure that a module draws, with the end of the figure's name."""
    tables = {name: pd.read_csv(io.BytesIO(content)) for name, content in contents.items()}
    for name, columns in module.TABLES.items():
        if missing := [column for column in columns if column not in tables[name]]:
            raise Unsuited(f"table {name} has no column {', '.join(missing)}")
    column = getattr(module, "EACH", None)
    if column is None:
        yield "", tables
        return
    first = next(iter(tables.values()))
    for value in sorted(first[column].unique()):
        if not is_name(str(value)):
            raise Unsuited(f"{column} {value!r} cannot be part of a file's name")
        yield (
            f"_{value}",
            {
                name: table[table[column] == value] if column in table else table
                for name, table in tables.items()
            },
        )


def _listed(study: Path, parts: Iterator[Drawing], made_of: str) -> Drawing:
    """The parts of a study's drawing as one, its figures and what they are made of listed.

    What cannot be drawn again stays listed, and `results.py status` tells what is wrong with it.
    """
    whole, before = Drawing(study), read_note(study)
    for part in parts:
        whole.images += part.images
        whole.notes |= part.notes
        whole.reasons |= part.reasons
        whole.damage += [text for text in part.damage if text not in whole.damage]
    for name, reason in whole.reasons.items():
        old = {figure: note for figure, note in before.items() if note["module"] == name}
        whole.notes = old | whole.notes
        if old or reason in whole.damage:
            print(f"{study.name}: not drawn again: {name}: {reason}")
            made_of = ""
    if whole.images:
        write_note(study, whole.notes, made_of)
    return whole
