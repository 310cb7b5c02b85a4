"""Claim 3: the violation distance of equation (11) (Fig. 4), its floor and its pooled value."""

from __future__ import annotations

import math

from paper_figures.report.means import Means, grid, measure
from paper_figures.report.study_tables import Results, command
from paper_figures.report.verdict import Check, Claim, Part

LITTLE = 0.1  # relative change that counts as little


def claim(results: Results) -> Claim:
    """Write claim 3.

    Raises:
        Missing: the study `paper` is not there yet.
    """
    distance = measure(results, "violation_distance")
    truths, steps = distance.truths, distance.steps
    finer = [cells for cells in distance.cells if cells > 400]
    little = f"{LITTLE:.0%}"
    return Claim(
        title="Violation distance",
        paper="400 cells predict better than 100 which constraints a demonstration violates; more "
        "cells change little, and so does the time step.",
        parts=[
            Part(
                "lower at 400 cells than at 100",
                "lower at 400 than at 100 cells, for a truth and dt",
                [_drops(distance, truth, dt) for truth in truths for dt in steps],
            ),
            Part(
                "little change beyond 400 cells",
                f"within {little} of 400 cells, for a truth, a finer grid and a dt",
                [
                    _near(distance, truth, cells, dt)
                    for truth in truths
                    for cells in finer
                    for dt in steps
                ],
            ),
            Part(
                "flat in dt",
                f"at every dt within {little} of the mean over all dt, for a truth and 400 or more "
                "cells",
                [_flat(distance, truth, cells) for truth in truths for cells in [400, *finer]],
            ),
        ],
        numbers="Regions, mean over demonstrations and seeds:\n\n"
        + grid(distance)
        + "\nA single demonstration cannot come nearer than the floor, the sum of 2 Phi (1 - Phi), "
        "on average, even if the tabular model were exact:\n\n"
        + grid(measure(results, "violation_floor"))
        + "\nPooled over the demonstrations of a seed before the difference is taken, which could "
        "go to 0:\n\n" + grid(measure(results, "violation_distance_pooled")),
        why="",
        command=command("paper"),
    )


def _drops(distance: Means, truth: str, dt: float) -> Check:
    """Whether 400 cells have a lower distance than 100."""
    coarse, fine = distance[truth, 100, dt], distance[truth, 400, dt]
    return Check(f"{truth.upper()}, dt {dt:g}", fine.lower_than(coarse), f"{coarse} to {fine}")


def _near(distance: Means, truth: str, cells: int, dt: float) -> Check:
    """Whether a finer grid has about the distance of 400 cells."""
    base, fine = distance[truth, 400, dt].value, distance[truth, cells, dt].value
    change = fine / base - 1
    return Check(
        f"{truth.upper()}, {cells} cells, dt {dt:g}",
        abs(change) <= LITTLE,
        "no value" if math.isnan(change) else f"{change:+.0%}",
    )


def _flat(distance: Means, truth: str, cells: int) -> Check:
    """Whether the time step hardly matters."""
    values = [distance[truth, cells, dt].value for dt in distance.steps]
    numbers = [value for value in values if not math.isnan(value)]
    mean = sum(numbers) / len(numbers) if numbers else math.nan
    off = max((abs(value / mean - 1) for value in numbers), default=math.nan)
    gaps = len(values) - len(numbers)
    return Check(
        f"{truth.upper()}, {cells} cells",
        off <= LITTLE and not gaps,
        f"up to {off:.0%}" + (f", no value at {gaps} dt" if gaps else ""),
    )
