"""Arms and bodies without a grid: how often the truth is found, and whether forecasts come true."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures.report.means import Mean, share
from paper_figures.rows import Unsuited
from paper_figures.style import GUIDE, PAGE, RC, SIX_COLOURS, SIX_MARKS, new_figure, whiskers

TABLES = {
    "models": (
        *("truth", "seed", "rank", "rank_lowest", "rank_highest", "posterior", "claim", "none"),
        *("tasks", "possible", "effective", "doubted"),
    ),
    "scored": ("seed", "lower", "upper", "count", "forecast", "crossed"),
    "summary": ("seed", "demonstrations"),
    "cases": ("case",),
}
TARGET = 0.8  # share of worlds of the arm of six joints with the truth among the first two
FIRST = (1, 2)  # so many of the first ranks are looked at
_RESAMPLES, _TAILS = 1000, (0.025, 0.975)


def worlds(models: pd.DataFrame, summary: pd.DataFrame, cases: pd.DataFrame) -> pd.DataFrame:
    """A row a world, with its `case`, its system; beside the columns of `models` that of `summary`.

    Raises:
        Unsuited: a study of other truths, whose points are no worlds.
    """
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    if set(models["truth"]) != {"drawn"}:
        raise Unsuited("truths are not drawn, so that points are no worlds")
    kept = summary[[*keys, "seed", "demonstrations"]]
    return cases[[*keys, "case"]].merge(models.merge(kept, on=[*keys, "seed"]), on=keys)


def of_cases(table: pd.DataFrame, cases: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table of points, with their case."""
    keys = [name for name in cases if name not in ("case", "choice", "value")]
    return cases[[*keys, "case"]].merge(table, on=keys)


def among_first(rows: pd.DataFrame, first: int) -> Mean:
    """The share of worlds whose truth is among the first, with Wilson's interval."""
    return share(int((rows["rank"] <= first).sum()), len(rows))


def forecast_rows(scored: pd.DataFrame) -> pd.DataFrame:
    """Forecasts and what came of them, a row a bin.

    Returns:
        `lower` and `upper` ends of the bin; `count` of pairs of a task and a hypothesis; their mean
        `forecast`; the share that was `crossed`, with its 95 % interval, `low` to `high`, from
        worlds that are drawn again.
    """
    seeds, where = np.unique(scored["seed"], return_inverse=True)
    draws = np.random.default_rng(0).integers(0, len(seeds), (_RESAMPLES, len(seeds)))
    times = np.stack([np.bincount(drawn, minlength=len(seeds)) for drawn in draws])
    rows = []
    for (lower, upper), index in scored.groupby(["lower", "upper"]).groups.items():
        some, of = scored.loc[index], where[scored.index.get_indexer(index)]
        weights = times[:, of] * some["count"].to_numpy()
        with np.errstate(invalid="ignore"):
            shares = weights @ some["crossed"].to_numpy() / weights.sum(axis=1)
        low, high = np.nanquantile(shares, _TAILS)
        row = {"lower": lower, "upper": upper, "count": int(some["count"].sum())}
        for name in ("forecast", "crossed"):
            row[name] = float(np.average(some[name], weights=some["count"]))
        rows.append({**row, "low": low, "high": high})
    return pd.DataFrame(rows)


def draw(
    models: pd.DataFrame, scored: pd.DataFrame, summary: pd.DataFrame, cases: pd.DataFrame
) -> Figure:
    """Draw how often the truth is first or second, its posterior, and forecasts."""
    rows, forecasts = worlds(models, summary, cases), of_cases(scored, cases)
    names = list(dict.fromkeys(cases["case"]))
    figure, (left, middle, right) = new_figure(PAGE, 2.6, ncols=3)
    with plt.rc_context(RC):
        _draw_shares(left, rows, names)
        _draw_posteriors(middle, rows, names)
        _draw_forecasts(right, forecasts, names)
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def _draw_shares(axes: Axes, rows: pd.DataFrame, names: list[str]) -> None:
    """Shares of worlds with the truth first, hollow, and among the first two, filled."""
    for number, name in enumerate(names):
        for first, shift in zip(FIRST, (-0.15, 0.15), strict=True):
            mean = among_first(rows[rows["case"] == name], first)
            axes.errorbar(
                [number + shift],
                [100 * mean.value],
                whiskers([100 * mean.value], [100 * mean.low], [100 * mean.high]),
                color=SIX_COLOURS[-1 - number],
                marker=SIX_MARKS[number],
                markerfacecolor="white" if first == 1 else SIX_COLOURS[-1 - number],
            )
    axes.axhline(100 * TARGET, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
    axes.set_xticks(range(len(names)), labels=[name.replace(", ", ",\n") for name in names])
    axes.set_xlim(-0.5, len(names) - 0.5)
    axes.set_ylim(0, 103)
    axes.set_ylabel("worlds [%]")
    axes.set_title("truth first (hollow), in the first two", loc="left")


def _draw_posteriors(axes: Axes, rows: pd.DataFrame, names: list[str]) -> None:
    """The share of worlds in which the truth's posterior is at most so large."""
    for number, name in enumerate(names):
        values = np.sort(rows.loc[rows["case"] == name, "posterior"].to_numpy())
        shares = np.arange(1, len(values) + 1) / len(values)
        colour = SIX_COLOURS[-1 - number]
        axes.step(np.append(0, values), np.append(0, 100 * shares), where="post", color=colour)
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 103)
    axes.set_xlabel("posterior of truth [probability]")
    axes.set_ylabel("worlds with at most that [%]")


def _draw_forecasts(axes: Axes, forecasts: pd.DataFrame, names: list[str]) -> None:
    """Forecasts against what the demonstrators did whom nothing constrains."""
    axes.plot([0, 1], [0, 1], color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
    for number, name in enumerate(names):
        some = forecast_rows(forecasts[forecasts["case"] == name].reset_index(drop=True))
        axes.errorbar(
            some["forecast"],
            some["crossed"],
            whiskers(some["crossed"], some["low"], some["high"]),
            color=SIX_COLOURS[-1 - number],
            marker=SIX_MARKS[number],
            elinewidth=0.5,
            label=name,
        )
    axes.set_xlabel("forecast $\\Phi$ [probability]")
    axes.set_ylabel("share that is crossed [1]")


def facts(
    models: pd.DataFrame, scored: pd.DataFrame, summary: pd.DataFrame, cases: pd.DataFrame
) -> str:
    """What the caption says."""
    rows = worlds(models, summary, cases)
    lines = [
        "Worlds of arms, with sampled paths and no cells. Each has tasks of its own, and as truth",
        "one of its hypotheses, ranges of two joints, which enough tasks cross. Left: share",
        "of worlds with the truth first, hollow, and among the first two, with Wilson's 95 %",
        "intervals; dotted: what is asked of six joints. Middle: the truth's posterior.",
        "Right: forecasts of what demonstrators enter whom nothing constrains, for tasks that are",
        "not selected; bars: 95 % intervals from worlds that are drawn again.",
    ]
    for name, some in rows.groupby("case", sort=False):
        most = int(some["demonstrations"].max())
        shares = (among_first(some, first) for first in FIRST)
        first, two = (
            f"{100 * each.value:.0f} % ({100 * each.low:.0f} to {100 * each.high:.0f})"
            for each in shares
        )
        lines.append(
            f"  {name}: {len(some)} worlds, {int((some['demonstrations'] < most).sum())} with "
            f"fewer than {most} demonstrations; truth first in {first}, among the first two in "
            f"{two}; median posterior {some['posterior'].median():.2f}"
        )
    return "\n".join(lines)
