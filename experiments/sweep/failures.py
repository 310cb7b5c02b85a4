"""What went wrong in a sweep, in words: points that cannot be run, and points that failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from experiments.sweep.execution import Outcome, Planned


def gather(problems: Mapping[str, Sequence[str]], total: int) -> str:
    """The problems of a sweep's points: each once, with the points that have it."""
    lines = []
    for problem, jobs in problems.items():
        where = "all points" if len(jobs) == total else f"{len(jobs)} of {total} points"
        example = f", such as {jobs[0]}" if len(jobs) < total else ""
        lines.append(f"{problem} [{where}{example}]" if total > 1 else problem)
    return "\n".join(lines)


def describe_failures(outcome: Outcome, total: int) -> str:
    """The tracebacks of failed points, equal ones once, then a table with a line for each."""
    traces: dict[str, list[Planned]] = {}
    for planned, failure in outcome.failures:
        traces.setdefault(failure["traceback"].rstrip(), []).append(planned)
    texts = []
    for trace, alike in traces.items():
        more = f" (and {len(alike) - 1} more)" if len(alike) > 1 else ""
        texts.append(f"--- {alike[0].name}{more}: {alike[0].point.folder / 'log.txt'}")
        texts += [trace] if trace else []
    count, left = len(outcome.failures), len(outcome.not_started)
    width = max(len(planned.name) for planned, _ in outcome.failures)
    return "\n".join(
        [
            *texts,
            f"{count} of {total} points failed, and no table is written; the others are kept, and "
            "the same command runs what is missing:",
            *(
                f"  {failure['reason']:8}{planned.name:{width}}  {failure['error']}"
                for planned, failure in outcome.failures
            ),
            *([f"{left} points were not started"] if left else []),
        ]
    )
