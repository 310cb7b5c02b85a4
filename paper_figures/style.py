"""One look for every figure: columns of 3.4 in, 8 pt text, colours that differ in lightness."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from experiments.tracking.files import replace_file

matplotlib.rcdefaults()  # a user's own matplotlibrc, such as text.usetex, is for other figures

COLUMN = 3.4  # width of a column [in]
DPI = 200  # of PNGs
PAGE = 7.0  # of two columns and what is between them [in]

# The paper's colours by number of cells (pink, green, yellow, blue), their hues from the palette of
# Okabe and Ito, which is safe for the colour-blind; its marks beside them, legible in grey.
CELL_MARKS = {100: "o", 400: "x", 900: "s", 1600: "^"}
CELL_COLOURS = {100: "#cc79a7", 400: "#009e73", 900: "#d9a400", 1600: "#0072b2"}
# Another four, from light to dark, for numbers of demonstrations.
STEP_MARKS = ("o", "s", "^", "D")
STEP_COLOURS = ("#56b4e9", "#009e73", "#d55e00", "#000000")
OTHER_MARKS = ("D", "v", "P", "*")
OTHER_COLOURS = ("#000000", "#d55e00", "#56b4e9", "#7f7f7f")
TRUTH = "#d55e00"
TRUTHS = (TRUTH, "#f3b28a")  # shades of one colour, for several truths in one figure
DEMONSTRATION, SAMPLED = "#0072b2", "#cc79a7"
TASKS = {"random tasks": ("#d55e00", "o"), "tasks that cross the truth": ("#0072b2", "^")}
SIX_COLOURS = ("#7f7f7f", "#56b4e9", "#cc79a7", "#009e73", "#d55e00", "#000000")
SIX_MARKS = ("s", "o", "D", "v", "^", "*")
START, GOAL = "#56b4e9", "#009e73"
GAIN, CHANCE = "YlGnBu", "PuRd"  # one colour each, dark for much: a hypothesis's gain and its Phi
PATH = "#444444"  # of demonstrations among many
EDGE = "#b0b0b0"  # between hypotheses
VIOLATED = "#e8e8e8"  # hypotheses that some demonstration violates
UNAVOIDABLE = "#1a1a1a"  # those whose gain is infinite, see `mlci.inference`
GUIDE = "#888888"  # lines that help the eye

RC = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.columnspacing": 1.2,
    "legend.handlelength": 1.6,
    "legend.handletextpad": 0.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "hatch.linewidth": 0.5,
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


def whiskers(middle: ArrayLike, low: ArrayLike, high: ArrayLike) -> np.ndarray:
    """(2, N) lengths of the lines below and above N marks, of intervals from low to high.

    An interval of other samples, or rounded, need not hold its mark: a line on that side has no
    length.
    """
    marks = np.asarray(middle, dtype=float)
    return np.maximum([marks - np.asarray(low), np.asarray(high) - marks], 0.0)


def save(figure: Figure, path: Path, source: str = "") -> Path:
    """Write a figure as PNG and PDF beside each other; the same bytes for the same figure.

    Args:
        figure: what was drawn; it is closed.
        path: of the files, without their suffix.
        source: where the data come from, for the files' metadata.

    Returns:
        The PNG.
    """
    # No time and no version of a program: both change bytes that show the same.
    metadata = {
        ".png": {"Title": path.name, "Source": source, "Software": None},
        ".pdf": {"Title": path.name, "Subject": source, "CreationDate": None},
    }
    with plt.rc_context(RC):
        for suffix, entries in metadata.items():
            content = io.BytesIO()
            figure.savefig(content, format=suffix[1:], dpi=DPI, metadata=entries)
            figure.set_layout_engine("none")  # it is solved once, for the PNG
            replace_file(path.with_name(path.name + suffix), content.getvalue())
    plt.close(figure)
    return path.with_name(f"{path.name}.png")
