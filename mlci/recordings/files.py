"""Which files paths stand for, and the reading of one, whatever it may hold."""

from __future__ import annotations

import glob
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mlci.recordings import c3d, delimited, excel, json_text, matlab, npz, opensim, parquet
from mlci.recordings.recording import Remark, shown_path
from mlci.recordings.table import Table, Unusable, Wants

MAX_MEMORY = 400.0  # [MB] that reading one file may take


@dataclass(frozen=True)
class Format:
    """A format of files.

    Attributes:
        read: file, which columns to load, and bytes that they may take, to a table.
        cost: bytes of memory that a byte of the file takes.
    """

    read: Callable[[Path, Wants, int], Table]
    cost: float = 1


_TEXT = Format(delimited.read, 10)
FORMATS = {
    ".csv": _TEXT,
    ".tsv": _TEXT,
    ".txt": _TEXT,
    ".npz": Format(npz.read),
    ".parquet": Format(parquet.read),
    ".json": Format(json_text.read, 40),
    ".jsonl": Format(json_text.read, 40),
    ".mat": Format(matlab.read),
    ".xlsx": Format(excel.read),
    ".mot": Format(opensim.read_motion, 10),
    ".sto": Format(opensim.read_motion, 10),
    ".trc": Format(opensim.read_markers, 10),
    ".c3d": Format(c3d.read, 4),
}


def user_path(given: str | Path) -> Path:
    """A path as a person gives it, in which `~` stands for the home folder.

    Raises:
        RuntimeError: it begins with the home of nobody.
    """
    return Path(given).expanduser()


def find_files(paths: Sequence[str | Path]) -> tuple[dict[Path, bool], list[Remark]]:
    """The files that paths stand for, each once; a problem for a path that stands for none.

    With each file comes whether its own path was given, not a folder or pattern.

    In a folder those count whose format is known, without hidden ones; those of a folder or
    pattern come by name.
    """
    found: dict[Path, bool] = {}
    problems = []
    for given in paths:
        path = Path(given)
        try:
            path = user_path(given)
            inside = _inside(path)
        except (OSError, ValueError, RuntimeError) as error:
            problems.append(Remark(shown_path(path), f"cannot be looked into ({error})"))
            continue
        if not inside:
            empty = f"holds no file of {', '.join(FORMATS)}"
            message = empty if path.is_dir() else "there is no such file"
            problems.append(Remark(shown_path(path), message))
        for file in sorted(inside):
            found[file] = found.get(file, False) or file == path
    return found, problems


def _inside(path: Path) -> list[Path]:
    """The files that a path stands for."""
    if path.is_dir():
        return [
            item
            for item in path.iterdir()
            if item.suffix.lower() in FORMATS and not item.name.startswith(".")
        ]
    if path.exists():
        return [path]
    return [Path(item) for item in glob.glob(str(path), recursive=True)]


def read_table(file: Path, wants: Wants, max_memory: float = MAX_MEMORY) -> Table:
    """Read one file by its suffix.

    Args:
        file: the file.
        wants: which of its columns or arrays are used.
        max_memory: what reading it may take [MB].

    Raises:
        Unusable: what is wrong with it.
    """
    form, limit = FORMATS.get(file.suffix.lower()), int(max_memory * 1e6)
    if form is None:
        raise Unusable(f"cannot read {file.suffix!r} files: convert it to {', '.join(FORMATS)}")
    try:
        if not file.is_file():
            raise Unusable("is not a file" if file.exists() else "there is no such file")
        if file.stat().st_size * form.cost > limit:
            size = file.stat().st_size / 1e6
            raise Unusable(
                f"has {size:.3g} MB, and reading takes {form.cost:g} times that: more than "
                f"max_memory = {max_memory:g} MB"
            )
        return form.read(file, wants, limit)
    except Unusable:
        raise
    except MemoryError:
        raise Unusable("takes more memory to read than there is; it is damaged?") from None
    except OSError as error:
        raise Unusable(f"cannot be read ({error.strerror or error})") from None
    except Exception as error:  # whatever a package makes of a damaged file
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise Unusable(f"is damaged, or no {file.suffix} file ({reason})") from None
