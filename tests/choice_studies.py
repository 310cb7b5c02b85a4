"""Made-up tables of the studies of choices, for tests of their figures."""

import numpy as np
import pandas as pd
from arm_study import arm_tables, dimension_tables
from constraint_studies import control_tables, resolution_tables, soft_tables, transfer_tables
from dynamics_study import dynamics
from figure_study import cell_boxes, dimension_rows, path_rows, region_rows
from method_studies import (
    baseline_differences,
    chosen_task_tables,
    early_overlap_tables,
    sampled_tables,
)

from experiments.collate import success_rule

LIMITS = ("", "_low", "_high")


def groups(rows: list[dict], seed: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Tables `measures` and `rank_curve` of made-up numbers, for groups with these columns."""
    rng = np.random.default_rng(seed)
    measures, curve = [], []
    for row in rows:
        for name in ("reachable", "final_state_error", "violation_distance"):
            low, mean, high = np.sort(rng.random(3))
            measures.append({**row, "measure": name, "mean": mean, "low": low, "high": high})
        for count in (8, 9, 10):
            low, median, high = np.sort(rng.uniform(1, 50, 3))
            top_low, top, top_high = np.sort(rng.random(3))
            middle = {"median": median, "median_low": low, "median_high": high}
            top = dict(
                zip((f"share_top_5{end}" for end in LIMITS), (top, top_low, top_high), strict=True)
            )
            curve.append({**row, "demonstrations": count, **middle, **top})
    return pd.DataFrame(measures), pd.DataFrame(curve)


def settings_row(cells: int, dt: float, samples: int = 1, truth: str = "c1") -> dict:
    return {"truth": truth, "cells": cells, "actions": 9, "dt": dt, "samples": samples}


def choice_effect_tables() -> dict[str, pd.DataFrame]:
    """Two cases and the default; one of them on 420 cells in place of 400."""
    rows = [
        {"temperature": temperature, **settings_row(cells, dt)}
        for temperature, all_cells in ((1.0, (100, 400, 420)), (2.0, (100, 400)))
        for cells, dt in [*((cells, 0.25) for cells in all_cells), (400, 0.5)]
    ]
    names = [
        "temperature: 2"
        if row["temperature"] == 2
        else "default"
        if row["cells"] != 420
        else "more"
        for row in rows
    ]
    measures, curve = groups(rows, 0)
    cases = pd.DataFrame(rows).assign(case=names, choice=names, value="")
    return {"cases": cases, "measures": measures, "rank_curve": curve}


def start_point_tables() -> dict[str, pd.DataFrame]:
    """Two truths and time steps; one of three settings of the cells has several start points."""
    rows = [
        settings_row(cells, dt, samples, truth)
        for truth in ("c1", "c2")
        for cells, samples in ((100, 1), (100, 3), (400, 1))
        for dt in (0.1, 0.5)
    ]
    measures, curve = groups(rows, 1)
    return {"measures": measures, "rank_curve": curve}


def belief_tables() -> dict[str, pd.DataFrame]:
    """Two numbers of demonstrations; bins of few beliefs, and of what is no probability."""
    rows, rng = [], np.random.default_rng(2)
    for source in ("demonstrator", "model"):
        for belief in ("corrected", "each", "none", "printed", "selected"):
            for count in (1, 10):
                for number, lower, upper, beliefs in (
                    (2, 0.005, 0.01, 50),
                    (6, 0.1, 0.2, 20),
                    (8, 0.4, 0.6, 19),
                    (12, 1.0, np.inf, 30),
                ):
                    if (number == 12) != (belief == "printed"):
                        continue
                    low, observed, high = np.sort(rng.random(3))
                    predicted = np.inf if upper == np.inf else rng.uniform(lower, upper)
                    row = {"cells": 400, "source": source, "demonstrations": count}
                    row |= {"belief": belief, "bin": number, "lower": lower, "upper": upper}
                    row |= {"predicted": predicted, "observed": observed, "low": low, "high": high}
                    rows.append({**row, "weight": beliefs / 89, "count": beliefs})
    return {"reliability": pd.DataFrame(rows)}


def forecast_tables() -> dict[str, pd.DataFrame]:
    """Two kinds of forecasts; a bin of few."""
    rows, rng = [], np.random.default_rng(4)
    for kind in (0, 1):
        for lower, upper, count in ((0.0, 0.01, 500), (0.1, 0.2, 20), (0.4, 0.5, 19), (0.9, 1, 60)):
            low, crossed, high = np.sort(rng.random(3))
            row = {"map": kind, "lower": lower, "upper": upper, "count": count}
            row |= {"forecast": rng.uniform(lower, upper), "crossed": crossed}
            row |= {"low": low, "high": high, "log_score": -0.4, "brier": 0.12 - 0.01 * kind}
            rows.append({**row, "off_by": 0.09 - 0.08 * kind})
    return {"forecasts": pd.DataFrame(rows)}


# The case of a name, with what it changes of the default's settings.
SUCCESS_CASES = {
    "default": {},
    "start points in a cell: 1": {"samples": 1},
    "time step: 0.25 s": {"dt": 0.25},
    "time step: 1 s": {"dt": 1.0},
    "velocity cells: 7 in place of 5": {"cells": 4900},
    "temperature: 0.3": {"temperature": 0.3},
}
KINDS = {False: "random tasks", True: "tasks that cross the truth"}
FIRST_POINTS = {False: "4" * 32, True: "5" * 32}


def first_rows(crossing: bool) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Nine hypotheses, of which the truth holds the last and cuts 4, 5 and 7; three paths.

    The best are 8 and 5 for random tasks, and 2, off the truth, and 4 for those that cross it.
    """
    gain = np.array([0.0, 0.0, 0.25, -np.inf, 0.0, 1.5, -np.inf, -np.inf, 6.0])
    if crossing:
        gain[[2, 4, 5, 7, 8]] = [4.0, 2.5, 2.0, 0.0, -np.inf]
    ranking = pd.DataFrame(
        {
            **{"tasks.crossing": crossing, "point": FIRST_POINTS[crossing], "seed": 0},
            **settings_row(2500, 0.5, 3),
            "hypothesis": range(9),
            **cell_boxes(list(range(9)), 3),
            "feasible": gain > -np.inf,
            "gain": gain,
            "rank": pd.Series(-gain).rank(),
            "posterior": np.exp(gain) / (20 + np.exp(gain).sum()),
            "covered_by_truth": np.arange(9) == 8,
            "overlaps_truth": np.isin(np.arange(9), [4, 5, 7, 8]),
        }
    )
    paths = path_rows().query("truth == 'c1'")
    if crossing:
        paths = paths.assign(angle=paths["angle"] + 0.7, speed=-paths["speed"])
    third = paths[paths["demonstration"] == 0].assign(speed=1.7)
    paths = pd.concat([paths, third.assign(demonstration=2)])
    # Demonstrations have the numbers of their trials.
    paths = paths.assign(demonstration=paths["demonstration"].map({0: 3, 1: 4, 2: 7}))
    pairs = [(3, 3), (3, 6), (4, 6), (4, 7 + crossing), (7, 3)]
    violations = pd.DataFrame(pairs, columns=["trial", "hypothesis"]).assign(truth="c1")
    boxes = pd.DataFrame(cell_boxes(violations["hypothesis"].tolist(), 3))
    violations = violations.assign(source="demonstration", **boxes)
    return ranking, *(table.assign(**{"tasks.crossing": crossing}) for table in (paths, violations))


def success_tables() -> dict[str, pd.DataFrame]:
    """Two kinds of tasks in each of some cases, and settings that no case names."""
    rng = np.random.default_rng(3)
    firsts = zip(*(first_rows(crossing) for crossing in KINDS), strict=True)
    names = ("first_ranking", "first_paths", "first_violations")
    usual = {"temperature": 1.0, **settings_row(2500, 0.5, 3)}
    groups, cases = [], []
    for case, change in {**SUCCESS_CASES, "": {"dt": 2.0}}.items():
        for crossing in KINDS:
            groups.append({"tasks.crossing": crossing, **usual, **change})
            if case:
                choice, _, value = case.partition(": ")
                cases.append({**groups[-1], "case": case, "choice": choice, "value": value})
    curve, measures = [], []
    for group in groups:
        measures += [
            {**group, "measure": name, "mean": rng.random()}
            for name in ("reachable", "truth_probability")
        ]
        for count in range(1, 21):
            row = {**group, "demonstrations": count, "seeds": 3}
            for name in ("overlap", "inside"):
                for top in (1, 2):
                    low, middle, high = np.sort(rng.random(3)) * (1 - 0.5 / count)
                    ends = (f"top_{top}_{name}{end}" for end in LIMITS)
                    row |= dict(zip(ends, (middle, low, high), strict=True))
            curve.append(row)
    return {
        **{name: pd.concat(parts) for name, parts in zip(names, firsts, strict=True)},
        "example_regions": region_rows().query("truth == 'c1'"),
        "example_dimensions": dimension_rows().query("truth == 'c1'"),
        "cases": pd.DataFrame(cases),
        "measures": pd.DataFrame(measures),
        "rank_curve": pd.DataFrame(curve),
    }


def _shared(rows: list[dict], names: tuple[str, ...]) -> list[dict]:
    """The rows after 9 and 20 demonstrations, with made-up shares and median rank."""
    rng, curve = np.random.default_rng(3), []
    for row in rows:
        for count in (9, 20):
            low, median, high = np.sort(rng.uniform(1, 50, 3))
            values = {"median": median, "median_low": low, "median_high": high}
            for name in names:
                low, middle, high = np.sort(rng.random(3))
                values |= {name: middle, f"{name}_low": low, f"{name}_high": high}
            curve.append({**row, "demonstrations": count, **values})
    return curve


def _measured(rows: list[dict], measure: str) -> pd.DataFrame:
    """One measure for each row, with its interval."""
    limits = {"measure": measure, "mean": 0.2, "low": 0.1, "high": 0.3}
    return pd.DataFrame([{**row, **limits} for row in rows])


def reading_tables() -> dict[str, pd.DataFrame]:
    """Two truths under four readings of the paper, of two speeds."""
    names = ["2 rad/s: free", "2 rad/s: clipped", "6 rad/s: free, no winding", "6 rad/s: clipped"]
    rows = [{"reading": name, "truth": truth} for truth in ("c1", "c2") for name in names]
    parts = [row["reading"].split(": ") for row in rows]
    return {
        "cases": pd.DataFrame(rows).assign(
            case=[row["reading"] for row in rows],
            choice=[part[0] for part in parts],
            value=[part[1] for part in parts],
        ),
        "summary": pd.DataFrame(
            [
                {**row, "seed": seed, "pairs": 40, "kept": 20 + 2 * place, "demonstrations": 20}
                for place, row in enumerate(rows)
                for seed in (0, 1)
            ]
        ),
        "measures": _measured(rows, "truth_probability"),
        "rank_curve": pd.DataFrame(_shared(rows, ("share_top_5",))),
    }


def rule_breaking_tables() -> dict[str, pd.DataFrame]:
    """Two truths and rates, without and with an estimate."""
    rows = [
        {"demonstrations.rule_breaking": rate, "inference.rule_breaking": way, "truth": truth}
        for truth in ("c1", "c2")
        for rate in (0.0, 0.1)
        for way in ("0.0", "estimate")
    ]
    values = ["estimated" if row["inference.rule_breaking"] == "estimate" else "0" for row in rows]
    cases = [f"eps: {value}" for value in values]
    return {
        "cases": pd.DataFrame(rows).assign(case=cases, choice="eps", value=values),
        "rank_curve": pd.DataFrame(_shared(rows, ("share_top_5",))),
    }


def wrong_model_tables() -> dict[str, pd.DataFrame]:
    """Two truths, with the nominal model and with another length."""
    rows = [
        {"reality.system.length": length, "truth": truth}
        for length in ("", "1.2")
        for truth in ("c1", "c2")
    ]
    cases = ["length: +20 %" if row["reality.system.length"] else "default" for row in rows]
    return {
        "cases": pd.DataFrame(rows).assign(case=cases, choice="length", value=""),
        "measures": _measured(rows, "rare"),
        "rank_curve": pd.DataFrame(_shared(rows, ("share_top_5", "claim", "top_1_inside"))),
    }


def area_cover_tables() -> dict[str, pd.DataFrame]:
    """Four squares, one method better than the next."""
    methods = ["single", "neighbourhood", "greedy", "climb", "likeliest", "shapes"]
    methods, sizes = [*methods, "ideal", "shown", "chosen", "ideal_chosen"], [1, 2, 4]
    curve = [
        {"demonstrations": size, "method": name, "iou": iou, "iou_low": iou - 0.05}
        | {"iou_high": iou + 0.05}
        for k, name in enumerate(methods)
        for size in sizes
        for iou in [0.1 + 0.1 * k + 0.05 * size]
    ]
    cell = pd.DataFrame({"seed": 0, "hypothesis": range(4)})
    corner = {"lower_x": [0.0, 1, 0, 1], "lower_y": [0.0, 0, 1, 1]}
    boxes = cell.assign(**corner, upper_x=[1.0, 2, 1, 2], upper_y=[1.0, 1, 2, 2])
    truth = {"truth": "t", "region": 0, "lower_x": 0.2, "lower_y": 0.2}
    of_x = {"truth": "t", "unit": "m", "lower": 0.0, "upper": 2.0, "periodic": False}
    return {
        "area_curve": pd.DataFrame(curve),
        "area_map": cell.assign(
            in_truth=[0.6, 0, 0, 0], climb_4=[0.2, 0.2, 0.0, 0.0], shapes_4=[0.8, 0.2, 0.0, 0.0]
        ),
        "hypotheses": boxes,
        "regions": pd.DataFrame([truth | {"upper_x": 0.9, "upper_y": 0.9}]),
        "dimensions": pd.DataFrame([{"name": name, **of_x} for name in "xy"]),
    }


def choice_tables() -> dict[str, dict[str, pd.DataFrame]]:
    """The tables that each figure of a choice is drawn from, by its module."""
    return {
        "choice_effects": choice_effect_tables(),
        "readings": reading_tables(),
        "rule_breaking": rule_breaking_tables(),
        "wrong_model": wrong_model_tables(),
        "start_points": start_point_tables(),
        "calibration_diagram": belief_tables(),
        "forecast_diagram": forecast_tables(),
        "success": success_tables(),
        "success_cases": success_tables(),
        "soft_weights": soft_tables(),
        "transfer": transfer_tables(),
        "control_limits": control_tables(),
        "cell_errors": resolution_tables(),
        "sampled_models": sampled_tables(),
        "arms": arm_tables(),
        "dimensions": dimension_tables(),
        "dynamics": success_rule.success_tables(dynamics()),
        "area_cover": area_cover_tables(),
        "baselines": {"baseline_differences": baseline_differences()},
        "chosen_tasks": chosen_task_tables(),
        "early_overlap": {"early_overlap": early_overlap_tables()["early_overlap"]},
    }
