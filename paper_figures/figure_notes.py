"""What figures were drawn from: `figures/figures.json`, beside them.

{"study": null, or of the study's points and data: {"points": hash of their identities,
          "count": how many, "sources": {...}, "commits": [...], "dirty": ...,
          "started": [first, last]},
 "figures": {name: {"module": what draws it, "drawn_by": hash of its source,
                    "tables": {file: sha256, ...}, "files": {file: sha256, ...}}, ...}}
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NOTE = "figures.json"
SUFFIXES = (".png", ".pdf", ".txt")
# The modules that figures share; the others of this package draw one figure each.
SHARED = ("curves", "plane", "rows", "style")


def drawing_source(module: str) -> str:
    """Hash of the source that draws a figure: its own module and the shared ones."""
    here = Path(__file__).parent
    parts = [here / f"{name}.py" for name in (module, *SHARED)]
    return _sha256(b"".join(path.name.encode() + b"\0" + path.read_bytes() for path in parts))


def data_origin(study: Path) -> dict[str, Any] | None:
    """Points, source, commits and dates behind a study's tables; None if it does not tell."""
    try:
        collated = json.loads((study / "study.json").read_bytes())["collated"]
        origin = {key: collated[key] for key in ("sources", "commits", "dirty", "started")}
        points = collated["points"]
        return {"points": _sha256("\n".join(points).encode()), "count": len(points), **origin}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def sentence(study: Path) -> str:
    """The origin of a study's data in words: points, commit, date."""
    origin = data_origin(study)
    if origin is None:
        return f"study {study.name}, whose points are not listed"
    commits = ", ".join(commit[:12] for commit in origin["commits"]) or "unknown"
    changed = ", with changes" if origin["dirty"] else ""
    points = f"{origin['count']} point{'s' * (origin['count'] > 1)}"
    return (
        f"study {study.name}, {points} (digest {origin['points'][:12]}), "
        f"git commit {commits}{changed}, data of {origin['started'][1]}"
    )


def table_digest(data: bytes) -> str:
    """What tells a table from any other."""
    return _sha256(data)


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
        "drawn_by": drawing_source(module),
        "tables": {name: _sha256(data) for name, data in tables.items()},
        "files": {file.name: _sha256(file.read_bytes()) for file in files},
    }


def read_note(study: Path) -> dict[str, dict[str, Any]]:
    """What is listed of each figure of a study; nothing if there is no such list."""
    try:
        figures = json.loads((study / "figures" / NOTE).read_bytes())["figures"]
        return {
            name: {key: note[key] for key in ("module", "drawn_by", "tables", "files")}
            for name, note in figures.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}


def write_note(study: Path, figures: Mapping[str, Mapping[str, Any]]) -> None:
    """List the figures of a study, each by its `figure_note`."""
    note = {"study": data_origin(study), "figures": dict(sorted(figures.items()))}
    path = study / "figures" / NOTE
    part = path.with_name(f".{NOTE}-{os.getpid()}.part")
    part.write_text(json.dumps(note, indent=1) + "\n")
    os.replace(part, path)


def concerns(study: Path) -> dict[str, list[str]]:
    """Why each figure that was drawn is not up to date, by its name; nothing for one that is."""
    found: dict[str, list[str]] = {}
    for name, note in sorted(read_note(study).items()):
        reasons = found[name] = []
        for file, digest in note["files"].items():
            path = study / "figures" / file
            if not path.exists():
                reasons.append(f"{file} is missing")
            elif _sha256(path.read_bytes()) != digest:
                reasons.append(f"{file} was changed after it was drawn")
        for table, digest in note["tables"].items():
            path = study / "tables" / table
            if not path.exists():
                reasons.append(f"table {table} is missing")
            elif table_digest(path.read_bytes()) != digest:
                reasons.append(f"table {table} has changed since")
        if note["drawn_by"] != _current_source(note["module"]):
            reasons.append("the code that draws has changed since")
    return found


def _current_source(module: str) -> str | None:
    """Hash of the source that draws a figure now; None if its module is gone."""
    try:
        return drawing_source(module)
    except OSError:
        return None


def _sha256(data: bytes) -> str:
    """In hexadecimal."""
    return hashlib.sha256(data).hexdigest()
