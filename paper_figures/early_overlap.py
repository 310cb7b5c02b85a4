"""What the answer after five demonstrations meets, with chosen tasks and with random ones."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.rows import Unsuited
from paper_figures.style import DEMONSTRATION, PAGE, RC, TRUTH, new_figure

ANSWERS = {
    "best_overlaps": "the best overlaps the truth",
    "two_overlap": "both of the best two do",
    "likeliest_overlaps": "the most probable area does",
    "likeliest_precision": "share of its regions that do",
    "likeliest_share": "share of all regions it takes",
}
WAYS = ("random", "chosen")
SOURCES = {"demonstrator": "simulated demonstrator", "model": "drawn from the model"}
TABLES = {
    "early_overlap": (
        "truth",
        "source",
        "way",
        *(f"{name}{end}" for name in ANSWERS for end in ("", "_low", "_high")),
    )
}

_LOOKS = {"chosen": (DEMONSTRATION, "o", -0.13), "random": (TRUTH, "s", 0.13)}


def draw(early_overlap: pd.DataFrame) -> Figure:
    """Draw shares with their intervals, a line an answer and a panel a source."""
    if early_overlap["truth"].nunique() != 1:
        raise Unsuited("the answers of one truth are drawn")
    sources = [source for source in SOURCES if (early_overlap["source"] == source).any()]
    figure, grid = new_figure(PAGE, 2.4, ncols=len(sources), sharey=True, squeeze=False)
    with plt.rc_context(RC):
        for source, axes in zip(sources, grid[0], strict=True):
            rows = early_overlap[early_overlap["source"] == source].set_index("way")
            for way, (colour, mark, shift) in _LOOKS.items():
                for place, name in enumerate(ANSWERS):
                    low, value, high = (
                        100 * rows.loc[way, f"{name}{end}"] for end in ("_low", "", "_high")
                    )
                    axes.plot([low, high], [place + shift] * 2, color=colour, linewidth=1.4)
                    label = f"{way} tasks" if place == 0 else None
                    axes.plot(
                        [value], [place + shift], mark, color=colour, label=label, linestyle=""
                    )
            axes.set_title(SOURCES[source])
            axes.set_xlim(-2, 102)
            axes.set_xlabel("share after five demonstrations [%]")
        axes = grid[0, 0]
        axes.set_yticks(range(len(ANSWERS)), labels=list(ANSWERS.values()))
        axes.invert_yaxis()
        handles, labels = axes.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(handles))
    return figure


def facts(early_overlap: pd.DataFrame) -> str:
    """What the caption says."""
    lines = [
        "After five demonstrations of tasks that are chosen for what they teach, and of random "
        "ones; lines: 95 % bootstrap intervals over points and their repetitions. The most "
        "probable area is the best region with those that hang together with it and are at least "
        "half as probable.",
    ]
    for row in early_overlap.to_dict("records"):
        shares = "; ".join(
            f"{text} {100 * row[name]:.0f} % ({100 * row[f'{name}_low']:.0f} to "
            f"{100 * row[f'{name}_high']:.0f})"
            for name, text in ANSWERS.items()
        )
        lines.append(f"  {SOURCES[row['source']]}, {row['way']}: {shares}")
    return "\n".join(lines)
