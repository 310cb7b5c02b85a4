"""Time the project and write what was found: python -m tests.benchmark [--results DIR] [PART ...]

Every time is processor time of one thread, so that other work on the machine matters little; a
floor is a measured rate of this machine times the bytes or calls that an algorithm cannot do
without. Tables go to results/benchmark/tables: `peers` (who solves the same problem, and how fast),
`benchmark` (times of what people wait for), `costs` (files and memory of points), `scale` (time and
memory by states) and `growth` (by hypotheses, demonstrations, actions, steps and dimensions).

Parts are safe, demonstrations, inference, waits, points and growth. Where some are named, only
these are done, and nothing is written.
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import argparse
import json
import subprocess
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.study import collated, write_collated
from tests.benchmark import contest, demonstrations, growth, inference, kernels, safe_sets, sweeps
from tests.benchmark.configs import telescope


def main() -> int:
    """Measure everything, print it and write the tables."""
    parser = argparse.ArgumentParser(prog="benchmark", description=__doc__)
    parser.add_argument("--results", type=Path, default=timing.ROOT / "results", metavar="DIR")
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], metavar="PART")
    arguments = parser.parse_args()
    folder, begin = arguments.results / "benchmark", time.time()
    machine = timing.machine()
    print(textwrap.fill(", ".join(f"{key} {value}" for key, value in machine.items()), 80) + "\n")
    rows: dict[str, list[Any]] = {name: [] for name in TABLES}
    for part in arguments.parts or PARTS:
        PARTS[part](rows)
    print(f"{time.time() - begin:.0f} s in all")
    if not arguments.parts:
        _write(folder, rows, machine)
        print(f"written: {folder / 'tables'}")
    return 0


def _contests(which: Iterator[contest.Contest], rows: dict[str, list[Any]]) -> None:
    """Hold contests, and print each when it is over."""
    for each in which:
        found = contest.measure(each)
        rows["peers"] += found
        print(contest.show(found), flush=True)


def _waits(rows: dict[str, list[Any]]) -> None:
    """What people wait for."""
    found = [
        *kernels.pendulum_rows(20, 1),
        *kernels.pendulum_rows(40, 1),
        *kernels.pendulum_rows(20, 3),
        *kernels.telescope_rows(telescope(), 1),
        *kernels.telescope_rows(telescope(), 2),
        *kernels.demonstrator_rows(),
    ]
    _show_times(found)
    rows["benchmark"] += map(asdict, found)


def _points(rows: dict[str, list[Any]]) -> None:
    """What points of a sweep cost beside their own work."""
    with tempfile.TemporaryDirectory() as scratch:
        found, costs = sweeps.sweep_rows(Path(scratch))
    _show_times(found)
    for cost in costs:
        print(f"{cost.value:>10.3g} {cost.unit:<6}  {cost.what}")
    rows["benchmark"] += map(asdict, found)
    rows["costs"] += map(asdict, costs)


def _growth(rows: dict[str, list[Any]]) -> None:
    """How time and memory grow, each size in a process of its own."""
    print(f"\n{'':<22}{'discretise':>11}{'infer':>10}{'slopes':>13}{'peak':>9}{'floor':>9}")
    for factor, sizes in growth.FACTORS.items():
        before: dict[str, Any] | None = None
        for value in sizes:
            row = _apart(factor, value)
            rows["scale" if factor in ("states", "torus_states") else "growth"].append(row)
            slopes = ""
            if before is not None:
                more = np.log(value / before["value"])
                slopes = " ".join(
                    f"{np.log(row[name] / before[name]) / more:6.2f}"
                    for name in ("discretise_s", "infer_s")
                )
            times = (contest.in_units(row[name]) for name in ("discretise_s", "infer_s"))
            name = f"{factor.replace('_', ' ')} {value}"
            print(f"{name:<22}{next(times):>11}{next(times):>10}{slopes:>13}", end="")
            print(f"{row['peak_mb']:>6.0f} MB{row['floor_mb']:>6.0f} MB", flush=True)
            before = row


TABLES = ("peers", "benchmark", "costs", "scale", "growth")
PARTS: dict[str, Callable[[dict[str, list[Any]]], None]] = {
    "safe": lambda rows: _contests(safe_sets.contests(), rows),
    "demonstrations": lambda rows: _contests(demonstrations.contests(), rows),
    "inference": lambda rows: _contests(inference.contests(), rows),
    "waits": _waits,
    "points": _points,
    "growth": _growth,
}


def _write(folder: Path, rows: dict[str, list[Any]], machine: dict[str, Any]) -> None:
    """The tables, with the machine in each row."""
    digests = {}
    for name, found in rows.items():
        table = pd.DataFrame(found)
        if name == "benchmark":
            table.insert(3, "ratio", table["median_s"] / table["floor_s"])
        for column, value in machine.items():
            table[column] = value
        content = csv_bytes(_round(table))
        digests[f"{name}.csv"] = digest(content)
        replace_file(folder / "tables" / f"{name}.csv", content)
    write_collated(folder, collated({}, digests))  # so that who reads the tables can check them


def _apart(factor: str, value: int) -> dict[str, Any]:
    """A row of the growth table, in a process whose memory is its own."""
    command = [sys.executable, "-m", "tests.benchmark.growth", factor, str(value)]
    done = subprocess.run(command, cwd=timing.ROOT, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, Any] = json.loads(done.stdout)
    return row


def _round(table: pd.DataFrame) -> pd.DataFrame:
    """Three significant digits: more are noise."""
    floats = table.select_dtypes("float").columns
    return table.assign(**{name: table[name].map(lambda x: float(f"{x:.3g}")) for name in floats})


def _show_times(rows: list[timing.Row]) -> None:
    """Print times, and what the paper says of them."""
    for row in rows:
        said = f" (paper: {row.paper})" if row.paper else ""
        line = f"{contest.in_units(row.median_s):>10}  {row.what}{said}"
        print(textwrap.fill(line, 80, subsequent_indent=" " * 12))


if __name__ == "__main__":
    sys.exit(main())
