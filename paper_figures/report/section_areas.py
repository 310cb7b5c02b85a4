"""How well sets of hypotheses cover a truth that is larger than any of them."""

from __future__ import annotations

import pandas as pd

from paper_figures.area_cover import AIM, CEILINGS, METHODS, SHOWN
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Missing, Results, absent

STUDY, OUTSIDE = "areas", "shortest_ways"
_SCORES = ("iou", "precision", "recall")


def section(results: Results) -> str:
    """A line for each number of demonstrations and method.

    Raises:
        Missing: the study `areas` is not there yet.
    """
    columns = [f"{name}{end}" for name in _SCORES for end in ("", "_low", "_high")]
    curve = results.table(
        STUDY, "area_curve", ("demonstrations", "method", "regions", "seeds", *columns)
    )
    reached = curve[(curve["iou"] >= AIM) & ~curve["method"].isin(CEILINGS)]
    first = (
        "by no method with as many as were tried"
        if reached.empty
        else ", ".join(
            f"with {rows['demonstrations'].min()} (*{METHODS[str(method)]}*)"
            for method, rows in reached.groupby("method", sort=False)
        )
    )
    lines = [
        [
            row["demonstrations"],
            METHODS[row["method"]],
            between(*(number(row[f"iou{end}"], 2) for end in ("", "_low", "_high"))),
            *(
                between(*(percent(row[f"{name}{end}"]) for end in ("", "_low", "_high")))
                for name in ("precision", "recall")
            ),
            number(row["regions"], 2),
        ]
        for row in curve.to_dict("records")
    ]
    return (
        "A point in a plane keeps out of two ellipses; hypotheses are small squares, and only "
        "tasks whose straight way would enter the truth count. How well does the union of what is "
        "inferred cover the truth? Overlap is intersection over union (IoU). *Greedy* adds squares "
        "while each explains more than 0.1 nat a demonstration. *Posterior of the set* adds them "
        "while the posterior of the set rises, under a prior by which a set is as probable as the "
        f"length of its border says.\n\n"
        f"{_shapes(curve)}{_from_outside(results)}"
        f"The mean overlap reaches {AIM:g} {first}. Demonstrations that pass one ellipse alone "
        "tell nothing of the other.\n\n"
        + table(
            ["demonstrations", "method", "overlap", "precision", "recall", "squares or parts"],
            lines,
            words=2,
        )
    )


def _shapes(curve: pd.DataFrame) -> str:
    """What areas of shapes are, what they expect, and what could be reached; nothing without."""
    at = curve[curve["demonstrations"] == SHOWN].set_index("method")
    if "shapes" not in at.index or "expected" not in curve:
        return ""
    overlap, ideal, shown = (_overlap(at, name) for name in ("shapes", "ideal", "shown"))
    climb = number(at.loc["climb", "iou"], 2)
    return (
        "An area of *shapes* is inferred without squares: nothing, one or two of many ellipses are "
        "forbidden, whose places and half widths are drawn from a prior that holds the truth's. "
        "Ellipses that a demonstration enters are excluded, the posterior of all pairs of the "
        "others is exact for the drawn ones, and the answer is the area whose *expected* overlap "
        "is largest, which is neither the most probable pair nor all that is rather forbidden than "
        f"not. With {SHOWN} demonstrations it reaches {overlap}, against {climb} of squares, and "
        f"expects {number(at.loc['shapes', 'expected'], 2)}{_hope(curve)}. "
        "What could be reached? The regions of the "
        f"truth that lie in the way of one of {SHOWN} tasks overlap all of it by {shown}: "
        "nobody shows anything of the others. Where the truth is two ellipses of the prior and "
        f"the tabular model itself demonstrates, so that all that is assumed is right, the same "
        f"inference reaches {ideal}: that much is left open by so few detours.\n\n"
        f"{_chosen(at)}"
    )


def _hope(curve: pd.DataFrame) -> str:
    """What is reached and expected with the most demonstrations, and which of the two is more."""
    shapes = curve[curve["method"] == "shapes"].set_index("demonstrations")
    most, last = int(shapes.index.max()), shapes.loc[shapes.index.max()]
    if most == SHOWN:
        return ""
    verdict = "too hopeful" if last["expected"] > last["iou_high"] else "as it comes out"
    if last["expected"] < last["iou_low"]:
        verdict = "too careful"
    return (
        f", with {most} it reaches {number(last['iou'], 2)} and expects "
        f"{number(last['expected'], 2)}, which is {verdict}"
    )


def _from_outside(results: Results) -> str:
    """What shortest ways round the truth cost and tell, without cells and simulated paths."""
    try:
        columns = ("measure", "demonstrations", "mean", "low", "high")
        summary = results.table(OUTSIDE, "summary", columns)
    except Missing as missing:
        return f"{absent(missing)}\n"
    of = summary.groupby("measure")
    low, middle, high = (
        number(of.get_group(f"ratio_{share}")["mean"].item(), 3) for share in ("0.1", "0.5", "0.9")
    )
    expected = of.get_group("expected").set_index("demonstrations")["mean"]
    told = [
        f"{row['demonstrations']:g} tasks "
        f"{between(*(number(row[end], 2) for end in ('mean', 'low', 'high')))}, "
        f"expecting {number(expected[row['demonstrations']], 2)}"
        for row in of.get_group("overlap").to_dict("records")
    ]
    return (
        "The same from outside: in this plane the cheapest way is the shortest, at even speed, and "
        "round ellipses it is found exactly. The demonstrators spend "
        f"{middle} times as much in the median, {low} at the 10th percentile and {high} at the "
        "90th. If somebody went the shortest ways, the posterior of two ellipses by what these "
        f"cost, without cells, would reach with {', and with '.join(told)}. What it expects is "
        "what so many detours tell on average over the prior, what it reaches is of this truth.\n\n"
    )


def _overlap(at: pd.DataFrame, method: str) -> str:
    """The overlap of a method with its interval, from rows by method."""
    if method not in at.index:
        return "-"
    return between(*(number(at.loc[method, f"iou{end}"], 2) for end in ("", "_low", "_high")))


def _chosen(at: pd.DataFrame) -> str:
    """What it brings to choose tasks, from the rows of SHOWN demonstrations by method."""
    if "chosen" not in at.index:
        return ""
    chosen, random, ideal = (_overlap(at, name) for name in ("chosen", "shapes", "ideal_chosen"))
    verdict = "which the intervals do not tell apart from"
    if at.loc["chosen", "iou_low"] > at.loc["shapes", "iou_high"]:
        verdict = "more than"
    elif at.loc["chosen", "iou_high"] < at.loc["shapes", "iou_low"]:
        verdict = "less than"
    return (
        "Tasks may be *chosen*: one after the other, each is the one after which the area is "
        "expected to overlap best, over demonstrations that are simulated under each plausible "
        f"truth. {SHOWN} chosen tasks reach {chosen}, {verdict} {random} of random ones; where all "
        f"that is assumed is right, {ideal}. All tasks to choose from lead through what is "
        "forbidden, which the belief that chooses does not know: it takes the longest first, that "
        "might meet most, where any would have met something. Nor does it know how much is told by "
        "a detour that hardly any trajectory takes.\n\n"
    )
