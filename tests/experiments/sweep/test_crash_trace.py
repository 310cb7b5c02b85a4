"""What is known of a process that could not say how it ended."""

import subprocess
import sys
from pathlib import Path

import pytest

from experiments.config.paths import CHECKOUT
from experiments.sweep.crash_trace import crash_trace, take_crash_trace
from experiments.tracking.points import Point

PROCESS = """
import os, sys, threading, time
from pathlib import Path
from experiments.sweep.crash_trace import crash_trace
from experiments.tracking.points import Point

def inner():
    {end}

def attempt(point):
    with crash_trace(point, {limit}):
        inner()

threading.Thread(target=time.sleep, args=[60], daemon=True).start()
attempt(Point(Path(sys.argv[1]), "point"))
"""


@pytest.fixture
def point(tmp_path: Path) -> Point:
    point = Point(tmp_path, "point")
    point.folder.mkdir(parents=True)
    return point


@pytest.mark.parametrize(
    ("end", "limit", "cause", "late"),
    [
        ("time.sleep(60)", 0.2, "Timeout (0:00:00.200000)!", True),
        ("os.abort()", None, "Fatal Python error: Aborted", False),
        ("os.abort()", 60.0, "Fatal Python error: Aborted", False),
    ],
)
def test_trace_is_that_of_the_attempt_inside_its_function(
    end: str, limit: float | None, cause: str, late: bool, point: Point
) -> None:
    code = PROCESS.format(end=end, limit=limit)
    command = [sys.executable, "-c", code, str(point.results)]
    process = subprocess.run(command, cwd=CHECKOUT, capture_output=True, timeout=600, check=False)
    assert process.returncode != 0
    trace, was_late = take_crash_trace(point, "attempt")
    first, *lines = trace.splitlines()
    assert (first, was_late) == (cause, late)
    assert [line.rpartition(" in ")[2] for line in lines] == ["inner"]
    # It is taken once, so that it is not held against the next attempt.
    assert take_crash_trace(point, "attempt") == ("", False)


def test_nothing_is_left_of_an_attempt_that_ends_by_itself(point: Point) -> None:
    with crash_trace(point, 60):
        assert [path.name for path in point.folder.iterdir()] == ["crash_trace.txt"]
    with pytest.raises(ArithmeticError), crash_trace(point, None):
        raise ArithmeticError
    assert not list(point.folder.iterdir())
