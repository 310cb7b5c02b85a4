"""How much of what the time step does to claims 2 and 3 is the tabular agent's control noise."""

from __future__ import annotations

import numpy as np
import pandas as pd

from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results

STUDY = "control_noise"
MEASURES = {"final_state_error": "final-state error", "violation_distance": "violation distance"}
SETTING = ["truth", "cells", "actions", "dt"]


def section(results: Results) -> str:
    """Error and violation distance at each time step, for both sets of actions.

    Raises:
        Missing: the study `control_noise` is not there yet, or has one set of actions.
    """
    means = results.table(STUDY, "measures", (*SETTING, "measure", "mean", "low", "high"))
    noise = results.table(STUDY, "summary", (*SETTING, "noise_1", "free_noise_1"))
    counts = sorted(means["actions"].unique())
    if len(counts) < 2:
        raise Missing(STUDY, f"the study `{STUDY}` has one set of actions")
    means = means[means["measure"].isin(list(MEASURES))]
    by_setting = means.set_index([*SETTING, "measure"]).sort_index()
    noises = noise.groupby(["actions", "dt"])["noise_1"].mean()
    lines = []
    for (truth, cells, dt), _ in means.groupby(["truth", "cells", "dt"]):
        texts = [number(noises[count, dt]) for count in counts]
        for name in MEASURES:
            for count in counts:
                row = by_setting.loc[(truth, cells, count, dt, name)]
                texts.append(between(*(number(row[end]) for end in ("mean", "low", "high"))))
        lines.append([str(truth).upper(), cells, f"{dt:g} s", *texts])
    head = ["truth", "cells", "dt", *(f"noise, {count} actions" for count in counts)]
    head += [f"{words}, {count} actions" for words in MEASURES.values() for count in counts]
    return (
        f"An agent that holds one of {counts[0]} actions within the control box for dt has less "
        "control noise, var(u) dt, at a short time step than at a long one; without limits the "
        f"reward alone would make it {number(noise['free_noise_1'].mean())} at any. With "
        f"{counts[-1]} actions in a range three times as wide it is nearly that. So what a longer "
        "time step does with the few actions and no longer with the many is due to the noise, and "
        "not to the time step.\n\n"
        + "".join(f"- {_judgement(by_setting, name, counts)}\n" for name in MEASURES)
        + "\n"
        + table(head, lines, words=3)
    )


def _judgement(means: pd.DataFrame, measure: str, counts: list[int]) -> str:
    """How a measure changes from the shortest to the longest time step, with either actions."""
    values = means.xs(measure, level="measure")["mean"].unstack("dt")
    change = (values.iloc[:, -1] / values.iloc[:, 0] - 1).unstack("actions")
    changes = ", ".join(
        f"{str(truth).upper()} at {cells} cells "
        + " and ".join(percent(row[count]) for count in (counts[0], counts[-1]))
        for (truth, cells), row in change.iterrows()
    )
    both = np.log1p(change[[counts[0], counts[-1]]].dropna()).mean()
    few, many = both.tolist()
    explained = (
        f"the noise explains {percent(1 - many / few)} of that"
        if abs(many) < abs(few)
        else f"the noise hides {percent(1 - few / many)} of what the time step does"
    )
    steps = f"from dt {values.columns[0]:g} to {values.columns[-1]:g} s"
    return (
        f"The {MEASURES[measure]} changes {steps} by (with {counts[0]} and {counts[-1]} actions): "
        f"{changes}. On a logarithmic scale, where both can do the tasks, {explained}."
    )
