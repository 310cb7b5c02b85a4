"""Time the project and write what was found: python -m tests.benchmark [--results DIR]

Every time is processor time of one thread, so that other work on the machine matters little; a
floor is a measured rate of this machine times the bytes or calls that an algorithm cannot do
without. Tables go to results/benchmark/tables: `benchmark` (times), `costs` (files and memory) and
`scale` (one task in four dimensions, from a thousand states to a million).
"""

from __future__ import annotations

from tests.benchmark import timing  # before numpy, which is told to use one thread

# isort: split

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from experiments.tracking.files import csv_bytes, digest, replace_file
from experiments.tracking.study import collated, write_collated
from tests.benchmark import kernels, sweeps
from tests.benchmark.configs import telescope

SIZES = (
    ("telescope", (8, 5, 5, 5)),
    ("telescope", (10, 5, 10, 5)),
    ("telescope", (10, 10, 10, 10)),
    ("telescope", (15, 13, 15, 11)),
    ("telescope", (20, 16, 20, 16)),
    ("telescope", (26, 21, 26, 21)),
    ("telescope", (40, 25, 40, 25)),
    ("torus", (18, 18, 18, 18)),
    ("torus", (32, 31, 32, 32)),
)


def main() -> int:
    """Measure everything, print it and write the tables."""
    parser = argparse.ArgumentParser(prog="benchmark", description=__doc__)
    parser.add_argument("--results", type=Path, default=timing.ROOT / "results", metavar="DIR")
    folder = parser.parse_args().results / "benchmark"
    machine = timing.machine()
    print(", ".join(f"{key} {value}" for key, value in machine.items()))
    work = [
        ("pendulum", lambda: kernels.pendulum_rows(20, 0.25, 1)),
        ("pendulum, 1600 cells", lambda: kernels.pendulum_rows(40, 0.25, 1)),
        ("pendulum, in-cell samples", lambda: kernels.pendulum_rows(20, 0.25, 3)),
        ("telescope", lambda: kernels.telescope_rows(telescope(), 1)),
        ("telescope, in-cell samples", lambda: kernels.telescope_rows(telescope(), 2)),
        ("demonstrator", kernels.demonstrator_rows),
    ]
    sizes: list[dict[str, object]] = []
    rows: list[timing.Row] = []
    with tqdm(total=len(work) + 1 + len(SIZES), unit="part", disable=None) as bar:
        for name, measure in work:
            bar.set_postfix_str(name)
            rows += measure()
            bar.update()
        bar.set_postfix_str("sweeps")
        with tempfile.TemporaryDirectory() as scratch:
            more, costs = sweeps.sweep_rows(Path(scratch))
        rows += more
        bar.update()
        for system, shape in SIZES:
            bar.set_postfix_str(f"{system}, {' x '.join(map(str, shape))} cells")
            sizes.append(_apart(system, shape))
            bar.update()
    times = pd.DataFrame([asdict(row) for row in rows])
    times.insert(3, "ratio", times["median_s"] / times["floor_s"])
    tables = {
        "benchmark": times,
        "costs": pd.DataFrame([asdict(cost) for cost in costs]),
        "scale": pd.DataFrame(sizes),
    }
    digests = {}
    for name, table in tables.items():
        for column, value in machine.items():
            table[column] = value
        content = csv_bytes(_round(table))
        digests[f"{name}.csv"] = digest(content)
        replace_file(folder / "tables" / f"{name}.csv", content)
    write_collated(folder, collated({}, digests))  # so that who reads the tables can check them
    _show(tables)
    print(f"written: {folder / 'tables'}")
    return 0


def _apart(system: str, shape: tuple[int, ...]) -> dict[str, object]:
    """A size of the scale table, in a process whose memory is its own."""
    command = [sys.executable, "-m", "tests.benchmark.scale", system, *map(str, shape)]
    done = subprocess.run(command, cwd=timing.ROOT, stdout=subprocess.PIPE, text=True, check=True)
    row: dict[str, object] = json.loads(done.stdout)
    return row


def _round(table: pd.DataFrame) -> pd.DataFrame:
    """Three significant digits: more are noise."""
    floats = table.select_dtypes("float").columns
    return table.assign(**{name: table[name].map(lambda x: float(f"{x:.3g}")) for name in floats})


def _show(tables: dict[str, pd.DataFrame]) -> None:
    """Print what was measured."""
    print(f"\n{'median [ms]':>12} {'floor [ms]':>11} {'ratio':>6}  what (paper: its statement)")
    for row in tables["benchmark"].itertuples():
        known = row.floor_s == row.floor_s
        bound = f"{1e3 * row.floor_s:11.3f} {row.ratio:6.1f}" if known else f"{'-':>11} {'-':>6}"
        said = f" (paper: {row.paper})" if row.paper else ""
        print(f"{1e3 * row.median_s:12.3f} {bound}  {row.what}{said}")
    print()
    for cost in tables["costs"].itertuples():
        print(f"{cost.value:12.3g} {cost.unit:<6}  {cost.what}")
    print()
    columns = ["system", "states", "largest_active_share", "discretise_s", "infer_s", "peak_mb"]
    print(tables["scale"][columns].to_string(index=False))


if __name__ == "__main__":
    sys.exit(main())
