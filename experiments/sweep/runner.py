"""Points of a sweep, run until each is done or has failed, with any launcher.

What counts is what points leave on disk. A launcher's own account of a job is used only where a
point could not leave its own: its process was killed, or never started.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.utils import JobReturn, JobStatus

from experiments.config.settings import SweepSettings
from experiments.sweep.attempt import record_death
from experiments.sweep.plan import PlannedPoint
from experiments.terminal import counted
from experiments.tracking.points import State

Launch = Callable[[Sequence[Sequence[str]]], Sequence[JobReturn]]
Failures = dict[PlannedPoint, dict[str, Any]]

_PAUSE = 0.5  # [s] between looks at points that others run


@dataclass(frozen=True)
class Outcome:
    """How the points that were to run ended.

    Attributes:
        failures: content of `failure.json` of each that failed, in the order of the plan.
        not_started: those that were left out after a failure.
    """

    failures: list[tuple[PlannedPoint, dict[str, Any]]]
    not_started: list[PlannedPoint]


def run_points(points: Sequence[PlannedPoint], launch: Launch, options: SweepSettings) -> Outcome:
    """Run points until each is done or has failed, here or in another sweep.

    Args:
        points: the points.
        launch: runs `experiments.sweep.worker.run_task` for each of some jobs.
        options: `force`, `retries` and `fail_fast` count.
    """
    by_others = [planned for planned in points if planned.state is State.RUNNING]
    ready = [planned for planned in points if planned.state is not State.RUNNING]
    tries_left = dict.fromkeys(points, 1 + options.retries)
    failures: Failures = {}
    not_started: list[PlannedPoint] = []
    while ready or by_others:
        retry = []
        attempts_before = {planned: planned.point.attempts() for planned in ready}
        returns = launch([planned.job for planned in ready]) if ready else []
        for planned, returned in zip(ready, returns, strict=True):
            if returned.status is JobStatus.UNKNOWN:
                not_started.append(planned)
            elif returned.status is JobStatus.FAILED:
                # Its process may have been killed just after it was done.
                if planned.point.is_done(attempts_before[planned] if options.force else 0):
                    continue
                tries_left[planned] -= 1
                failure = record_death(
                    planned.point, returned._return_value, attempts_before[planned]
                )
                if tries_left[planned]:
                    retry.append(planned)
                else:
                    failures[planned] = failure
            elif returned.return_value == State.RUNNING:
                by_others.append(planned)
        if options.fail_fast and failures:
            not_started += by_others
            break
        if by_others and not retry:
            ended = _wait_for_any(by_others)
            by_others = [planned for planned in by_others if planned not in ended]
            for planned in ended:
                if (failure_of_others := planned.point.failure()) is not None:
                    failures[planned] = failure_of_others
                elif not planned.point.is_done():  # the process that ran it was stopped
                    retry.append(planned)
        ready = retry
    return Outcome([(each, failures[each]) for each in points if each in failures], not_started)


def _wait_for_any(points: Sequence[PlannedPoint]) -> list[PlannedPoint]:
    """Those points that no process runs any more, as soon as there are some."""
    names = ", ".join(planned.name or planned.point.identity for planned in points[:5])
    more = ", ..." if len(points) > 5 else ""
    print(f"waiting for {counted(len(points), 'point')} that another process runs: {names}{more}")
    while True:
        ended = [planned for planned in points if not planned.point.is_running()]
        if ended:
            return ended
        time.sleep(_PAUSE)
