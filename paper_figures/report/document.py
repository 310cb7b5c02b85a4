"""The whole report as Markdown: claims, then what the paper left open, then where it comes from."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from experiments.tracking.figure_notes import file_change, read_note
from paper_figures.report import (
    claim_1,
    claim_2,
    claim_3,
    claim_4,
    claim_5,
    claim_6,
    section_areas,
    section_baselines,
    section_beliefs,
    section_cells,
    section_choices,
    section_chosen_tasks,
    section_control_noise,
    section_controls,
    section_costs,
    section_dynamics,
    section_evidence,
    section_origin,
    section_readings,
    section_rule_breaking,
    section_sampled,
    section_soft,
    section_start_points,
    section_transfer,
    section_wrong_model,
)
from paper_figures.report.earlier import changes
from paper_figures.report.markdown import contents, figure, table, without_markup
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
    (claim_1.claim, ()),
    (
        claim_2.claim,
        (
            Figure(
                "paper",
                "final_state_error",
                "Final-state error; see the paper's Fig. 3.",
            ),
        ),
    ),
    (
        claim_3.claim,
        (
            Figure(
                "paper",
                "violation_distance",
                "Violation distance; see the paper's Fig. 4.",
            ),
        ),
    ),
    (
        claim_4.claim,
        (
            Figure(
                "paper",
                "rank_curve",
                "Rank of the truth; compare the paper's Fig. 5.",
            ),
        ),
    ),
    (claim_5.claim, ()),
    (
        claim_6.claim,
        (
            Figure(
                "telescope",
                "success_pain",
                "How often the telescoping pendulum's truth is found; compare the paper's Fig. 7.",
            ),
            Figure(
                "telescope",
                "success_cases_pain",
                "One choice changed at a time, and success against evidence.",
            ),
            Figure(
                "next_task_telescope",
                "early_overlap",
                "What the answer after five demonstrations overlaps, chosen and random tasks.",
            ),
        ),
    ),
)

# What follows the claims: a heading, what writes it, and its figures.
SECTIONS: tuple[tuple[str, Callable[[Results], str], tuple[Figure, ...]], ...] = (
    (
        "Sensitivity to what the paper leaves open",
        section_choices.section,
        (
            Figure("sensitivity", "choice_effects_c1", "One choice changed at a time, truth C1."),
            Figure("sensitivity", "choice_effects_c2", "One choice changed at a time, truth C2."),
        ),
    ),
    ("Control noise: how much of claims 2 and 3 it explains", section_control_noise.section, ()),
    (
        "Readings of the paper: claims 1 and 4 together",
        section_readings.section,
        (Figure("readings", "readings", "Pairs kept, and truths found, under each reading."),),
    ),
    (
        "Demonstrators who ignore the constraint",
        section_rule_breaking.section,
        (Figure("rule_breaking", "rule_breaking", "Rank of the truth where some break the rule."),),
    ),
    (
        "Demonstrators who are not the nominal model",
        section_wrong_model.section,
        (
            Figure(
                "wrong_model", "wrong_model", "What a wrong model of demonstrators does to answers."
            ),
        ),
    ),
    (
        "Areas: truths that are larger than any hypothesis",
        section_areas.section,
        (Figure("areas", "area_cover", "How well sets of hypotheses cover two ellipses."),),
    ),
    (
        "Soft or hard?",
        section_soft.section,
        (Figure("soft", "soft_weights", "Weights of soft constraints: estimate against truth."),),
    ),
    (
        "Failure set or tube?",
        section_transfer.section,
        (
            Figure(
                "transfer", "transfer", "A region, its tubes, and who is let in at other strengths."
            ),
        ),
    ),
    (
        "A joint that will not push",
        section_controls.section,
        (
            Figure(
                "control_limits",
                "control_limits",
                "Limits of controls: found where there are some, and imagined where not.",
            ),
        ),
    ),
    (
        "Cells of varying size",
        section_cells.section,
        (Figure("cells", "cell_errors", "Error of Phi against the number of cells."),),
    ),
    (
        "Calibration of the posterior",
        section_beliefs.section,
        (Figure("calibration", "calibration_diagram", "Share that is right against probability."),),
    ),
    (
        "Evidence, and forecasts that come true",
        section_evidence.section,
        (Figure("calibration", "forecast_diagram", "Share that is crossed against its forecast."),),
    ),
    (
        "Other ways to rank regions",
        section_baselines.section,
        (Figure("baselines", "baselines", "Rank of the truth by six methods."),),
    ),
    (
        "Which dynamics it works for",
        section_dynamics.section,
        (Figure("dynamics", "dynamics", "Success by system, and whether it can be foretold."),),
    ),
    (
        "What to record next",
        section_chosen_tasks.section,
        (Figure("next_task", "chosen_tasks", "Who has not found the truth yet, task after task."),),
    ),
    (
        "With and without a grid",
        section_sampled.section,
        (Figure("sampled", "sampled_models", "Sampled paths beside cells."),),
    ),
    (
        "In-cell sampling at 100 cells",
        section_start_points.section,
        (
            Figure(
                "in_cell", "start_points", "100 cells with 1 and 3 start points along a dimension."
            ),
        ),
    ),
    (
        "Time and memory",
        section_costs.section,
        (Figure("benchmark", "time_and_memory", "Time and memory against the number of states."),),
    ),
    ("Where the numbers come from", section_origin.section, ()),
)

_INTRODUCTION = """\
# The paper's claims, checked

