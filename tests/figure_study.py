"""Tables of a study that was never run, small enough to know every number in them."""

import numpy as np
import pandas as pd

SPEEDS = (-2.0, 2.0)
# Truths C1 and C2: C2 leaves the circle on one side and comes back on the other.
REGIONS = {"c1": ((np.pi, 0.0), (2 * np.pi, 2.0)), "c2": ((5.5, 0.0), (7.0, 1.0))}
POINTS = {"c1": "1" * 32, "c2": "2" * 32}
EXAMPLE = {"cells": 400, "actions": 9, "dt": 0.25, "samples": 1, "seed": 0}


def for_truths(table: pd.DataFrame) -> pd.DataFrame:
    """The same rows for each truth."""
    return pd.concat([table.assign(truth=truth) for truth in REGIONS], ignore_index=True)


def box_columns(lower: np.ndarray, upper: np.ndarray, prefix: str = "") -> dict[str, np.ndarray]:
    return {
        f"{prefix}{side}_{name}": corners[:, column]
        for side, corners in (("lower", lower), ("upper", upper))
        for column, name in enumerate(("angle", "speed"))
    }


def cell_boxes(numbers: list[int], side: int, prefix: str = "") -> dict[str, np.ndarray]:
    """Corners of cells of a grid of side x side."""
    place = np.stack(np.divmod(np.array(numbers), side), axis=1)
    widths = np.array([2 * np.pi, 4.0]) / side
    lower = np.array([0.0, -2.0]) + place * widths
    return box_columns(lower, lower + widths, prefix)


def dimension_rows() -> pd.DataFrame:
    table = {"name": ["angle", "speed"], "unit": ["rad", "rad/s"], "periodic": [True, False]}
    bounds = {"lower": [0.0, SPEEDS[0]], "upper": [2 * np.pi, SPEEDS[1]]}
    return for_truths(pd.DataFrame({**table, **bounds}))


def region_rows() -> pd.DataFrame:
    corners = np.array(list(REGIONS.values()))
    boxes = box_columns(corners[:, 0], corners[:, 1])
    return pd.DataFrame({"truth": list(REGIONS), "region": 0, **boxes})


def hypothesis_rows() -> pd.DataFrame:
    """Two by two: one violated, one of no gain, and the truth ranked first."""
    table = pd.DataFrame(
        {
            **EXAMPLE,
            "hypothesis": range(4),
            **cell_boxes([0, 1, 2, 3], 2),
            "feasible": [True, False, True, True],
            "gain": [0.0, -np.inf, 1.5, 6.0],
            "rank": [3.0, 4.0, 2.0, 1.0],
            "posterior": [0.0, 0.0, 0.1, 0.8],
            "covered_by_truth": [False, False, False, True],
            "trial": 1,
            "unconstrained": [0.25, 1.0, 0.5, 0.75],
            "constrained": [0.25, 1.0, 0.5, 0.0],
        }
    )
    table = for_truths(table)
    return table.assign(point=table["truth"].map(POINTS))


def path_rows() -> pd.DataFrame:
    """Two paths, of which the second passes a whole turn."""
    table = pd.DataFrame(
        {
            "seed": 0,
            "demonstration": [0] * 3 + [1] * 4,
            "time": [0.0, 0.1, 0.2, 0.0, 0.1, 0.2, 0.3],
            "angle": [0.5, 1.0, 1.5, 5.5, 6.1, 6.6, 7.0],
            "speed": [0.1, 0.2, 0.1, 1.0, 1.1, 1.1, 1.0],
        }
    )
    return for_truths(table)


def cell_rows() -> pd.DataFrame:
    """A trajectory in a grid of 4 x 4 that stays in a cell once and then passes a whole turn."""
    cells = [13, 13, 14, 2]
    steps = {"trial": 1, "step": range(4), "cell": cells}
    return for_truths(pd.DataFrame({**EXAMPLE, **steps, **cell_boxes(cells, 4)}))


def move_rows() -> pd.DataFrame:
    cells, successors = [2, 2, 13, 13, 13, 14], [6, 7, 13, 14, 14, 2]
    boxes = {**cell_boxes(cells, 4), **cell_boxes(successors, 4, "successor_")}
    moves = {"cell": cells, "action": [0, 1, 0, 1, 2, 0], "successor": successors}
    return for_truths(pd.DataFrame({**EXAMPLE, **moves, **boxes}))


def compared_cell_rows() -> pd.DataFrame:
    """One trajectory a grid of 100, 900 and 1600 cells, from here to there and back."""
    parts = []
    for side in (10, 30, 40):
        cells = [side + 1, 2 * side + 2, side + 1, 3 * side + 3]
        steps = {"trial": 1, "step": range(4), "cell": cells, **cell_boxes(cells, side)}
        parts.append(pd.DataFrame({**EXAMPLE, "cells": side**2, "dt": 0.5, **steps}))
    return for_truths(pd.concat(parts)).assign(point="3" * 32)


