"""Sampled paths beside cells: ranks of the truth, forecasts, and how Phi settles with dt."""

from __future__ import annotations

import re
from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, NullLocator

from paper_figures.rows import Unsuited
from paper_figures.style import PAGE, RC, mark, new_figure, whiskers

_SCORES = ("brier", "brier_low", "brier_high", "log_score", "log_score_low", "log_score_high")
TABLES = {
    "models": ("truth", "cells", "seed", *_SCORES, "off_by", "rank", "settled", "doubted"),
    "halving": ("truth", "cells", "seed", "step", "shorter", "trial", "change", "noise"),
    "rank_curve": ("truth", "cells", "demonstrations", "median", "median_low", "median_high"),
}

_TICKS = (1, 2, 5, 10, 20, 50, 100)
_RESAMPLES, _TAILS = 1000, (0.025, 0.975)


def name(cells: int) -> str:
    """What the legend calls a model."""
    return f"{cells} cells" if cells else "sampled paths"


def change_rows(halving: pd.DataFrame) -> pd.DataFrame:
    """How far Phi differs between a time step and the next shorter one, a row a model and step.

    Returns:
        `cells`; `step` [s]; `rms`, the root mean square difference over tasks and regions, less
        what is noise of samples, and its 95 % interval `low` to `high` by a bootstrap over tasks.
    """
    rows = []
    for (cells, step), group in halving.groupby(["cells", "step"]):
        rms, drawn = _root_mean(group)
        low, high = np.quantile(drawn, _TAILS)
        rows.append({"cells": cells, "step": step, "rms": rms, "low": low, "high": high})
    return pd.DataFrame(rows)


def slopes(halving: pd.DataFrame) -> pd.DataFrame:
    """The power of the time step that the difference of Phi follows, a row a model.

    Returns:
        `cells`; `slope` of log difference against log step, with `low` and `high`, its 95 %
        interval over the same resamples of tasks at all steps.
    """
    rows = []
    for cells, group in halving.groupby("cells"):
        steps = np.array(sorted(group["step"].unique()))
        if len(steps) < 2:
            continue
        parts = [_root_mean(group[group["step"] == step]) for step in steps]
        roots = np.array([np.append(root, drawn) for root, drawn in parts])
        with np.errstate(divide="ignore"):
            logs = np.log(np.maximum(roots, np.finfo(float).tiny))
        apart = np.log(steps) - np.mean(np.log(steps))
        fitted = apart @ logs / (apart @ apart)
        low, high = np.quantile(fitted[1:], _TAILS)
        rows.append({"cells": cells, "slope": fitted[0], "low": low, "high": high})
    return pd.DataFrame(rows, columns=["cells", "slope", "low", "high"])


def _root_mean(group: pd.DataFrame) -> tuple[float, np.ndarray]:
    """The root of the mean of change less noise, and the same of resamples of the rows."""
    square = (group["change"] - group["noise"]).to_numpy()
    draws = np.random.default_rng(0).integers(0, len(square), (_RESAMPLES, len(square)))
    roots = np.sqrt(np.maximum(np.append(square.mean(), square[draws].mean(axis=1)), 0.0))
    return float(roots[0]), roots[1:]


def draw(models: pd.DataFrame, halving: pd.DataFrame, rank_curve: pd.DataFrame) -> Figure:
    """Draw a row a truth: its median rank and its share among the first; then what is of models."""
    if not (models["cells"] == 0).any():
        raise Unsuited("nothing is sampled")
    truths, share = sorted(rank_curve["truth"].unique()), _share(rank_curve)
    if len(truths) != 2:
        raise Unsuited(f"{len(truths)} truths do not fill two rows")
    if rank_curve.duplicated(["truth", "cells", "demonstrations"]).any():
        raise Unsuited("rows differ in more than truth, cells and demonstrations")
    figure, grid = new_figure(PAGE, 4.2, nrows=2, ncols=3)
    with plt.rc_context(RC):
        for truth, row in zip(truths, grid, strict=True):
            curves = rank_curve[rank_curve["truth"] == truth]
            for axes, column in ((row[0], "median"), (row[1], share)):
                _draw_curves(axes, curves, column, 1 if column == "median" else 100)
                axes.set_xlabel("demonstrations")
                axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
                axes.set_title(str(truth).upper(), loc="left")
            row[0].set_yscale("log")
            row[0].set_ylim(0.9, 100)
            row[0].set_yticks(_TICKS, labels=list(map(str, _TICKS)))
            row[0].yaxis.set_minor_locator(NullLocator())
            row[0].set_ylabel("rank of truth")
            row[1].set_ylim(0, 103)
            row[1].set_ylabel(f"in the top {share.rpartition('_')[2]} [%]")
        _draw_changes(grid[0][2], change_rows(halving))
        _draw_scores(grid[1][2], models)
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _share(rank_curve: pd.DataFrame) -> str:
    """The column of how often the truth is among the first."""
    return next(name for name in rank_curve if re.fullmatch(r"share_top_\d+", name))


