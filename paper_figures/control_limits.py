"""Limits of controls: how soon they are found, and how often one is imagined."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from paper_figures.rows import Unsuited
from paper_figures.style import (
    DEMONSTRATION,
    GUIDE,
    PAGE,
    RC,
    SAMPLED,
    STEP_COLOURS,
    STEP_MARKS,
    new_figure,
)

_SHARES = ("true_first", "posterior", "wrong", "wrong_sure")
TABLES = {
    "control_curve": (
        *("truth", "demonstrations", "calibrated", "seeds"),
        *(f"{name}{end}" for name in _SHARES for end in ("", "_low", "_high")),
    ),
    "cases": ("truth", "case"),
}

UNIT = "rad/s²"
_KINDS = (SAMPLED, DEMONSTRATION)  # colours of chances that are the model's, and calibrated


def limit_rows(control_curve: pd.DataFrame, cases: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The rows of each case, by its name, in the order of the study.

    Raises:
        Unsuited: there is no case with a limit, or none without.
    """
    rows = {
        str(case): control_curve[control_curve["truth"] == truth].sort_values("demonstrations")
        for truth, case in zip(cases["truth"], cases["case"], strict=True)
    }
    known = [each["true_first"].notna().any() for each in rows.values()]
    if all(known) or not any(known):
        raise Unsuited("it compares truths that limit controls with one that does not")
    return rows


def draw(control_curve: pd.DataFrame, cases: pd.DataFrame) -> Figure:
    """Draw how often the truth comes first and its posterior, and wrong answers without a limit."""
    rows = limit_rows(control_curve, cases)
    limited = {case: each for case, each in rows.items() if each["true_first"].notna().any()}
    figure, axes = new_figure(PAGE, 2.7, ncols=3)
    with plt.rc_context(RC):
        for number, (case, each) in enumerate(limited.items()):
            look = number % len(STEP_COLOURS)
            best = each[each["calibrated"] == each["calibrated"].max()]
            limit, comma, more = case.partition(",")
            label = f"u {limit} {UNIT}{comma}{more}"
            for place, name in zip(axes, ("true_first", "posterior"), strict=False):
                line = "-" if number < len(STEP_COLOURS) else "--"
                _curve(place, best, name, STEP_COLOURS[look], STEP_MARKS[look], line, label)
        free = pd.concat([each for case, each in rows.items() if case not in limited])
        for calibrated, each in free.groupby("calibrated"):
            kind = "calibrated" if calibrated else "model's chances"
            colour, mark = _KINDS[calibrated], STEP_MARKS[calibrated]
            _curve(axes[2], each, "wrong", colour, mark, "-", kind)
            _curve(axes[2], each, "wrong_sure", colour, mark, ":", f"{kind}, above 50 %")
        for place, name in zip(
            axes,
            ("truth first", "posterior of the truth", "a limit where there is none"),
            strict=True,
        ):
            place.set_title(name)
            place.set_ylim(0, 102)
            place.set_xlabel("demonstrations")
            place.axhline(100, color=GUIDE, linewidth=0.6, linestyle=":", zorder=0)
        axes[0].set_ylabel("sets of demonstrations [%]")
        axes[1].set_ylabel("mean probability [%]")
        axes[2].set_ylabel("sets of demonstrations [%]")
        axes[0].legend(loc="lower right")
        axes[2].legend(loc="upper right")
    return figure


def _curve(
    axes: plt.Axes, rows: pd.DataFrame, name: str, colour: str, mark: str, line: str, label: str
) -> None:
    """A share against the number of demonstrations, with its interval."""
    x = rows["demonstrations"]
    low, high = 100 * rows[f"{name}_low"], 100 * rows[f"{name}_high"]
    axes.plot(
        x,
        100 * rows[name],
        color=colour,
        marker=mark,
        markersize=3,
        linestyle=line,
        label=label,
    )
    axes.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)


def facts(control_curve: pd.DataFrame, cases: pd.DataFrame) -> str:
    """What the caption says."""
    lines = [
        "Demonstrators of the pendulum whose control u is limited; hypotheses forbid u beyond 0.5,",
        "1 or 1.5 rad/s² on either side. Share of random sets of demonstrations in which the range",
        "that is forbidden in truth comes first, and its mean posterior, with calibrated chances;",
        "right: how often some range is the most probable answer although nothing is forbidden,",
        "and is so above 50 %. Bands: 95 % bootstrap intervals over seeds and sets.",
    ]
    for case, rows in limit_rows(control_curve, cases).items():
        for row in rows[rows["demonstrations"].isin([1, 3, 5, 10, 20])].itertuples():
            kind = "calibrated" if row.calibrated else "model's chances"
            first = "" if pd.isna(row.true_first) else f"truth first {100 * row.true_first:.0f} %, "
            lines.append(
                f"  {case}, {kind}, {row.demonstrations}: {first}wrong answer "
                f"{100 * row.wrong:.0f} % ({100 * row.wrong_low:.0f} to {100 * row.wrong_high:.0f})"
            )
    return "\n".join(lines)
