"""One look for every figure: columns of 3.4 in, 8 pt text, colours that differ in lightness."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

COLUMN = 3.4  # width of a column [in]

# The paper's colours by number of cells (pink, green, yellow, blue), their hues from the palette of
# Okabe and Ito, which is safe for the colour-blind; its marks beside them, legible in grey.
CELL_MARKS = {100: "o", 400: "x", 900: "s", 1600: "^"}
CELL_COLOURS = {100: "#cc79a7", 400: "#009e73", 900: "#d9a400", 1600: "#0072b2"}
OTHER_MARKS = ("D", "v", "P", "*")
OTHER_COLOURS = ("#000000", "#d55e00", "#56b4e9", "#7f7f7f")
TRUTH = "#d62828"

RC = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.1,
    "lines.markersize": 4,
    "svg.hashsalt": "mlci",
}


def new_figure(width: float, height: float, **options: Any) -> tuple[Figure, Any]:
    """`plt.subplots` in inches and in this style, with a layout that keeps labels apart."""
    with plt.rc_context(RC):
        return plt.subplots(figsize=(width, height), layout="constrained", **options)


def mark(cells: int, rank: int) -> dict[str, Any]:
    """Colour and mark of a curve for a number of cells, the `rank`-th curve of its axes."""
    spare = rank % len(OTHER_MARKS)
    return {
        "color": CELL_COLOURS.get(cells, OTHER_COLOURS[spare]),
        "marker": CELL_MARKS.get(cells, OTHER_MARKS[spare]),
    }


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG and PDF beside each other; the same bytes for the same figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(RC):
        figure.savefig(path.with_suffix(".png"), dpi=200, metadata={"Software": None})
        figure.savefig(path.with_suffix(".pdf"), metadata={"CreationDate": None})
    plt.close(figure)
    return path.with_suffix(".png")
