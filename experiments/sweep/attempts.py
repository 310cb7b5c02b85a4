"""One attempt at a point: under its lock, within its time, its end told whatever it is."""

from __future__ import annotations

import faulthandler
import json
import math
import os
import socket
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from itertools import takewhile
from typing import Any, TextIO

import pandas as pd
from filelock import Timeout

import experiments.point.run
from experiments.config.settings import Settings
from experiments.point.tables import table_bytes
from experiments.tracking.environment import environment, peak_memory, reset_peak_memory
from experiments.tracking.files import PART, digest, replace_file
from experiments.tracking.points import Point, State
from experiments.tracking.store import Store
from experiments.tracking.trees import plain

# In the point's folder: where a process was that its own fault or the time limit ended.
_LAST_WORDS = "last_words.txt"


def run(
    point: Point, settings: Settings, log: Callable[[str], None], *, force: bool = False
) -> State:
    """Run a point here, unless it is done; whoever runs it already is waited for.

    Args:
        point: the point.
        settings: what it is computed from.
        log: called with each line that the point prints.
        force: whether to run it even if it is done.

    Returns:
        State.DONE.
    """
    point.folder.mkdir(parents=True, exist_ok=True)
    with point.lock:
        if force or not point.is_done():
            _attempt(point, settings, log)
    return State.DONE


def run_apart(
    point: Point, settings: Settings, *, force: bool = False, time_limit: float | None = None
) -> State:
    """Run a point in a process that does nothing else meanwhile; its output goes to its log.

    Args:
        point: the point.
        settings: what it is computed from.
        force: whether to run it even if it is done.
        time_limit: [s] after which this process is ended.

    Returns:
        State.DONE, or State.RUNNING if another process runs it.
    """
    point.folder.mkdir(parents=True, exist_ok=True)
    try:
        with point.lock.acquire(blocking=False):
            if force or not point.is_done():
                with _last_words(point, time_limit):
                    _attempt(point, settings, None)
        return State.DONE
    except Timeout:
        return State.RUNNING


def bury(point: Point, error: Exception, after: int) -> dict[str, Any]:
    """Keep the failure of an attempt whose process ended without a word; returns it.

    Args:
        point: the point, which nobody runs.
        error: what its launcher knows of it.
        after: the last attempt before this one, which perhaps did not get as far as to start.
    """
    with suppress(Timeout), point.lock.acquire(blocking=False):
        # Somebody else may have run it since.
        if not point.is_done() and not _failed(point, after):
            number = max(point.attempts(), after + 1)
            words = _read_last_words(point) if point.attempts() > after else ""
            late = words.startswith("Timeout (")  # faulthandler's own word for it
            end = "still running at its time limit" if late else describe(error)
            _keep_failure(point, "timeout" if late else "died", end, words, number)
    if failure := _failed(point, after):
        return failure
    # On a full disk the error that it raised is known to the launcher only.
    trace = getattr(error, "traceback", "")
    return {
        "reason": "raised" if trace else "died",
        "error": describe(error),
        "traceback": trace,
    }


def _failed(point: Point, after: int) -> dict[str, Any] | None:
    """How the last attempt failed, if it is a later one than `after`."""
    failure = point.failure()
    return failure if failure and int(failure.get("attempt", 1)) > after else None


def _attempt(point: Point, settings: Settings, log: Callable[[str], None] | None) -> None:
    """Compute the point, and keep its tables and record, or its failure.

    All output of the process goes to the point's log, unless `log` is to be told each line.
    """
    number = 1 + point.attempts()
    note = {
        "identity": point.identity,
        "source": point.source,
        "attempt": number,
        "started": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "host": socket.gethostname(),
        "pid": os.getpid(),
    }
    try:
        # A point that runs again, and fails, must not look finished.
        for name in ("record.json", "failure.json"):
            (point.folder / name).unlink(missing_ok=True)
        for left in point.folder.glob(f".*{PART}"):  # by an attempt that was killed
            left.unlink()
        _write(point, "attempt", note)
        reset_peak_memory()
        store = Store(point.results / "store")
        tables = _compute(point, settings, store, log)
        _keep_result(point, settings, store, tables, note)
    except Exception as error:
        _keep_failure(point, "raised", describe(error), traceback.format_exc(), number)
        raise
    (point.folder / "attempt.json").unlink()


