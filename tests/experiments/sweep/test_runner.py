"""Running points to the end, with a launcher that only says how each ended."""

from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest
from hydra.core.utils import JobReturn, JobStatus

from experiments.sweep import runner
from experiments.sweep.plan import PlannedPoint
from experiments.tracking.points import Point, State

KILLED = ChildProcessError("the worker process was killed by SIGKILL")


def planned(results: Path, name: str, state: State = State.MISSING) -> PlannedPoint:
    point = Point.planned({"name": name}, results)
    point.folder.mkdir(parents=True)
    return PlannedPoint((f"name={name}",), name, point, state)


def write(point: Point, name: str, attempt: int) -> None:
    """The note that ends an attempt."""
    note = {"identity": point.identity, "source": point.source, "attempt": attempt}
    if name == "failure":
        note |= {"reason": "raised", "error": "of its own"}
    else:
        note |= {"config": point.config, "files": {}, "stages": {}, "git": {"diff": None}}
    point.write_note(name, note)


class Launcher:
    """Ends each launch of a point as the next of its words says, and keeps what was launched."""

    def __init__(self, points: Sequence[PlannedPoint], **ends: str) -> None:
        self.points = {each.job: each.point for each in points}
        self.ends = {f"name={name}": words.split() for name, words in ends.items()}
        self.launched: list[str] = []

    def __call__(self, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
        self.launched.append(" ".join(job.removeprefix("name=") for (job,) in jobs))
        return [self._end(tuple(job)) for job in jobs]

    def _end(self, job: tuple[str, ...]) -> JobReturn:
        point, end = self.points[job], self.ends[job[0]].pop(0)
        attempt = point.attempts() + 1
        if end in ("done", "late"):  # late: its process is killed when all is written
            write(point, "record", attempt)
        if end == "raised":
            write(point, "failure", attempt)
        if end in ("done", "elsewhere"):
            state = State.DONE if end == "done" else State.RUNNING
            return JobReturn(list(job), status=JobStatus.COMPLETED, _return_value=state)
        if end == "unstarted":
            return JobReturn(list(job))
        return JobReturn(list(job), status=JobStatus.FAILED, _return_value=KILLED)


def run(
    points: Sequence[PlannedPoint], retries: int = 0, fail_fast: bool = False, force: bool = False,
    **ends: str,
) -> tuple[list[str], dict[str, str], list[str]]:  # fmt: skip
    """What was launched each time, the error of each failed point, and what was not started."""
    launcher = Launcher(points, **ends)
    options = SimpleNamespace(retries=retries, fail_fast=fail_fast, force=force)
    outcome = runner.run_points(points, launcher, options)
    assert not any(launcher.ends.values())
    failures = {each.name: failure["error"] for each, failure in outcome.failures}
    return launcher.launched, failures, [each.name for each in outcome.not_started]


@pytest.fixture
def points(tmp_path: Path) -> list[PlannedPoint]:
    return [planned(tmp_path, name) for name in "abc"]


@pytest.fixture
def meanwhile(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], None]], None]:
    """What happens while the runner waits for others."""

    def use(action: Callable[[], None]) -> None:
        monkeypatch.setattr(runner.time, "sleep", lambda seconds: action())

    return use


def test_point_is_launched_once_more_than_it_may_be_retried(points: list[PlannedPoint]) -> None:
    ends = {"a": "raised killed raised", "b": "done", "c": "raised done"}
    launched, failures, unstarted = run(points, retries=2, **ends)
    assert launched == ["a b c", "a c", "a"]
    assert failures == {"a": "of its own"}
    assert unstarted == []


def test_without_retries_nothing_is_launched_twice(points: list[PlannedPoint]) -> None:
    launched, failures, _ = run(points, a="done", b="killed", c="raised")
    assert launched == ["a b c"]
    assert list(failures) == ["b", "c"]  # in the order of the plan
    assert failures["b"] == "ChildProcessError: the worker process was killed by SIGKILL"
    assert points[1].point.failure()["attempt"] == 1


def test_process_killed_after_the_record_is_no_failure(points: list[PlannedPoint]) -> None:
    assert run(points, a="late", b="done", c="done")[1] == {}
    assert points[0].point.failure() is None


def test_forced_point_is_done_only_by_a_new_attempt(points: list[PlannedPoint]) -> None:
    for each in points:
        write(each.point, "record", 1)
    launched, failures, _ = run(points, force=True, a="killed", b="late", c="done")
    assert launched == ["a b c"]
    assert list(failures) == ["a"]


def test_fail_fast_leaves_the_rest_and_waits_for_nobody(
    points: list[PlannedPoint], meanwhile: Callable[..., None]
) -> None:
    meanwhile(lambda: pytest.fail("it waits"))
    with points[1].point.lock:
        ends = {"a": "raised", "b": "elsewhere", "c": "unstarted"}
        _, failures, unstarted = run(points, fail_fast=True, **ends)
    assert list(failures) == ["a"]
    assert unstarted == ["c", "b"]


def test_failure_stops_nothing_unless_asked_to(
    points: list[PlannedPoint], meanwhile: Callable[..., None]
) -> None:
    lock = points[1].point.lock
    lock.acquire()

    def finish() -> None:
        write(points[1].point, "record", 1)
        lock.release()

    meanwhile(finish)
    _, failures, unstarted = run(points, a="raised", b="elsewhere", c="done")
    assert (list(failures), unstarted) == (["a"], [])
    assert not lock.is_locked


@pytest.mark.parametrize(
    ("end", "launched", "failures"),
    [
        ("record", ["b"], {}),
        ("failure", ["b"], {"a": "of its own"}),
        ("", ["b", "a"], {}),  # its process was stopped, and the point is run here
    ],
)
def test_point_that_another_sweep_runs_is_waited_for(
    end: str,
    launched: list[str],
    failures: dict[str, str],
    tmp_path: Path,
    meanwhile: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    points = [planned(tmp_path, "a", State.RUNNING), planned(tmp_path, "b")]
    lock = points[0].point.lock
    lock.acquire()

    def finish() -> None:
        if end:
            write(points[0].point, end, 1)
        lock.release()

    meanwhile(finish)
    ends = {"a": "" if end else "done", "b": "done"}
    assert run(points, **ends) == (launched, failures, [])
    assert capsys.readouterr().out == "waiting for 1 point that another process runs: a\n"


def test_a_failed_point_is_tried_again_before_others_are_waited_for(
    points: list[PlannedPoint], meanwhile: Callable[..., None]
) -> None:
    lock, seen = points[1].point.lock, list[int]()
    lock.acquire()

    def finish() -> None:
        seen.append(points[0].point.attempts())
        write(points[1].point, "record", 1)
        lock.release()

    meanwhile(finish)
    launched, failures, _ = run(points, retries=1, a="raised done", b="elsewhere", c="done")
    assert (launched, failures, seen) == (["a b c", "a"], {}, [2])
