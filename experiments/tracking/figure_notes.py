"""The sources of figures: `figures/figures.json`, beside them.

{"study": null, or of the study's points and data: {"points": hash of their identities,
          "count": how many, "sources": {...}, "commits": [...], "dirty": ...,
          "started": [first, last]},
 "figures": {name: {"module": what draws it, "drawn_by": hash of its source,
                    "tables": {file: sha256, ...}, "files": {file: sha256, ...}}, ...}}
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.tracking.files import digest, replace_file
from experiments.tracking.sources import source_hash
from experiments.tracking.study import Collated, whole_study

NOTE = "figures.json"
SUFFIXES = (".png", ".pdf", ".txt")
_FIGURES = "paper_figures"  # the package whose modules draw


def sentence(folder: Path) -> str:
    """The origin of a study's data in words: points, commit, date."""
    study = whole_study(folder)
    if study is None or study.collated is None:
        return f"study {folder.name}, whose points are not listed"
    collated = study.collated
    count = len(collated.points)
    commits = ", ".join(commit[:12] for commit in collated.commits) or "unknown"
    changes = ", with changes" if collated.dirty else ""
    return (
        f"study {folder.name}, {count} point{'s' * (count > 1)} "
        f"(digest {_points_digest(collated)[:12]}), "
        f"git commit {commits}{changes}, data of {collated.started[1]}"
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
        "files": {file.name: digest(file.read_bytes()) for file in files},
    }


def read_note(folder: Path) -> dict[str, dict[str, Any]]:
    """What is listed of each figure of a study; nothing if there is no such list."""
    try:
        figures = json.loads((folder / "figures" / NOTE).read_bytes())["figures"]
        return {
            name: {key: note[key] for key in ("module", "drawn_by", "tables", "files")}
            for name, note in figures.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def write_note(folder: Path, figures: Mapping[str, Mapping[str, Any]]) -> None:
    """List the figures of a study, each by its `figure_note`."""
    note = {"study": _data_origin(folder), "figures": dict(sorted(figures.items()))}
    replace_file(folder / "figures" / NOTE, json.dumps(note, indent=1).encode() + b"\n")


def concerns(folder: Path) -> dict[str, list[str]]:
    """Why each figure of a study is not up to date, by its name; nothing for one that is."""
    reasons: dict[str, list[str]] = {}
    for name, note in sorted(read_note(folder).items()):
        changes = reasons[name] = []
        for file, before in note["files"].items():
            path = folder / "figures" / file
            if not path.exists():
                changes.append(f"{file} is missing")
            elif digest(path.read_bytes()) != before:
                changes.append(f"{file} was changed after it was drawn")
        for table, before in note["tables"].items():
            path = folder / "tables" / table
            if not path.exists():
                changes.append(f"table {table} is missing")
            elif digest(path.read_bytes()) != before:
                changes.append(f"table {table} has changed since")
        if note["drawn_by"] != _drawing_source(note["module"]):
            changes.append("the code that draws has changed since")
    return reasons


def _drawing_source(module: str) -> str:
    """Hash of the source that draws a figure: its module's, and that of all it imports."""
    return source_hash([f"{_FIGURES}.{module}"])


def _data_origin(folder: Path) -> dict[str, Any] | None:
    """Points, source, commits and dates behind a study's tables; None if they are not listed."""
    study = whole_study(folder)
    if study is None or study.collated is None:
        return None
    collated = study.collated
    return {
        "points": _points_digest(collated),
        "count": len(collated.points),
        "sources": dict(collated.sources),
        "commits": list(collated.commits),
        "dirty": collated.dirty,
        "started": list(collated.started),
    }


def _points_digest(collated: Collated) -> str:
    """Hash of the identities of the points behind tables, in their order."""
    return digest("\n".join(collated.points).encode())
