"""Every figure that there is, and how those that a study's tables allow are drawn."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType

import pandas as pd

from paper_figures import calibration_diagram as calibration
from paper_figures import (
    final_state_error,
    hypothesis_map,
    in_cell,
    overview,
    rank_curve,
    scale,
    sensitivity,
    state_space,
    success,
    success_cases,
    trajectories,
    violation_distance,
)
from paper_figures.figure_notes import figure_note, read_note, sentence, write_note
from paper_figures.selection import Unsuited
from paper_figures.style import save

# Every figure there is. A module has
#   TABLES        the tables that it needs, each with the columns that it needs of it;
#   draw(**them)  the figure; it may raise Unsuited;
#   facts(**them) what its caption says, a fact a line;
#   EACH          a column, if there is to be one figure for each of its values.
FIGURES: tuple[ModuleType, ...] = (
    overview,
    state_space,
    final_state_error,
    violation_distance,
    rank_curve,
    trajectories,
    hypothesis_map,
    calibration,
    in_cell,
    scale,
    sensitivity,
    success,
    success_cases,
)


def draw_study(study: Path) -> list[Path]:
    """Draw every figure that a study's tables allow into its folder `figures`.

    Returns:
        The PNG of each; a PDF and the caption's facts as text are beside it.

    Raises:
        Unsuited: they allow none.
    """
    needed = {name for module in FIGURES for name in module.TABLES}
    paths = {name: study / "tables" / f"{name}.csv" for name in sorted(needed)}
    contents = {name: path.read_bytes() for name, path in paths.items() if path.is_file()}
    tables = {name: pd.read_csv(io.BytesIO(data)) for name, data in contents.items()}
    before, notes, reasons, drawn = read_note(study), {}, [], []
    source = sentence(study)
    for module in FIGURES:
        name = module.__name__.rpartition(".")[2]
        try:
            for suffix, chosen in _versions(module, tables):
                path = study / "figures" / f"{name}{suffix}"
                drawn.append(save(module.draw(**chosen), path, source))
                lines = [module.facts(**chosen), "", f"Source: {source}."]
                path.with_name(path.name + ".txt").write_text("\n".join(lines) + "\n")
                used = {f"{table}.csv": contents[table] for table in chosen}
                notes[path.name] = figure_note(path, name, used)
        except Unsuited as reason:
            reasons.append(f"{name}: {reason}")
            # What cannot be drawn again stays listed, and `status` tells what is wrong with it.
            kept = {figure: note for figure, note in before.items() if note["module"] == name}
            notes |= kept
            if kept:
                print(f"{study.name}: not drawn again: {reasons[-1]}")
    if not drawn:
        raise Unsuited(
            f"the tables in {study / 'tables'} make no figure ({'; '.join(reasons)}); run the "
            f"study first, python experiments/run.py -m experiment={study.name}"
        )
    write_note(study, notes)
    return drawn


def _versions(
    module: ModuleType, tables: Mapping[str, pd.DataFrame]
) -> Iterator[tuple[str, dict[str, pd.DataFrame]]]:
    """The tables that a figure is drawn from, or each of its figures, whose names have a suffix."""
    for name, columns in module.TABLES.items():
        if name not in tables:
            raise Unsuited(f"there is no table {name}")
        if missing := [column for column in columns if column not in tables[name]]:
            raise Unsuited(f"table {name} has no column {', '.join(missing)}")
    chosen = {name: tables[name] for name in module.TABLES}
    each = getattr(module, "EACH", None)
    if each is None:
        yield "", chosen
        return
    first = next(iter(chosen.values()))
    for value in sorted(first[each].unique()):
        yield (
            f"_{value}",
            {
                name: table[table[each] == value] if each in table else table
                for name, table in chosen.items()
            },
        )
