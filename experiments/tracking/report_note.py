"""What a report was written from: `report.json`, beside it.

{"written_by": hash of its source,
 "read": {path below the folder of results: sha256, ...},     tables and figures
 "files": {name: sha256, ...}}                                the report itself
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from experiments.tracking.figure_notes import file_change
from experiments.tracking.files import digest
from experiments.tracking.names import inner_path, is_digest, is_name
from experiments.tracking.sealed import SealError, read_sealed, write_sealed
from experiments.tracking.sources import source_hash

NOTE = "report.json"
_WRITES = "paper_figures.report.__main__"  # the module that writes it


def write_note(folder: Path, read: Mapping[str, str], contents: Mapping[str, bytes]) -> None:
    """List what a report was written from.

    Args:
        folder: where it is.
        read: sha256 of the tables and figures in it, by path below the folder of results.
        contents: its files, by name.
    """
    note = {
        "written_by": source_hash([_WRITES]),
        "read": dict(sorted(read.items())),
        "files": {name: digest(content) for name, content in contents.items()},
    }
    write_sealed(inner_path(folder, NOTE), note)


def concerns(folder: Path) -> list[str] | None:
    """Why a report is not up to date; empty if it is, None if there is none."""
    try:
        note = _read_note(folder)
    except FileNotFoundError:
        return [f"{NOTE} is missing"] if (folder / "REPORT.md").exists() else None
    except (OSError, ValueError) as error:
        return [f"{NOTE} cannot be read ({error})"]
    changes = [file_change(folder / name, it, "written") for name, it in note["files"].items()]
    for path, before in note["read"].items():
        if change := file_change(folder.parent / path, before, None):
            changes.append(f"{Path(path).parts[0]}: {change}")
    if note["written_by"] != source_hash([_WRITES]):
        changes.append("the code that writes it has changed since")
    return [change for change in changes if change]


def _read_note(folder: Path) -> dict[str, dict[str, str]]:
    """The note; raises an OSError or ValueError if it is not whole, or names strange paths."""
    path = inner_path(folder, NOTE)
    note = read_sealed(path)
    try:
        names = [*note["files"], *(part for it in note["read"] for part in it.split("/"))]
        digests = [*note["files"].values(), *note["read"].values()]
        is_whole = all(map(is_name, names)) and all(map(is_digest, digests))
        note["written_by"]
    except (KeyError, TypeError, AttributeError):
        is_whole = False
    if not is_whole:
        raise SealError(f"{path} is no list of what a report was written from")
    return note
