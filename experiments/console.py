"""What a person reads on the terminal: a line or a small table for each part of a result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from mlci.diagnosis import Diagnosis
from mlci.spaces import StateSpace


def words(name: str) -> str:
    """A column's or dimension's name as a reader would write it."""
    return name.replace("_", " ")


def trial_line(counts: Mapping[str, int]) -> str:
    """How many demonstrations were kept, and why the others were not."""
    rejected = ", ".join(f"{n} {words(kind)}" for kind, n in counts.items() if kind != "kept")
    return f"demonstrations  {counts['kept']} of {sum(counts.values())} kept ({rejected})"


def diagnosis_lines(
    diagnosis: Diagnosis, names: Sequence[str], unreachable: int, tasks: int
) -> Iterator[str]:
    """How the discretisation moves, and a warning for each thing that is wrong with it."""
    frozen = ", ".join(
        f"{words(name)} {share:.0%}" for share, name in zip(diagnosis.frozen, names, strict=True)
    )
    yield (
        f"discretisation  {diagnosis.stay:.0%} of moves stay in their cell, {diagnosis.leave:.0%} "
        f"leave the state space, {diagnosis.cells_crossed:.1f} cells crossed in a step"
    )
    yield f"                cells that no action changes: {frozen}"
    yield f"                {unreachable} of {tasks} goals cannot be reached"
    for concern in diagnosis.concerns(names, unreachable, tasks):
        yield f"       warning  {concern}"


def ranking_lines(hypotheses: pd.DataFrame, space: StateSpace, top: int) -> Iterator[str]:
    """The most likely hypotheses, and how much is left for there being none."""
    feasible = int(hypotheses["feasible"].sum())
    yield (
        f"hypotheses      {feasible} of {len(hypotheses)} feasible; probability that there is no "
        f"constraint {1 - hypotheses['posterior'].sum():.2g}"
    )
    yield "          rank  gain [nat]  posterior  region"
    best = hypotheses[hypotheses["feasible"]].sort_values(["rank", "hypothesis"]).head(top)
    for _, row in best.iterrows():
        sides = [
            f"{words(name)} {row[f'lower_{name}']:.4g} to {row[f'upper_{name}']:.4g} {unit}"
            for name, unit in zip(space.names, space.units, strict=True)
            if np.isfinite(row[f"lower_{name}"])
        ]
        true = "  (truth)" if row.get("covered_by_truth", False) else ""
        yield (
            f"          {row['rank']:4g}  {row['gain']:10.3f}  {row['posterior']:9.2g}  "
            f"{', '.join(sides)}{true}"
        )


def measure_lines(summary: pd.Series, ranks: pd.DataFrame, top: int) -> Iterator[str]:
    """The study's three measures."""
    yield (
        f"measures        final-state error {summary['final_state_error']:.3f}; violation distance "
        f"{summary['violation_distance']:.2f} each (floor {summary['violation_floor']:.2f}), "
        f"{summary['violation_distance_pooled']:.2f} pooled"
    )
    if ranks["rank"].isna().all():
        yield "                nothing is forbidden, so there is no truth to rank"
        return
    sizes = ranks["demonstrations"]
    for size in sorted({1, 5, 9, sizes.max()}.intersection(sizes)):
        rows = ranks[sizes == size]
        low, median, high = rows["rank"].quantile([0.1, 0.5, 0.9])
        yield (
            f"                rank of the truth after {size}: median {median:g} (80 % between "
            f"{low:g} and {high:g}), top {top} in {rows[f'share_top_{top}'].mean():.0%} of random "
            "subsets"
        )


def table_lines(rows: Sequence[Sequence[object]], width: int | None = None) -> Iterator[str]:
    """Rows, the first of them the head, in aligned columns.

    Args:
        rows: equally many cells each; numbers are set to the right.
        width: of the terminal; columns that do not fit are left out and counted. None takes any.
    """
    texts = [[_cell(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*texts, strict=True)]
    fitting = len(widths)
    while width is not None and fitting > 1 and sum(widths[:fitting]) + 2 * (fitting - 1) > width:
        fitting -= 1
    right = [
        all(isinstance(cell, int | float | None) for cell in column)
        for column in zip(*rows[1:], strict=True)
    ] or [False] * len(widths)
    for row in texts:
        cells = [
            text.rjust(size) if to_right else text.ljust(size)
            for text, size, to_right in zip(row[:fitting], widths, right, strict=False)
        ]
        yield "  ".join(cells).rstrip()
    if fitting < len(widths):
        yield f"({', '.join(texts[0][fitting:])}: not shown, the terminal is too narrow)"


def _cell(value: object) -> str:
    """A value in a table for people."""
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def job_names(jobs: Sequence[Sequence[str]]) -> list[str]:
    """What tells each job from the others, as a person would type it."""
    shared = set(jobs[0]).intersection(*jobs) if len(jobs) > 1 else set()
    names = [" ".join(part for part in job if part not in shared) for job in jobs]
    return [name.replace("'", "") or "defaults" for name in names]