def _models(rows: pd.DataFrame) -> Iterator[tuple[int, int, pd.DataFrame]]:
    """The rows of each model, with its number and its cells; sampled paths first."""
    for number, (cells, group) in enumerate(rows.groupby("cells", sort=True)):
        yield number, int(cells), group


def _draw_curves(axes: Axes, rows: pd.DataFrame, column: str, scale: float) -> None:
    """A curve a model with its interval."""
    for number, cells, curve in _models(rows):
        style = mark(cells, number)
        low, high = (scale * curve[f"{column}_{end}"] for end in ("low", "high"))
        x = curve["demonstrations"]
        axes.fill_between(x, low, high, color=style["color"], alpha=0.15, linewidth=0)
        axes.plot(x, scale * curve[column], label=name(cells), markevery=(number, 4), **style)


def _draw_changes(axes: Axes, rows: pd.DataFrame) -> None:
    """Differences of Phi against the time step."""
    for number, cells, some in _models(rows):
        lengths = whiskers(some["rms"], some["low"], some["high"])
        axes.errorbar(some["step"], some["rms"], lengths, **mark(cells, number))
    axes.set_xscale("log")
    axes.set_yscale("log")
    steps = sorted(rows["step"].unique())
    axes.set_xticks(steps, labels=[f"{step:g}" for step in steps])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("$\\Delta t$ [s]")
    axes.set_ylabel("change of $\\Phi$ [probability]")


def _draw_scores(axes: Axes, models: pd.DataFrame) -> None:
    """The Brier score of each model's forecasts; the same tasks for all truths and seeds."""
    names = []
    for number, cells, some in _models(models):
        first = some.iloc[:1]
        lengths = whiskers(first["brier"], first["brier_low"], first["brier_high"])
        axes.errorbar([number], first["brier"], lengths, **mark(cells, number))
        names.append(name(cells).replace(" ", "\n"))
    axes.set_xticks(range(len(names)), labels=names)
    axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_ylim(bottom=0)
    axes.set_ylabel("Brier score of $\\Phi$ [1]")


def facts(models: pd.DataFrame, halving: pd.DataFrame, rank_curve: pd.DataFrame) -> str:
    """What the caption says."""
    share = _share(rank_curve)
    most = rank_curve["demonstrations"].max()
    lines = [
        "The paper's pendulum with cells and sampled paths: median rank of the truth, and how",
        "often it is among the first; dt is 0.25 s, but for changes of Phi.",
        "Bands and bars: 95 % intervals by bootstrap, of ranks over seeds and subsets.",
        "Change of Phi: root mean square over tasks and regions, between a time step and the next",
        "shorter one, less the noise of samples. Brier score: forecasts of which regions simulated",
        "demonstrators enter whom nothing constrains; less is better.",
    ]
    for row in rank_curve[rank_curve["demonstrations"] == most].to_dict("records"):
        part, low, high = (100 * row[share + end] for end in ("", "_low", "_high"))
        lines.append(
            f"  {row['truth'].upper()}, {name(row['cells'])}, {most} demonstrations: median rank "
            f"{row['median']:.3g} ({row['median_low']:.3g} to {row['median_high']:.3g}), in "
            f"the top {share.rpartition('_')[2]} {part:.0f} % ({low:.0f} to {high:.0f})"
        )
    for row in slopes(halving).to_dict("records"):
        lines.append(
            f"  {name(row['cells'])}: the change of Phi goes with dt to the power of "
            f"{row['slope']:.2f} ({row['low']:.2f} to {row['high']:.2f})"
        )
    return "\n".join(lines)
