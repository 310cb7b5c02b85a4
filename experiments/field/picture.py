"""The leaderboard as a picture: a square for each world and method."""

from __future__ import annotations

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import pandas as pd

from experiments.field.scores import SCORES
from mlci.plot import png

_WIDTH, _ROW, _HEAD = 7.4, 0.33, 1.9  # in
_DARK = 0.55  # above which numbers are white


def picture(board: pd.DataFrame, told: set[str], name: str = "iou") -> bytes:
    """A PNG of the means of a score between 0 and 1, with the half width of each interval.

    Args:
        board: rows of `leaderboard`.
        told: methods that are told how many hypotheses are true; they are marked.
        name: the score.
    """
    table = board[board["score"] == name]
    worlds, methods = table["world"].unique().tolist(), table["method"].unique().tolist()
    means = table.pivot(index="world", columns="method", values="mean").loc[worlds, methods]
    ends = table.pivot(index="world", columns="method", values="upper").loc[worlds, methods]
    middle, upper = means.to_numpy(dtype=float), ends.to_numpy(dtype=float)
    with plt.rc_context({"font.size": 7}):
        size = _WIDTH, _HEAD + _ROW * len(worlds)
        figure, axes = plt.subplots(figsize=size, layout="constrained")
        image = axes.imshow(middle, cmap="YlGnBu", vmin=0, vmax=1, aspect="auto")
        for i in range(len(worlds)):
            for j in range(len(methods)):
                mean, end = middle[i, j], upper[i, j]
                if mean != mean:
                    continue
                half = f"\n± {end - mean:.2f}" if end == end else ""
                colour = "white" if mean > _DARK else "black"
                axes.text(j, i, f"{mean:.2f}{half}", ha="center", va="center", color=colour, size=6)
        labels = [f"{method} †" if method in told else method for method in methods]
        axes.set_xticks(range(len(methods)), labels, rotation=40, ha="left", rotation_mode="anchor")
        axes.xaxis.tick_top()
        axes.set_yticks(range(len(worlds)), worlds)
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
        axes.set_xlabel("† is told how many hypotheses are true")
        figure.colorbar(image, label=f"{SCORES[name][0]}, mean over seeds", pad=0.01)
        content = png(axes)
        plt.close(figure)
    return content
