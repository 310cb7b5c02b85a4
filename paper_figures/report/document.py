"""The whole report as Markdown: claims, then what the paper left open, then where it comes from."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from paper_figures.report import claim_1 as kept
from paper_figures.report import claim_2 as accuracy
from paper_figures.report import claim_3 as violations
from paper_figures.report import claim_4 as ranking
from paper_figures.report import claim_5 as actions
from paper_figures.report import claim_6 as telescope
from paper_figures.report import section_beliefs as calibration
from paper_figures.report import section_choices as sensitivity
from paper_figures.report import section_costs as timings
from paper_figures.report import section_origin as provenance
from paper_figures.report import section_start_points as in_cell
from paper_figures.report.markdown import figure, table
from paper_figures.report.study_tables import Missing, Results, absent
from paper_figures.report.verdict import RULES, Claim

FOLDER = "paper"  # the study whose folder holds the report


@dataclass(frozen=True)
class Figure:
    """A figure of a study, by the name of its files."""

    study: str
    name: str
    caption: str


# The claims in the paper's order, each with its figures.
CLAIMS: tuple[tuple[Callable[[Results], Claim], tuple[Figure, ...]], ...] = (
    (kept.claim, ()),
    (accuracy.claim, (Figure("paper", "final_state_error", "Compare the paper's Fig. 3."),)),
    (violations.claim, (Figure("paper", "violation_distance", "Compare the paper's Fig. 4."),)),
    (ranking.claim, (Figure("paper", "rank_curve", "Compare the paper's Fig. 5."),)),
    (actions.claim, ()),
    (
        telescope.claim,
        (
            Figure("telescope", "success_pain", "Compare the paper's Fig. 7."),
            Figure(
                "telescope",
                "success_cases_pain",
                "One choice changed at a time, and success against evidence.",
            ),
        ),
    ),
)

# What follows the claims: a heading, what writes it, and its figures.
SECTIONS: tuple[tuple[str, Callable[[Results], str], tuple[Figure, ...]], ...] = (
    (
        "Sensitivity to what the paper leaves open",
        sensitivity.section,
        (
            Figure("sensitivity", "sensitivity_c1", "One choice changed at a time, truth C1."),
            Figure("sensitivity", "sensitivity_c2", "One choice changed at a time, truth C2."),
        ),
    ),
    (
        "Calibration of the posterior",
        calibration.section,
        (Figure("calibration", "calibration", "Share that is right against probability."),),
    ),
    (
        "In-cell sampling at 100 cells",
        in_cell.section,
        (Figure("in_cell", "in_cell", "100 cells with 1 and 3 start points along a dimension."),),
    ),
    (
        "Time and memory",
        timings.section,
        (Figure("benchmark", "scale", "Time and memory against the number of states."),),
    ),
    ("Where the numbers come from", provenance.section, ()),
)

_INTRODUCTION = """\
# The paper's claims, checked

What Stocking, McPherson, Matthew and Tomlin, *Discretizing Dynamics for Maximum Likelihood
Constraint Inference*, claim, beside what the tables of this repository say. Every number here, and
every verdict, is computed from those tables by `python -m paper_report`; `make paper` runs whatever
is missing and then writes this file.

Values in brackets are 95 % intervals. For means and shares they come from a two-level bootstrap:
seeds are resampled, and within each seed its demonstrations (for ranks, random subsets of them), as
`experiments/aggregate.py` explains. Settings with one seed have intervals of the second level
alone, which are too narrow where ranks are concerned. Errors are shares of the ranges of the state
space, violation distances are numbers of regions, ranks start at 1, and dt is in seconds.
"""


def report(results: Results) -> str:
    """The report of a folder of results."""
    parts, claims = [], _claims(results)
    for number, (claim, (_, figures)) in enumerate(zip(claims, CLAIMS, strict=True), start=1):
        if isinstance(claim, Missing):
            parts.append(f"## Claim {number}\n\n{absent(claim)}")
        else:
            text = f"{claim.markdown()}\n{_figures(results, figures)}"
            parts.append(f"## Claim {number}: {claim.title}\n\n{text}")
    for heading, section, figures in SECTIONS:
        try:
            text = f"{section(results)}\n{_figures(results, figures)}"
        except Missing as missing:
            text = absent(missing)
        parts.append(f"## {heading}\n\n{text}")
    lines = [_INTRODUCTION, "## Verdicts\n", _verdicts(claims), RULES, *parts]
    return "\n".join(line.rstrip("\n") + "\n" for line in lines)


def verdicts(results: Results) -> str:
    """All claims with their verdicts, as a table."""
    return _verdicts(_claims(results))


def _claims(results: Results) -> list[Claim | Missing]:
    """Each claim, or what is missing for it."""
    found: list[Claim | Missing] = []
    for write, _ in CLAIMS:
        try:
            found.append(write(results))
        except Missing as missing:
            found.append(missing)
    return found


def _verdicts(claims: Sequence[Claim | Missing]) -> str:
    """The table of some claims."""
    rows: list[list[object]] = []
    for number, claim in enumerate(claims, start=1):
        if isinstance(claim, Missing):
            rows.append([number, "-", "not there yet", claim])
            continue
        held = [f"{part.statement}: {part.holding} of {len(part.checks)}" for part in claim.parts]
        rows.append([number, claim.title, f"**{claim.verdict}**", "; ".join(held)])
    return table(
        ["claim", "about", "verdict", "its parts, and in how many settings"], rows, words=4
    )


def _figures(results: Results, figures: tuple[Figure, ...]) -> str:
    """Those figures that are drawn, with paths from the report's folder."""
    lines = []
    for each in figures:
        path = results.folder / each.study / "figures" / f"{each.name}.png"
        if path.is_file():
            inside = f"figures/{path.name}"
            relative = inside if each.study == FOLDER else f"../{each.study}/{inside}"
            lines.append(figure(relative, each.caption))
        else:
            lines.append(f"The figure `{each.name}` is not drawn yet; `make figures` does it.\n")
    return "\n".join(lines)
