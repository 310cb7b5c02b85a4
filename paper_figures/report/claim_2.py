"""Claim 2: the final-state error of the tabular agent's policies on the true dynamics (Fig. 3)."""

from __future__ import annotations

from paper_figures.report.means import Means, Setting, grid, measure
from paper_figures.report.study_tables import Results, command
from paper_figures.report.verdict import Check, Claim, Part

LITTLE = 0.25  # of the gain up to 900 cells


def claim(results: Results) -> Claim:
    """Write claim 2.

    Raises:
        Missing: the study `paper` is not there yet.
    """
    error = measure(results, "final_state_error")
    truths, cells, steps = error.truths, error.cells, error.steps
    few, many = min(cells), max(cells)
    return Claim(
        title="Final-state error",
        paper="the more cells, the nearer to its goal does a policy of the tabular agent end on "
        "the true dynamics, with little to gain beyond 900 cells; a larger time step has the same "
        "effect.",
        parts=[
            Part(
                "less error with more cells",
                f"lower at {many} cells than at {few}, for a truth and dt",
                [
                    _lower(
                        error, (truth, many, dt), (truth, few, dt), f"{truth.upper()}, dt {dt:g}"
                    )
                    for truth in truths
                    for dt in steps
                ],
            ),
            Part(
                "little gain past 900 cells",
                f"from 900 to {many} cells it falls by at most {LITTLE:.0%} of what it falls by "
                f"from {few} to 900, for a truth and dt",
                [_saturates(error, truth, dt, few, many) for truth in truths for dt in steps],
            ),
            Part(
                "less error with larger dt",
                f"lower at dt {max(steps):g} than at {min(steps):g} s, for a truth and number of "
                "cells",
                [
                    _lower(
                        error,
                        (truth, size, max(steps)),
                        (truth, size, min(steps)),
                        f"{truth.upper()}, {size} cells",
                    )
                    for truth in truths
                    for size in cells
                ],
            ),
        ],
        numbers="Share of the state space's ranges, mean over demonstrations and seeds:\n\n"
        + grid(error)
        + "\nA dash: no demonstration is feasible for the tabular agent.\n",
        why="",
        command=command("paper"),
    )


def _lower(error: Means, one: Setting, other: Setting, setting: str) -> Check:
    """Whether one setting has less error than another."""
    return Check(setting, error[one].lower_than(error[other]), f"{error[other]} to {error[one]}")


def _saturates(error: Means, truth: str, dt: float, few: int, many: int) -> Check:
    """Whether little is gained past 900 cells."""
    first, middle, last = (error[truth, size, dt].value for size in (few, 900, many))
    before, after = first - middle, middle - last
    return Check(
        f"{truth.upper()}, dt {dt:g}",
        before > 0 and after <= LITTLE * before,
        f"{before:.3f} up to 900, {after:.3f} after",
    )
