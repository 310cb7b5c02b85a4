"""What things cost: processor time, memory and files, and how they grow with the states."""

from __future__ import annotations

import pandas as pd

from paper_figures.report.markdown import table
from paper_figures.report.study_tables import Results

STUDY = "benchmark"


def section(results: Results) -> str:
    """Times of the algorithms, of one task from a thousand states to a million, and of points.

    Raises:
        Missing: the benchmark has not run yet.
    """
    times = results.table(STUDY, "benchmark", ("what", "median_s", "floor_s", "ratio", "paper"))
    sizes = results.table(
        STUDY, "scale", ("system", "states", "actions", "discretise_s", "infer_s", "peak_mb")
    )
    machine = times.iloc[0]
    return (
        f"Processor time of one thread on {machine['cpu']}, Python {machine['python']}, numpy "
        f"{machine['numpy']}, scipy {machine['scipy']}; commit `{machine['commit']}`, "
        f"{machine['date']}. A floor is a measured rate of that machine times the bytes or calls "
        "that an algorithm cannot do without.\n\n"
        + table(
            ["what", "the paper says", "median", "floor", "times the floor"],
            [
                [
                    row["what"],
                    "" if pd.isna(row["paper"]) else row["paper"],
                    _seconds(row["median_s"]),
                    _seconds(row["floor_s"]),
                    "-" if pd.isna(row["ratio"]) else f"{row['ratio']:.3g}",
                ]
                for row in times.to_dict("records")
            ],
            words=2,
        )
        + "\nOne task in four dimensions, by the number of states:\n\n"
        + table(
            ["system", "states", "actions", "discretise", "infer and rank", "most memory"],
            [
                [
                    row["system"],
                    row["states"],
                    row["actions"],
                    _seconds(row["discretise_s"]),
                    _seconds(row["infer_s"]),
                    f"{row['peak_mb']:.0f} MB",
                ]
                for row in sizes.to_dict("records")
            ],
        )
        + "\nWhat a point of a sweep costs:\n\n"
        + _points(results)
    )


def _points(results: Results) -> str:
    """Times, memory and files of points."""
    times = results.table(STUDY, "benchmark", ("name", "what", "median_s")).set_index("name")
    costs = results.table(STUDY, "costs", ("name", "what", "value", "unit"))
    rows = [
        [times.loc[name, "what"], _seconds(times.loc[name, "median_s"])]
        for name in ("plan_point", "collate_point", "largest_paper_point")
        if name in times.index
    ]
    rows += [[row.what, f"{row.value:.3g} {row.unit}"] for row in costs.itertuples()]
    return table([f"on {times.iloc[0]['cpu']}, one core", "measured"], rows)


def _seconds(value: float) -> str:
    """A time in the unit that suits it."""
    if pd.isna(value):
        return "-"
    if value < 1e-3:
        return f"{1e6 * value:.3g} µs"
    return f"{1e3 * value:.3g} ms" if value < 1 else f"{value:.3g} s"
