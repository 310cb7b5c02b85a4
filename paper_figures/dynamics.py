"""Whether success can be foretold before anybody demonstrates, of systems that were left out."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figures.style import DEMONSTRATION, GUIDE, PAGE, RC, TRUTH, new_figure, whiskers

_ENDS = ("", "_low", "_high")
TABLES = {
    "success_forecasts": ("system", "cells", "dt", "top", "rule"),
    "success_scores": (
        *("way", "systems", "points"),
        *(f"{name}{end}" for name in ("brier", "rule_less") for end in _ENDS),
    ),
    "success_rule": ("feature", "weight", "weight_low", "weight_high"),
}

WAYS = {
    "rule": "the rule",
    "all_features": "all numbers",
    "expected_violations": "expected violations alone",
    "base_rate": "base rate",
}
FEATURES = {
    "frozen": "frozen cells",
    "cells_crossed": "cells crossed in a step",
    "reach": "reach of controls in a step",
    "expansion": "expansion of the flow",
    "unreachable": "goals out of reach",
    "forecast_error": "forecast error",
    "touched": "tasks that the truth touches",
    "expected_violations": "expected violations",
    "simulated": "simulated success",
}
_ASIDE = 0.16  # of a row, that its two marks are apart


def system_rows(success_forecasts: pd.DataFrame) -> pd.DataFrame:
    """Success and what was foretold, means over the points of each system, the best first."""
    means = success_forecasts.groupby("system")[["top", "rule"]].mean()
    return means.sort_values("top", kind="stable", ascending=False)


def draw(
    success_forecasts: pd.DataFrame, success_scores: pd.DataFrame, success_rule: pd.DataFrame
) -> Figure:
    """Draw success by system beside its forecast, the scores of each way, and the rule."""
    figure, (left, middle, right) = new_figure(
        PAGE, 2.9, ncols=3, gridspec_kw={"width_ratios": [1.25, 0.9, 0.95]}
    )
    with plt.rc_context(RC):
        _by_system(left, success_forecasts)
        ways = success_scores.set_index("way").loc[list(WAYS)]
        _rows(
            middle,
            [name.replace(" alone", "\nalone") for name in WAYS.values()],
            *(ways[f"brier{end}"] for end in _ENDS),
        )
        middle.set_xlabel("Brier score,\nsystems left out [1]")
        middle.set_xlim(left=0)
        weights = success_rule[success_rule["feature"] != "intercept"]
        names = [FEATURES[name].replace(" ", "\n", 1) for name in weights["feature"]]
        if not names:  # no number pays
            right.set_yticks([])
        _rows(right, names, *(weights[f"weight{end}"] for end in _ENDS))
        right.axvline(0, color=GUIDE, linewidth=0.6)
        right.set_xlabel("weight by standard\ndeviation [log odds]")
    return figure


def facts(
    success_forecasts: pd.DataFrame, success_scores: pd.DataFrame, success_rule: pd.DataFrame
) -> str:
    """What the caption says."""
    first = success_scores.iloc[0]
    lines = [
        "Left: how often the truth is among the first 5 after 9 demonstrations, the mean over",
        "truths, grids and time steps of a system (circles; thin: each grid and time step), and",
        "what a rule foretells that was chosen and fitted without that system (crosses). Middle:",
        f"Brier scores over {first['points']} points of {first['systems']} systems, each foretold",
        "without its own system. Right: the rule that all points make. Lines: 95 % bootstrap",
        "intervals over systems.",
    ]
    ways = success_scores.set_index("way")
    for way, name in WAYS.items():
        row = ways.loc[way]
        lines.append(
            f"  {name}: Brier score {row['brier']:.3f}; the rule's less this "
            f"{row['rule_less']:+.3f} [{row['rule_less_low']:+.3f}, {row['rule_less_high']:+.3f}]"
        )
    return "\n".join(lines)


def _by_system(axes: Axes, forecasts: pd.DataFrame) -> None:
    """A row a system: success, what was foretold, and success of each grid and time step."""
    rows = system_rows(forecasts)
    each = forecasts.groupby(["system", "cells", "dt"])["top"].mean().reset_index()
    place = {system: number for number, system in enumerate(rows.index)}
    height = each["system"].map(place) + _ASIDE
    axes.plot(100 * each["top"], height, "|", color=TRUTH, markersize=5, alpha=0.6)
    numbers = np.arange(len(rows))
    axes.plot(100 * rows["top"], numbers + _ASIDE, "o", color=TRUTH, label="came")
    axes.plot(100 * rows["rule"], numbers - _ASIDE, "x", color=DEMONSTRATION, label="foretold")
    axes.set_yticks(numbers, labels=list(rows.index))
    axes.invert_yaxis()
    axes.set_xlim(-3, 103)
    axes.set_xlabel("truth in the top 5 after\n9 demonstrations [%]")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)


def _rows(axes: Axes, names: list[str], middle: pd.Series, low: pd.Series, high: pd.Series) -> None:
    """A row a name: a value with its interval."""
    numbers = np.arange(len(names))
    lengths = whiskers(middle, low, high)
    axes.errorbar(middle, numbers, xerr=lengths, fmt="o", color=DEMONSTRATION, elinewidth=0.8)
    if names:
        axes.set_yticks(numbers, labels=names)
        axes.set_ylim(len(names) - 0.5, -0.5)