def _compute(
    point: Point, settings: Settings, store: Store, log: Callable[[str], None] | None
) -> Mapping[str, pd.DataFrame]:
    """The point's tables; its lines, and its traceback, go to its log."""
    with (
        open(point.folder / "log.txt", "w", buffering=1) as file,
        _own_output(file) if log is None else nullcontext(),
        store.timed("total"),
    ):

        def keep(line: str) -> None:
            file.write(f"{line}\n")
            if log is not None:
                log(line)

        try:
            return experiments.point.run.run_point(settings, store, keep)
        except Exception:
            file.write(traceback.format_exc())
            raise


def _keep_result(
    point: Point,
    settings: Settings,
    store: Store,
    tables: Mapping[str, pd.DataFrame],
    note: Mapping[str, Any],
) -> None:
    """Write the tables, then the record."""
    files = {"log.txt": digest((point.folder / "log.txt").read_bytes())}
    for name, frame in sorted(tables.items()):
        data = table_bytes(name, frame, settings)
        files[f"{name}.csv"] = digest(data)
        replace_file(point.folder / f"{name}.csv", data)
    row = tables["summary"].to_dict("records")[0] if "summary" in tables else {}
    record = {
        "identity": point.identity,
        "source": point.source,
        "config": plain(settings),
        "seed": settings.seed,
        "summary": {name: _finite(value) for name, value in row.items()},
        "files": files,
        "stages": store.keys,
        "attempt": note["attempt"],
        "started": note["started"],
        "seconds": {stage: round(spent, 3) for stage, spent in store.seconds.items()},
        "peak_memory_mb": peak_memory(),
        **environment(point.results),
    }
    _write(point, "record", record)


def _keep_failure(point: Point, reason: str, error: str, trace: str, attempt: int) -> None:
    """Write how an attempt, by its number, ended, as far as there is room on the disk."""
    note = point.note("attempt") or {}
    started = note.get("started") if note.get("attempt") == attempt else None
    spent = datetime.now(UTC) - datetime.fromisoformat(started) if started else None
    failure = {
        "identity": point.identity,
        "source": point.source,
        "attempt": attempt,
        "reason": reason,
        "error": error,
        "traceback": trace,
        "started": started,
        "seconds": spent and round(spent.total_seconds(), 3),
    }
    with suppress(OSError):
        _write(point, "failure", failure)
        (point.folder / "attempt.json").unlink(missing_ok=True)


def _finite(value: Any) -> Any:
    """The value, or None for NaN and infinities, which JSON does not have."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def describe(error: Exception) -> str:
    """Type and message of an error, on one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _write(point: Point, name: str, content: Mapping[str, Any]) -> None:
    """Write `record`, `failure` or `attempt`."""
    data = json.dumps(content, indent=1, allow_nan=False).encode() + b"\n"
    replace_file(point.folder / f"{name}.json", data)


@contextmanager
def _own_output(file: TextIO) -> Iterator[None]:
    """Send all that this process prints, from whatever language, to a file."""
    kept = {number: os.dup(number) for number in (1, 2)}
    sys.stdout.flush()
    sys.stderr.flush()
    for number in kept:
        os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, was in kept.items():
            os.dup2(was, number)
            os.close(was)


@contextmanager
def _last_words(point: Point, time_limit: float | None) -> Iterator[None]:
    """Have a crash or the time limit, which ends the process, say where the process is."""
    with open(point.folder / _LAST_WORDS, "w") as file:
        faulthandler.enable(file)
        if time_limit is not None:
            faulthandler.dump_traceback_later(time_limit, exit=True, file=file)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            faulthandler.disable()
            (point.folder / _LAST_WORDS).unlink()


def _read_last_words(point: Point) -> str:
    """What ended the last attempt's process, and where it was, innermost first; then forgotten."""
    path = point.folder / _LAST_WORDS
    try:
        words = path.read_text(errors="replace")
        path.unlink()
    except OSError:
        return ""
    # A block for each thread; ours is the one that ran the attempt, and of it the part inside.
    ours = next((block for block in words.split("\n\n") if "in run_apart" in block), words)
    inside = takewhile(lambda line: "in run_apart" not in line, ours.splitlines()[1:])
    return "\n".join([*words.splitlines()[:1], *(line for line in inside if line[:2] == "  ")])
