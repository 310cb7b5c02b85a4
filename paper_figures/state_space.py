"""The state space with its hypotheses and the true constraints (the paper's Fig. 2)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from paper_figures.plane import Plane, centre
from paper_figures.style import COLUMN, EDGE, RC, TRUTHS, new_figure

TABLES = {
    "example_ranking": ("truth", "hypothesis"),
    "example_regions": ("truth", "region"),
    "example_dimensions": ("truth", "name", "unit", "lower", "upper", "periodic"),
}


def draw(
    example_ranking: pd.DataFrame, example_regions: pd.DataFrame, example_dimensions: pd.DataFrame
) -> Figure:
    """Draw them.

    Args:
        example_ranking: the hypotheses: lower_<d> and upper_<d> of each dimension d.
        example_regions: the boxes of each truth, likewise.
        example_dimensions: a row a dimension of the state.
    """
    hypotheses = _of_one_truth(example_ranking)
    plane = Plane.of(hypotheses, _of_one_truth(example_dimensions))
    figure, axes = new_figure(COLUMN, 2.7)
    with plt.rc_context(RC):
        plane.cells(axes, hypotheses, facecolor="none", linewidth=0.5)
        entries = [Patch(facecolor="white", edgecolor=EDGE, label="hypothesis")]
        for place, (truth, boxes) in enumerate(example_regions.groupby("truth", sort=True)):
            colour = TRUTHS[place % len(TRUTHS)]
            for box in plane.regions(boxes):
                box.set(facecolor=colour, edgecolor="black", linewidth=0.6, zorder=3)
                axes.add_patch(box)
                axes.text(*centre(box), truth.upper(), ha="center", va="center", clip_on=True)
            label = f"truth {truth.upper()}"
            entries.append(Patch(facecolor=colour, edgecolor="black", linewidth=0.6, label=label))
        plane.dress(axes)
        figure.legend(handles=entries, loc="outside lower center", ncols=min(3, len(entries)))
    return figure


def facts(
    example_ranking: pd.DataFrame, example_regions: pd.DataFrame, example_dimensions: pd.DataFrame
) -> str:
    """What the caption says."""
    state = _of_one_truth(example_dimensions)
    lines = [
        "The state space, the hypotheses and the true constraints.",
        *(
            f"{row.name.replace('_', ' ')}: {row.lower:.6g} to {row.upper:.6g} {row.unit}"
            f"{', wraps' * bool(row.periodic)}."
            for row in state.itertuples()
        ),
        f"Hypotheses: {len(_of_one_truth(example_ranking))}.",
    ]
    for _, box in example_regions.iterrows():
        sides = [
            f"{row.name.replace('_', ' ')} {box[f'lower_{row.name}']:.6g} to "
            f"{box[f'upper_{row.name}']:.6g} {row.unit}"
            for row in state.itertuples()
        ]
        lines.append(f"{box['truth'].upper()}: {', '.join(sides)}.")
    lines.append("Uncertainty: nothing here is estimated.")
    return "\n".join(lines)


def _of_one_truth(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the first truth: hypotheses and state space are the same for all."""
    return table[table["truth"] == table["truth"].min()]