What Stocking, McPherson, Matthew and Tomlin, *Discretizing Dynamics for Maximum Likelihood
Constraint Inference*, claim, beside what the tables of this repository say. Every number here, and
every verdict, is computed from those tables by `python -m paper_figures.report`; `make paper`
runs whatever is missing and then writes this file.

Values in brackets are 95 % intervals. For means and shares they come from a two-level bootstrap:
seeds are resampled, and within each seed its demonstrations (for ranks, random subsets of them), as
`experiments/collate/intervals.py` explains. Settings with one seed have intervals of the second
level alone, which are too narrow where ranks are concerned. Errors are shares of the ranges of the
state space, violation distances are numbers of regions, ranks start at 1, and dt is in seconds.
"""


def report(results: Results) -> str:
    """The report of a folder of results."""
    parts: list[tuple[str, str]] = []
    claims, numbers = _claims(results), itertools.count(1)
    for number, (claim, (_, figures)) in enumerate(zip(claims, CLAIMS, strict=True), start=1):
        if isinstance(claim, Missing):
            parts.append((f"Claim {number}", absent(claim)))
        else:
            text = f"{claim.markdown()}\n{_figures(results, figures, numbers)}"
            parts.append((f"Claim {number}: {claim.title}", text))
    for heading, section, figures in SECTIONS:
        try:
            text = f"{section(results)}\n{_figures(results, figures, numbers)}"
        except Missing as missing:
            text = absent(missing)
        parts.append((heading, text))
    verdicts = ("Verdicts", f"{_verdicts(claims)}\n{RULES}\n{changes(claims)}")
    lines = [_INTRODUCTION, contents(heading for heading, _ in (verdicts, *parts))]
    lines += [f"## {heading}\n\n{text}" for heading, text in (verdicts, *parts)]
    return without_markup("\n".join(line.rstrip("\n") + "\n" for line in lines))


def _claims(results: Results) -> list[Claim | Missing]:
    """Each claim, or what is missing for it."""
    claims: list[Claim | Missing] = []
    for write, _ in CLAIMS:
        try:
            claims.append(write(results))
        except Missing as missing:
            claims.append(missing)
    return claims


def _verdicts(claims: Sequence[Claim | Missing]) -> str:
    """All claims with their verdicts, as a table."""
    rows: list[list[object]] = []
    for number, claim in enumerate(claims, start=1):
        if isinstance(claim, Missing):
            rows.append([number, "-", "not there yet", claim])
            continue
        counts = [f"{part.statement}: {part.holding} of {len(part.checks)}" for part in claim.parts]
        rows.append([number, claim.title, f"**{claim.verdict}**", "; ".join(counts)])
    return table(
        ["claim", "about", "verdict", "its parts, and in how many settings"], rows, words=4
    )


def _figures(results: Results, figures: tuple[Figure, ...], numbers: Iterator[int]) -> str:
    """Those figures that are drawn, with the next numbers and paths from the report's folder."""
    lines = []
    for entry in figures:
        file = f"{entry.name}.png"
        note = read_note(results.folder / entry.study).get(entry.name)
        if note is None:
            lines.append(f"The figure `{entry.name}` is not drawn yet; `make figures` does it.\n")
            continue
        path = results.folder / entry.study / "figures" / file
        if change := file_change(path, note["files"].get(file, ""), "drawn"):
            results.damage.append(f"{path.parent}: {change}; `make figures` draws it anew")
            lines.append(f"The figure `{entry.name}` is not as it was drawn; see `make figures`.\n")
            continue
        results.digests[f"{entry.study}/figures/{file}"] = note["files"][file]
        inside = f"figures/{file}"
        relative = inside if entry.study == FOLDER else f"../{entry.study}/{inside}"
        lines.append(figure(relative, next(numbers), entry.caption))
    return "\n".join(lines)
