"""One attempt at a point: under its lock, within its time limit, and recorded however it ends."""

from __future__ import annotations

import os
import socket
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TextIO

from filelock import Timeout

from experiments.config.settings import Settings
from experiments.point.no_answer import NoAnswer
from experiments.sweep.crash_trace import crash_trace, take_crash_trace
from experiments.sweep.record import write_failure, write_result
from experiments.tracking.environment import reset_peak_memory
from experiments.tracking.files import PART, growing
from experiments.tracking.points import Point, State
from experiments.tracking.store import Store

if TYPE_CHECKING:
    import pandas as pd


def run_here(
    point: Point, settings: Settings, log: Callable[[str], None], *, force: bool = False
) -> None:
    """Run a point in this process, unless it is done; waits for another process that runs it.

    Args:
        point: the point.
        settings: what it is computed from.
        log: called with each line that the point prints.
        force: whether to run it even if it is done.
    """
    point.folder.mkdir(parents=True, exist_ok=True)
    with point.lock:
        if force or not point.is_done():
            _attempt(point, settings, log)


def run_in_worker(
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
                with crash_trace(point, time_limit):
                    _attempt(point, settings, None)
        return State.DONE
    except Timeout:
        return State.RUNNING


def record_death(point: Point, error: Exception, after: int) -> dict[str, Any]:
    """Write the failure of an attempt whose process could not; returns the last failure.

    Args:
        point: the point, which no process runs.
        error: what its launcher knows of it.
        after: the last attempt before this one, which perhaps did not get as far as to start.
    """
    with suppress(Timeout), point.lock.acquire(blocking=False):
        # Another process may have run it since.
        if not point.is_done() and not _failure_after(point, after):
            number = max(point.attempts(), after + 1)
            trace, late = "", isinstance(error, TimeoutError)
            if point.attempts() > after:
                trace, told = take_crash_trace(point, run_in_worker.__name__)
                late = late or told
            message = "still running at its time limit" if late else _describe(error)
            write_failure(point, "timeout" if late else "died", message, trace, number)
    if failure := _failure_after(point, after):
        return failure
    # On a full disk the error that it raised is known to the launcher only.
    trace = getattr(error, "traceback", "")
    return {
        "reason": "raised" if trace else "died",
        "error": _describe(error),
        "traceback": trace,
    }


def _failure_after(point: Point, attempt: int) -> dict[str, Any] | None:
    """How the last attempt failed, if it is a later one than a given one."""
    failure = point.failure()
    return failure if failure and int(failure.get("attempt", 1)) > attempt else None


def _attempt(point: Point, settings: Settings, log: Callable[[str], None] | None) -> None:
    """Compute the point, and write its tables and record, or its failure.

    All output of the process goes to the point's log, unless `log` takes each line.
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
        for part in point.folder.glob(f".*{PART}"):  # of an attempt that was killed
            part.unlink()
        point.write_note("attempt", note)
        reset_peak_memory()
        store = Store(point.results / "store")
        tables = _compute(point, settings, store, log)
        write_result(point, settings, tables, store, note)
    except Exception as error:
        write_failure(point, "raised", _describe(error), _trace(error), number)
        raise
    (point.folder / "attempt.json").unlink()


def _compute(
    point: Point, settings: Settings, store: Store, log: Callable[[str], None] | None
) -> Mapping[str, pd.DataFrame]:
    """The point's tables; its lines, and its traceback, go to its log."""
    from experiments.point.run import run_point  # all that computes, only where a point runs

    with (
        growing(point.folder / "log.txt") as file,
        _output_to(file) if log is None else nullcontext(),
        store.timed("total"),
    ):

        def write_line(line: str) -> None:
            file.write(f"{line}\n")
            if log is not None:
                log(line)

        try:
            return run_point(settings, store, write_line)
        except Exception as error:
            file.write(_trace(error) or f"{error}\n")
            raise


def _describe(error: Exception) -> str:
    """Type and message of an error, on one line; the message alone where it says all."""
    if isinstance(error, NoAnswer):
        return str(error)
    return " ".join(f"{type(error).__name__}: {error}".split())


def _trace(error: Exception) -> str:
    """Where an error was raised; empty where its message says all."""
    return "" if isinstance(error, NoAnswer) else traceback.format_exc()


@contextmanager
def _output_to(file: TextIO) -> Iterator[None]:
    """Send all that this process prints, from whatever language, to a file."""
    usual = {number: os.dup(number) for number in (1, 2)}
    sys.stdout.flush()
    sys.stderr.flush()
    for number in usual:
        os.dup2(file.fileno(), number)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        for number, copy in usual.items():
            os.dup2(copy, number)
            os.close(copy)
