"""What figures were drawn from: `figures/figures.json`, beside them.

{"drawn_by": hash of this package's source,
 "study": null, or of the study's points and data: {"points": hash of their identities,
          "sources": {...}, "commits": [...], "dirty": ..., "started": [first, last]},
 "figures": {name: {table: sha256, ...}, ...}}
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

NOTE = "figures.json"


def drawing_source() -> str:
    """Hash of the source that draws."""
    parts = sorted(Path(__file__).parent.glob("*.py"))
    return _sha256(b"".join(path.name.encode() + b"\0" + path.read_bytes() for path in parts))


def data_origin(study: Path) -> dict[str, Any] | None:
    """Points, source, commits and dates behind a study's tables; None if it does not tell."""
    try:
        collated = json.loads((study / "study.json").read_bytes())["collated"]
        origin = {key: collated[key] for key in ("sources", "commits", "dirty", "started")}
        return {"points": _sha256("\n".join(collated["points"]).encode()), **origin}
    except (OSError, ValueError, KeyError, TypeError):
        return None


def table_digest(data: bytes) -> str:
    """What tells a table from any other."""
    return _sha256(data)


def write_note(study: Path, figures: Mapping[str, Mapping[str, str]]) -> None:
    """List the figures of a study, each with the digests of the tables that it was drawn from."""
    note = {"drawn_by": drawing_source(), "study": data_origin(study), "figures": figures}
    path = study / "figures" / NOTE
    part = path.with_name(f".{NOTE}-{os.getpid()}.part")
    part.write_text(json.dumps(note, indent=1) + "\n")
    os.replace(part, path)


def concerns(study: Path) -> dict[str, list[str]]:
    """Why each figure that was drawn is not up to date, by its name; nothing for one that is."""
    try:
        note = json.loads((study / "figures" / NOTE).read_bytes())
        figures: dict[str, dict[str, str]] = note["figures"]
        drawn_by = note["drawn_by"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    found: dict[str, list[str]] = {}
    for name, tables in sorted(figures.items()):
        reasons = found[name] = []
        for suffix in (".png", ".pdf"):
            if not (study / "figures" / f"{name}{suffix}").exists():
                reasons.append(f"{name}{suffix} is missing")
        for table, digest in tables.items():
            path = study / "tables" / table
            if not path.exists():
                reasons.append(f"table {table} is missing")
            elif table_digest(path.read_bytes()) != digest:
                reasons.append(f"table {table} has changed since")
        if drawn_by != drawing_source():
            reasons.append("the code that draws has changed since")
    return found


def _sha256(data: bytes) -> str:
    """In hexadecimal."""
    return hashlib.sha256(data).hexdigest()
