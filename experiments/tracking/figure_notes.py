"""The sources of figures: `figures/figures.json`, beside them.

{"study": null, or of the study's points and data: {"points": hash of their identities,
          "count": how many, "sources": {...}, "commits": [...], "dirty": ...,
          "started": [first, last]},
 "made_of": hash of all tables and of the code that draws; empty if something is not drawn of them,
 "figures": {name: {"module": what draws it, "drawn_by": hash of its source,
                    "tables": {file: sha256, ...}, "files": {file: sha256, ...}}, ...}}
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.tracking.files import digest, file_digest
from experiments.tracking.forms import sound_study
from experiments.tracking.names import inner_path, is_digest, is_name
from experiments.tracking.sealed import SealError, read_sealed, write_sealed
from experiments.tracking.sources import source_hash
from experiments.tracking.study import Collated
from experiments.tracking.trees import canonical_json

NOTE = "figures.json"
SUFFIXES = (".png", ".pdf", ".txt")
_FILES = ("tables", "files")  # of a figure's note, by name with digests
_FIGURES = "paper_figures"  # the package whose modules draw
_DRAWS = "drawing"  # the module that lists them


def sentence(folder: Path) -> str:
    """The origin of a study's data in words: points and commit."""
    study = sound_study(folder)
    if study is None or study.collated is None or not study.collated.points:
        return f"study {folder.name}, whose points are not listed"
    collated = study.collated
    count = len(collated.points)
    commits = ", ".join(commit[:12] for commit in collated.commits) or "unknown"
    changes = ", with changes" if collated.dirty else ""
    return (
        f"study {folder.name}, {count} point{'s' * (count > 1)} "
        f"(digest {_points_digest(collated)[:12]}), "
        f"git commit {commits}{changes}"
    )


def figure_note(path: Path, module: str, tables: Mapping[str, bytes]) -> dict[str, Any]:
    """What is listed of a figure that was just written.

    Args:
        path: its files, without their suffix.
        module: the name of the module that drew it.
        tables: the content of the tables that it was drawn from, by file name.
    """
    files = [path.with_name(path.name + suffix) for suffix in SUFFIXES]
    return {
        "module": module,
        "drawn_by": _drawing_source(module),
        "tables": {name: digest(data) for name, data in tables.items()},
        "files": {file.name: file_digest(file) for file in files},
    }


def read_note(folder: Path) -> dict[str, dict[str, Any]]:
    """What is listed of each figure of a study; nothing if there is no such list, or none whole."""
    try:
        return _listed_figures(folder)
    except (OSError, ValueError):
        return {}


def note_damage(folder: Path) -> str | None:
    """Why the list of a study's figures cannot be read; None if it can, or if there is none."""
    try:
        _listed_figures(folder)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        return f"{NOTE} cannot be read, so draw them again ({error})"
    return None


def _listed_figures(folder: Path) -> dict[str, dict[str, Any]]:
    """The list of a study's figures; raises an OSError or ValueError if it is not whole."""
    path = inner_path(folder, "figures", NOTE)
    try:
        figures = {
            name: {key: note[key] for key in ("module", "drawn_by", "tables", "files")}
            for name, note in read_sealed(path)["figures"].items()
        }
        files = [it for note in figures.values() for key in _FILES for it in note[key].items()]
    except (KeyError, TypeError, AttributeError):
        raise SealError(f"{path} is no list of figures") from None
    if not (
        all(is_name(name) and is_digest(it) for name, it in files)
        and all(is_name(each) for name, note in figures.items() for each in (name, note["module"]))
    ):
        raise SealError(f"{path} names something that is no figure and no table")
    return figures


def write_note(folder: Path, figures: Mapping[str, Mapping[str, Any]], made_of: str = "") -> None:
    """List the figures of a study, each by its `figure_note`.

    Args:
        folder: the study's.
        figures: by their names.
        made_of: as of `made_of`, before they were drawn; empty if some could not be.
    """
    listed = dict(sorted(figures.items()))
    note = {"study": _data_origin(folder), "made_of": made_of, "figures": listed}
    write_sealed(inner_path(folder, "figures", NOTE), note)


def made_of(folder: Path) -> str:
    """Hash of all that decides which figures a study has: its tables, and the code that draws."""
    tables = sorted((folder / "tables").glob("*.csv"))
    contents = {path.name: file_digest(path) for path in tables}
    return digest(canonical_json([contents, _drawing_source(_DRAWS)]))


def is_current(folder: Path) -> bool:
    """Whether all that can be drawn of a study is there, and drawing again would change nothing."""
    try:
        note = read_sealed(inner_path(folder, "figures", NOTE))
        told, origin = note["made_of"], note["study"]
        is_same = told == made_of(folder) and origin == _data_origin(folder)
    except (OSError, ValueError, KeyError):
        return False
    return is_same and bool(note["figures"]) and not any(concerns(folder).values())


def concerns(folder: Path) -> dict[str, list[str]]:
    """Why each figure of a study is not up to date, by its name; nothing for one that is."""
    reasons: dict[str, list[str]] = {}
    for name, note in sorted(read_note(folder).items()):
        changes = reasons[name] = []
        for file, before in note["files"].items():
            if now := file_change(folder / "figures" / file, before, "drawn"):
                changes.append(now)
        for table, before in note["tables"].items():
            if now := file_change(folder / "tables" / table, before, None):
                changes.append(f"table {now}")
        if note["drawn_by"] != _drawing_source(note["module"]):
            changes.append("the code that draws has changed since")
    return reasons


def file_change(path: Path, before: str, verb: str | None) -> str | None:
    """What became of a file since it had a digest; None if it is the same.

    Args:
        path: the file.
        before: its sha256.
        verb: how it was made, "written"; None if it may be made anew.
    """
    try:
        if file_digest(path) == before:
            return None
    except FileNotFoundError:
        return f"{path.name} is missing"
    except OSError as error:
        return f"{path.name} cannot be read: {error.strerror}"
    change = f"was changed after it was {verb}" if verb else "has changed since"
    return f"{path.name} {change}"


def _drawing_source(module: str) -> str:
    """Hash of the source that draws a figure: its module's, and that of all it imports."""
    return source_hash([f"{_FIGURES}.{module}"])


def _data_origin(folder: Path) -> dict[str, Any] | None:
    """Points, source and commits behind a study's tables; None if they are not listed."""
    study = sound_study(folder)
    if study is None or study.collated is None or not study.collated.points:
        return None
    collated = study.collated
    return {
        "points": _points_digest(collated),
        "count": len(collated.points),
        "sources": dict(collated.sources),
        "commits": list(collated.commits),
        "dirty": collated.dirty,
    }


def _points_digest(collated: Collated) -> str:
    """Hash of the identities of the points behind tables, in their order."""
    return digest("\n".join(collated.points).encode())
