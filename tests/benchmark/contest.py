"""Who is how fast at the same problem: answers are checked first, then times are taken in turn."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

OURS = "mlci"
_MOST = 15  # timed runs of a contender
_INSTALL = "not installed: pip install -e '.[bench]'"

Work = Callable[[], Any]


@dataclass(frozen=True)
class Contender:
    """Somebody who solves the problem.

    Attributes:
        name: what tables call it. Of those that differ behind a comma only, the first that is right
            is timed.
        prepare: imports and sets up whatever needs no time in daily use, and returns the work.
            ModuleNotFoundError says that the peer is not installed.
        share: part of the problem that the work does, where all of it would take too long; its time
            is divided by it.
        error: judges its answer where it is not the problem's own kind.
    """

    name: str
    prepare: Callable[[], Work]
    share: float = 1.0
    error: Callable[[Any], float] | None = None


@dataclass(frozen=True)
class Contest:
    """A problem and those who solve it, the first of them this project.

    Attributes:
        part: safe set, demonstrations, tabular model or inference.
        problem: in words, with its size.
        contenders: who solves it.
        error: how wrong an answer is.
        allowed: largest error of a right answer; None is 1.1 times this project's.
        measure: what the error is.
        floor: seconds that no program could do without on this machine, and of what; by the
            answer of this project.
        seconds: about how long all timed runs may take.
    """

    part: str
    problem: str
    contenders: Sequence[Contender]
    error: Callable[[Any], float]
    allowed: float | None
    measure: str
    floor: Callable[[Any], tuple[float, str]] | None = None
    seconds: float = 4.0


def measure(contest: Contest) -> list[dict[str, object]]:
    """A row for each contender and for the floor, see `results/README.md`."""
    rows: list[dict[str, object]] = []
    works: dict[int, Work] = {}
    limit, floor = contest.allowed, None
    for contender in contest.contenders:
        if any(
            rows[number]["who"].split(",")[0] == contender.name.split(",")[0] for number in works
        ):
            continue  # it has solved it with less
        row: dict[str, object] = {
            "part": contest.part,
            "problem": contest.problem,
            "who": contender.name,
            "median_s": np.nan,
            "spread": np.nan,
            "ratio": np.nan,
            "runs": 0,
            "error": np.nan,
            "measure": contest.measure,
            "state": "measured",
        }
        rows.append(row)
        try:
            work = contender.prepare()
            answer = work()  # does not count: caches fill, and peers compile
        except ImportError:
            row["state"] = _INSTALL
            continue
        except Exception as problem:  # a peer's own failure is a result of the benchmark
            if contender.name.startswith(OURS):
                raise
            row["state"] = f"failed: {type(problem).__name__}: {problem}".splitlines()[0]
            continue
        row["error"] = error = float((contender.error or contest.error)(answer))
        if contender.name.startswith(OURS):
            limit = 1.1 * error if limit is None else limit
            floor = None if contest.floor is None else contest.floor(answer)
        assert limit is not None
        if error <= limit:
            works[len(rows) - 1] = work
        else:
            row["state"] = f"wrong: {contest.measure} {error:.2g}, allowed {limit:.2g}"
    shares = {contender.name: contender.share for contender in contest.contenders}
    for number, times in _in_turn(works, contest.seconds).items():
        share = shares[str(rows[number]["who"])]
        low, median, high = np.quantile(np.array(times) / share, [0.25, 0.5, 0.75])
        rows[number] |= {"median_s": median, "spread": (high - low) / median, "runs": len(times)}
    if floor is not None:
        what = f"floor: {floor[1]}"
        rows.append(rows[0] | {"who": what, "median_s": floor[0], "spread": np.nan, "runs": 0})
    for row in rows:
        row["ratio"] = row["median_s"] / rows[0]["median_s"]  # type: ignore[operator]
    return rows


def _in_turn(works: dict[int, Work], seconds: float) -> dict[int, list[float]]:
    """Processor times of each work, one run of each after the other; a slow one has fewer runs."""
    times: dict[int, list[float]] = {number: [] for number in works}
    for _ in range(_MOST):
        for number, work in works.items():
            taken = times[number]
            if not taken or sum(taken) + np.mean(taken) <= seconds / len(works):
                start = time.process_time()
                work()
                taken.append(time.process_time() - start)
    return times


def show(rows: Sequence[dict[str, Any]]) -> str:
    """The rows of a contest in 80 columns."""
    first = rows[0]
    lines = [
        *textwrap.wrap(f"{first['part']}: {first['problem']}", 80, subsequent_indent="  "),
        f"  error: {first['measure']}",
        f"  {'':<36}{'median':>10}{'spread':>8}{'x mlci':>9}  {'error':>8}",
    ]
    for row in rows:
        if row["state"] != "measured":
            lines.append(f"  {row['who']:<20} {row['state'][:57]}")
            continue
        spread = "" if np.isnan(row["spread"]) else f"{50 * row['spread']:.0f} %"
        error = "" if row["who"].startswith("floor") else f"{row['error']:.2g}"
        lines.append(
            f"  {row['who'][:36]:<36}{in_units(row['median_s']):>10}{spread:>8}"
            f"{row['ratio']:>9.3g}  {error:>8}"
        )
    return "\n".join(lines) + "\n"


def in_units(seconds: float) -> str:
    """A time in the unit that suits it."""
    if seconds < 1e-3:
        return f"{1e6 * seconds:.3g} us"
    return f"{1e3 * seconds:.3g} ms" if seconds < 1 else f"{seconds:.3g} s"
