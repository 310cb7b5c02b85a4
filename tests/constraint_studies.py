"""Tables of studies that were never run: soft constraints, transfer, controls and cells."""

import numpy as np
import pandas as pd
from figure_study import dimension_rows, region_rows


def soft_tables() -> dict[str, pd.DataFrame]:
    """Two truths: of ten estimates a weight, one misses it, and half are a wall where it is 16."""
    rows = [
        {
            "truth": truth,
            "weight": weight,
            "demonstrations": size,
            "set": k,
            "estimate": np.inf if weight == 16 and k % 2 else weight + 0.1 * k,
            "lower": weight + 1 if k == 9 else 0.5 * weight,
            "upper": np.inf if weight == 16 else weight + 2,
            "verdict": {0: "perhaps no constraint", 4: "soft", 16: "as a wall"}[weight],
        }
        for truth in ("c1", "c2")
        for weight in (0, 4, 16)
        for size in (10, 30)
        for k in range(10)
    ]
    return {"soft": pd.DataFrame(rows)}


def control_tables() -> dict[str, pd.DataFrame]:
    """A limit that is first from three demonstrations on, one that never is, and none, of which
    half of the sets imagine one with the model's chances."""
    rows = [
        {
            "truth": truth,
            "demonstrations": size,
            "calibrated": calibrated,
            **{
                f"{name}{end}": np.clip(value + shift, 0, 1)
                for name, value in {
                    "posterior": {"none": np.nan}.get(truth, size / 20),
                    "true_first": {"none": np.nan, "weak": 1 - 0.3 / size}.get(truth, 0.5),
                    "wrong": 0.5 / size if truth == "none" and not calibrated else 0.1 / size,
                    "wrong_sure": 0.0,
                }.items()
                for end, shift in (("", 0.0), ("_low", -0.05), ("_high", 0.05))
            },
            "seeds": 2,
        }
        for truth in ("none", "weak", "weaker")
        for size in (1, 2, 3, 5, 10, 20)
        for calibrated in (0, 1)
    ]
    cases = pd.DataFrame({"truth": ["none", "weak", "weaker"]})
    cases["case"] = ["no limit", "at most 1", "at least -0.5"]
    columns = ("of_nothing", "of_region", "of_controls", "of_both", "true_first")
    joint = [
        {"truth": truth, "demonstrations": size, "seeds": 2}
        | {
            f"{name}{end}": 0.1 * k + 0.02 * size + shift
            for k, name in enumerate(columns)
            for end, shift in (("", 0.0), ("_low", -0.01), ("_high", 0.01))
        }
        for truth in ("none", "weak")
        for size in (1, 2, 10)
    ]
    tables = {"control_curve": pd.DataFrame(rows), "cases": cases}
    return tables | {"joint_curve": pd.DataFrame(joint)}


def resolution_tables() -> dict[str, pd.DataFrame]:
    """Errors that fall with the number of cells: to the power of 0.5, and of 1 where they vary."""
    kinds = {"centre": 0.5, "averaged": 0.5, "multilinear": 0.5, "round goals": 0.5, "varying": 1.0}
    kinds["of each task"] = 1.0
    rows = [
        {
            "seed": seed,
            "kind": kind,
            "count": count,
            "task": task,
            "possible": kind != "centre" or count > 100,
            "error": (1 + task) * (100 / count) ** power / 10,
            "noise": 0.002,
            "trusted": task < 2,
            "error_of_cells": (100 / count) ** power / 10,
        }
        for seed in (0, 1)
        for kind, power in kinds.items()
        for count in (100, 400, 1600)
        for task in range(3)
    ]
    return {"resolution": pd.DataFrame(rows)}


def transfer_tables() -> dict[str, pd.DataFrame]:
    """The tube lets in half of the trials with weak controls, and refuses half with strong ones.

    Two margins: with the derived one, which the setting leaves open, a neighbour is inferred, whose
    own safe set lets in half with strong controls.
    """
    rows = [
        {
            "safety.margin": margin,
            "truth": "c1",
            "seed": seed,
            "strength": strength,
            "method": method,
            "region": 4 if np.isnan(margin) else 5,
            "right": not np.isnan(margin),
            "safe": 100,
            "refused": {"tube": 50 if strength > 1 else 10, "no filter": 0}.get(method, 10),
            "doomed": 20,
            "admitted": {"tube": 10 if strength < 1 else 0, "no filter": 20}.get(method, 0),
            "trials": np.nan if method == "never entered" else 200,
            "entered": {
                "tube": 100 if strength < 1 else 0,
                "no filter": 150,
                "own safe set": 100 if strength > 1 and np.isnan(margin) else 0,
                "never entered": np.nan,
            }[method],
        }
        for margin in (np.nan, 0.1)
        for strength in (0.5, 1.0, 2.0)
        for seed in (0, 1)
        for method in ("own safe set", "tube", "no filter", "never entered")
    ]
    angle, speed = np.meshgrid(np.linspace(0, 2 * np.pi, 9), np.linspace(-2, 2, 7), indexing="ij")
    values = [
        pd.DataFrame(
            {
                "truth": "c1",
                "region": region,
                "strength": strength,
                "state_1": angle.ravel(),
                "state_2": speed.ravel(),
                "value": (np.abs(angle - np.pi - 5 + region) - np.abs(speed) / strength).ravel(),
            }
        )
        for region in (4, 5)
        for strength in (0.5, 1.0, 2.0)
    ]
    of_truth = {"regions": region_rows(), "dimensions": dimension_rows()}
    one = {name: table[table["truth"] == "c1"] for name, table in of_truth.items()}
    cases = pd.DataFrame({"safety.margin": [np.nan, 0.1], "truth": "c1", "choice": "margin"})
    cases["value"] = ["derived", "0.1"]
    cases["case"] = cases["choice"] + ": " + cases["value"]
    tables = {"transfer": pd.DataFrame(rows), "transfer_values": pd.concat(values)}
    return {**tables, "cases": cases, **one}
