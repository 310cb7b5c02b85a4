"""Points of a sweep: what is to run, and running it to the end with whatever launcher there is.

What counts is what points leave on disk. A launcher's own account of a job is used only where a
point could not leave its own: its process was killed, or never started.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.utils import JobReturn, JobStatus

from experiments.config.settings import SweepSettings
from experiments.sweep.attempts import bury
from experiments.tracking.points import Point, State

Launch = Callable[[Sequence[Sequence[str]]], Sequence[JobReturn]]

_PAUSE = 0.5  # [s] between looks at points that others run


@dataclass(frozen=True, eq=False)
class Planned:
    """A point of a sweep.

    Attributes:
        job: the overrides that make it.
        name: what tells it from the sweep's other points.
        point: where it is kept.
        state: what was known of it when the sweep was planned.
    """

    job: tuple[str, ...]
    name: str
    point: Point
    state: State


@dataclass(frozen=True)
class Outcome:
    """How the points that were to run ended.

    Attributes:
        failures: content of `failure.json` of each that failed, in the order of the plan.
        not_started: those that were left out after a failure.
    """

    failures: list[tuple[Planned, dict[str, Any]]]
    not_started: list[Planned]


def chosen(plan: Iterable[Planned], options: SweepSettings) -> list[Planned]:
    """The points that the options have run."""
    if options.only is not None:
        found = [planned for planned in plan if planned.state in options.only]
    else:
        found = [planned for planned in plan if options.force or planned.state != State.DONE]
    return found[: options.limit]


def count_states(plan: Iterable[Planned]) -> str:
    """How many points are in each state, as words."""
    counts = Counter(planned.state for planned in plan)
    return ", ".join(f"{counts[state]} {state}" for state in State if counts[state])


def run_points(todo: Sequence[Planned], launch: Launch, options: SweepSettings) -> Outcome:
    """Run points until each is done or has failed, here or in another sweep.

    Args:
        todo: the points.
        launch: runs `experiments.sweep.worker.run_task` for each of some jobs.
        options: `force`, `retries` and `fail_fast` count.
    """
    elsewhere = [planned for planned in todo if planned.state is State.RUNNING]
    ready = [planned for planned in todo if planned.state is not State.RUNNING]
    tries = dict.fromkeys(todo, 1 + options.retries)
    failures: dict[Planned, dict[str, Any]] = {}
    not_started: list[Planned] = []
    while ready or elsewhere:
        again = []
        before = {planned: planned.point.attempts() for planned in ready}
        returns = launch([planned.job for planned in ready]) if ready else []
        for planned, returned in zip(ready, returns, strict=True):
            if returned.status is JobStatus.UNKNOWN:
                not_started.append(planned)
            elif returned.status is JobStatus.FAILED:
                # Its process may have been killed just after it was done.
                if planned.point.is_done(before[planned] if options.force else 0):
                    continue
                tries[planned] -= 1
                failure = bury(planned.point, returned._return_value, before[planned])
                if tries[planned]:
                    again.append(planned)
                else:
                    failures[planned] = failure
            elif returned.return_value == State.RUNNING:
                elsewhere.append(planned)
        if options.fail_fast and failures:
            not_started += elsewhere
            break
        if not again and elsewhere:
            free = _wait_for_any(elsewhere)
            elsewhere = [planned for planned in elsewhere if planned not in free]
            for planned in free:
                if (failed := planned.point.failure()) is not None:
                    failures[planned] = failed
                elif not planned.point.is_done():  # who ran it was stopped
                    again.append(planned)
        ready = again
    return Outcome([(each, failures[each]) for each in todo if each in failures], not_started)


def _wait_for_any(elsewhere: Sequence[Planned]) -> list[Planned]:
    """Those points that nobody runs any more, as soon as there are some."""
    shown = ", ".join(planned.name or planned.point.identity for planned in elsewhere[:5])
    more = ", ..." if len(elsewhere) > 5 else ""
    print(f"waiting for {len(elsewhere)} points that another process runs: {shown}{more}")
    while True:
        free = [planned for planned in elsewhere if not planned.point.is_running()]
        if free:
            return free
        time.sleep(_PAUSE)
