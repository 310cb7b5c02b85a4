"""What a sweep says about points that cannot be run, and about points that failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from experiments.sweep.plan import PlannedPoint
from experiments.sweep.runner import Outcome
from experiments.terminal import counted


class SweepFailed(Exception):
    """Some points failed; the message describes each."""


def describe_problems(problems: Mapping[str, Sequence[str]], total: int) -> str:
    """The problems of a sweep's configs: each once, with the points that have it.

    Args:
        problems: the names of the points that have a problem, by its message.
        total: number of the sweep's points.
    """
    lines = []
    for problem, names in problems.items():
        where = "all points" if len(names) == total else f"{len(names)} of {total} points"
        example = f", such as {names[0]}" if len(names) < total else ""
        lines.append(f"{problem} [{where}{example}]" if total > 1 else problem)
    return "\n".join(lines)


def describe_failures(outcome: Outcome, total: int) -> str:
    """The tracebacks of failed points, equal ones once, then a table with a line for each."""
    by_trace: dict[str, list[PlannedPoint]] = {}
    for planned, failure in outcome.failures:
        by_trace.setdefault(failure["traceback"].rstrip(), []).append(planned)
    texts = []
    for trace, points in by_trace.items():
        more = f" (and {len(points) - 1} more)" if len(points) > 1 else ""
        texts.append(f"--- {points[0].name}{more}: {points[0].point.folder / 'log.txt'}")
        texts += [trace] if trace else []
    count, not_started = len(outcome.failures), len(outcome.not_started)
    width = max(len(planned.name) for planned, _ in outcome.failures)
    return "\n".join(
        [
            *texts,
            f"{count} of {counted(total, 'point')} failed, and no table is written; the others are "
            "kept, and the same command runs what is missing:",
            *(
                f"  {failure['reason']:8}{planned.name:{width}}  {failure['error']}"
                for planned, failure in outcome.failures
            ),
            *([f"not started: {counted(not_started, 'point')}"] if not_started else []),
        ]
    )
