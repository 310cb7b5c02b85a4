"""What the report consists of, in its order: claims and sections, each with its figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from paper_figures.report import (
    claim_1,
    claim_2,
    claim_3,
    claim_4,
    claim_5,
    claim_6,
    section_areas,
    section_arms,
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
from paper_figures.report.study_tables import Results
from paper_figures.report.verdict import Claim


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
        "Cells of varying size in four dimensions",
        section_cells.telescope_section,
        (
            Figure(
                "cells_telescope",
                "cell_errors",
                "Error of Phi of the telescoping pendulum against the number of cells.",
            ),
        ),
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
        "Arms and bodies",
        section_arms.section,
        (
            Figure("arms", "arms", "How often the truth is found, and what comes true."),
            Figure("dimensions", "dimensions", "Time and memory from 2 to 12 dimensions."),
        ),
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
