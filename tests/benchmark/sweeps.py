"""What a point of a sweep costs beside its own work: planning, collating, files."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from experiments.collate.join import collate
from experiments.tracking.points import Point
from experiments.tracking.trees import plain
from tests.benchmark.configs import composed
from tests.benchmark.timing import ROOT, Cost, Row, median_seconds

FEW, MANY, RUN = 20, 220, 30  # points that are planned, and that run


def run(words: list[str], results: Path) -> tuple[float, float]:
    """Processor time [s] and peak memory [MB] of a sweep or a point, its workers' time included."""
    command = [sys.executable, str(ROOT / "experiments" / "run.py"), *words, f"results={results}"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(command)} failed with status {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def smallest(count: int) -> list[str]:
    """A sweep of so many points, of the smallest kind."""
    return ["-m", "scale=smoke", "truth=wall", f"temperature=range(1,{count + 1})"]


def sweep_rows(results: Path) -> tuple[list[Row], list[Cost]]:
    """Measure in an empty folder of results."""
    (few_s, few_mb), (many_s, many_mb) = (
        run([*smallest(count), "sweep.dry_run=true"], results) for count in (FEW, MANY)
    )
    run([*smallest(RUN), "study=sized"], results)
    points = [
        Point.planned(
            plain(composed("scale=smoke", "truth=wall", f"temperature={number}")), results
        )
        for number in range(1, RUN + 1)
    ]
    entries = list((results / "points").rglob("*"))
    blocks = sum(path.stat().st_blocks for path in entries) * 512
    stages = len(list((results / "store").rglob("*")))
    largest = ["truth=c1", "grid=1600", "dt=0.1", "actions=15"]
    largest_s, largest_mb = run(largest, results / "largest")
    rows = [
        Row(
            "plan_point",
            (many_s - few_s) / (MANY - FEW),
            float("nan"),
            1,
            f"composing, checking and looking for a point's record: {MANY} points less {FEW}",
        ),
        Row(
            "collate_point",
            median_seconds(lambda: collate(points, results / "sized" / "tables"), 5) / RUN,
            float("nan"),
            5,
            f"collating a point's tables: {RUN} points of the smallest kind",
        ),
        Row(
            "largest_paper_point",
            largest_s,
            float("nan"),
            1,
            f"a point of the paper's largest from nothing: {' '.join(largest)}",
        ),
    ]
    costs = [
        Cost(
            "plan_point_memory",
            max(0.0, many_mb - few_mb) / (MANY - FEW),
            "MB",
            "memory of the planning process for each point",
        ),
        Cost("point_inodes", len(entries) / RUN, "inodes", "files and folders of a point"),
        Cost("point_disk", blocks / RUN / 1024, "kB", "disk of a point of the smallest kind"),
        Cost("stages_inodes", stages, "inodes", f"of the stages that these {RUN} points share"),
        Cost("largest_paper_point_memory", largest_mb, "MB", "peak of a point of the largest kind"),
    ]
    return rows, costs