def compared_violation_rows() -> pd.DataFrame:
    """The demonstration violates hypotheses 0 and 1, trajectories 1 and, the finest, 2."""
    parts = []
    for cells in (100, 900, 1600):
        sampled = [1, 2] if cells == 1600 else [1]
        sources = ["demonstration"] * 2 + ["sampled"] * len(sampled)
        rows = {"trial": 1, "source": sources, "hypothesis": [0, 1, *sampled]}
        boxes = cell_boxes([0, 1, *sampled], 2)
        parts.append(pd.DataFrame({**EXAMPLE, "cells": cells, "dt": 0.5, **rows, **boxes}))
    return for_truths(pd.concat(parts))


def curve_rows() -> pd.DataFrame:
    rows = [
        {"truth": t, "cells": c, "actions": a, "dt": dt, "samples": 1, "demonstrations": n}
        for t in REGIONS
        for c in (100, 400, 900, 1600)
        for a in (5, 9)
        for dt in (0.25, 0.5)
        for n in range(1, 7)
    ]
    table = pd.DataFrame(rows)
    middle = 30 / table["demonstrations"] + table["cells"] / 100 + table["actions"]
    share = 1 - 1 / table["demonstrations"] + table["dt"] / 10
    return table.assign(
        **{"q25": middle - 1, "median": middle, "q75": middle + 2, "seeds": 5},
        **{"median_low": middle - 0.5, "median_high": middle + 0.25},
        **{"share_top_5": share, "share_top_5_low": share - 0.05, "share_top_5_high": share + 0.02},
    )


def measure_rows() -> pd.DataFrame:
    """Every measure; at 400 cells and dt 0.1 none, at 100 cells and dt 0.1 of few goals."""
    rows = []
    for place, (truth, cells, actions, dt) in enumerate(
        (t, c, a, dt)
        for t in REGIONS
        for c in (100, 400, 900, 1600)
        for a in (5, 9)
        for dt in (0.1, 0.2, 0.25, 0.5, 1.0)
    ):
        setting = {"truth": truth, "cells": cells, "actions": actions, "dt": dt, "samples": 1}
        none, few = (cells, dt) == (400, 0.1), (cells, dt) == (100, 0.1)
        reached = 0.0 if none else 0.25 if few else 1.0
        values = {
            "reachable": reached,
            "final_state_error": 10 / cells + 0.001 * place,
            "violation_distance": 8 + 100 / cells + dt,
            "violation_floor": 6 + 100 / cells - dt,
            "violation_distance_pooled": 2 + 100 / cells,
        }
        for measure, mean in values.items():
            there = mean if measure == "reachable" or not none else np.nan
            limits = {"mean": there, "low": 0.9 * there, "high": 1.2 * there}
            rows.append({**setting, "measure": measure, **limits, "seeds": 5, "demonstrations": 65})
    return pd.DataFrame(rows)


def scale_rows() -> pd.DataFrame:
    """Three sizes of one system, whose cost doubles with the states, and one of another."""
    states = np.array([1000, 2000, 4000, 4000])
    return pd.DataFrame(
        {
            "system": ["telescope"] * 3 + ["torus"],
            "states": states,
            "actions": 15,
            "hypotheses": 100,
            "steps": 20,
            "dt": 0.25,
            "largest_active_share": [0.1, 0.2, 0.25, 0.75],
            "discretise_s": states / 1e4,
            "infer_s": [0.01, 0.02, 0.04, 0.3],
            "total_s": states / 1e4 + [0.01, 0.02, 0.04, 0.3],
            "peak_mb": [100, 110, 130, 200],
            **dict.fromkeys(("cpu", "python", "numpy", "scipy", "commit", "date"), "x"),
        }
    )


def growth_rows() -> pd.DataFrame:
    """Inference that grows with the square of the hypotheses, and with the root of the actions."""
    value = np.array([10, 100, 1000, 3, 30, 300])
    return pd.DataFrame(
        {
            "factor": ["hypotheses"] * 3 + ["actions"] * 3,
            "value": value,
            "discretise_s": value / 1e3,
            "infer_s": np.append(value[:3] ** 2.0, value[3:] ** 0.5) / 1e3,
        }
    )


def study_tables() -> dict[str, pd.DataFrame]:
    """All tables that figures of the paper are drawn from."""
    return {
        "example_dimensions": dimension_rows(),
        "example_regions": region_rows(),
        "example_ranking": hypothesis_rows(),
        "example_paths": path_rows(),
        "example_cells": cell_rows(),
        "example_moves": move_rows(),
        "compared_cells": compared_cell_rows(),
        "compared_violations": compared_violation_rows(),
        "compared_paths": path_rows()[lambda rows: rows["demonstration"] == 1],
        "measures": measure_rows(),
        "rank_curve": curve_rows(),
    }
