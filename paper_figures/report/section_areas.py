"""How well sets of hypotheses cover a truth that is larger than any of them."""

from __future__ import annotations

from paper_figures.area_cover import AIM, METHODS
from paper_figures.report.markdown import between, number, percent, table
from paper_figures.report.study_tables import Results

STUDY = "areas"
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
    reached = curve[curve["iou"] >= AIM]
    first = (
        f"no method reaches {AIM:g} with as many as were tried"
        if reached.empty
        else "; ".join(
            f"{METHODS[str(method)]} reaches {AIM:g} with {rows['demonstrations'].min()}"
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
        f"length of its border says. Of the mean overlap, {first}. Demonstrations that pass one "
        "ellipse alone tell nothing of the other.\n\n"
        + table(
            ["demonstrations", "method", "overlap", "precision", "recall", "squares"],
            lines,
            words=2,
        )
    )
