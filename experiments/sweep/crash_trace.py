"""Where a process was when a crash or its time limit ended it: `crash_trace.txt` of a point.

Python's `faulthandler` writes it, as no other code can run then.
"""

from __future__ import annotations

import faulthandler
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import takewhile

from experiments.tracking.files import growing, read_file
from experiments.tracking.points import Point

_FILE = "crash_trace.txt"
_LATE = "Timeout ("  # how faulthandler's own text begins at the time limit


@contextmanager
def crash_trace(point: Point, time_limit: float | None) -> Iterator[None]:
    """Have a crash, or the time limit [s], write where this process is before it ends."""
    with growing(point.folder / _FILE) as file:
        faulthandler.enable(file)
        if time_limit is not None:
            faulthandler.dump_traceback_later(time_limit, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            faulthandler.disable()
            (point.folder / _FILE).unlink()


def take_crash_trace(point: Point, function: str) -> tuple[str, bool]:
    """What ended the last attempt's process, and whether that was its time limit.

    The file is removed.

    Args:
        point: the point.
        function: name of the function within which the attempt ran.

    Returns:
        the cause and where the process was inside the function, innermost first; empty if there
        is no trace.
    """
    path = point.folder / _FILE
    try:
        text = read_file(path).decode(errors="replace")
        path.unlink()
    except OSError:
        return "", False
    # A block for each thread; the one that ran the attempt counts, and of it the part inside.
    frame = f"in {function}"
    block = next((block for block in text.split("\n\n") if frame in block), text)
    inside = takewhile(lambda line: frame not in line, block.splitlines()[1:])
    lines = [*text.splitlines()[:1], *(line for line in inside if line.startswith("  "))]
    return "\n".join(lines), text.startswith(_LATE)
