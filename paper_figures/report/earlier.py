"""Which verdicts differ from those of version 0.1.0, whose report was the first."""

from __future__ import annotations

from collections.abc import Sequence

from paper_figures.report.study_tables import Missing
from paper_figures.report.verdict import Claim, Verdict

FIRST = "0.1.0"
# Each claim's verdict there, and of each part in how many settings it held.
VERDICTS = {
    "Pairs that become demonstrations": Verdict.NOT,
    "Final-state error": Verdict.PARTLY,
    "Violation distance": Verdict.PARTLY,
    "Rank of the truth": Verdict.PARTLY,
    "Number of actions": Verdict.PARTLY,
    "Telescoping inverted pendulum": Verdict.PARTLY,
}
HOLDING = {
    "65 of 100 pairs are kept": (0, 2),
    "less error with more cells": (10, 10),
    "little gain past 900 cells": (4, 10),
    "less error with larger dt": (8, 8),
    "lower at 400 cells than at 100": (5, 10),
    "little change beyond 400 cells": (12, 20),
    "flat in dt": (4, 6),
    "found with every number of cells at some dt": (8, 8),
    "100 cells at dt 0.2 s fail": (2, 2),
    "because most moves stay in their cell": (0, 2),
    "found with 400 cells or more at every dt": (28, 30),
    "final-state error": (69, 80),
    "violation distance": (66, 80),
    "median rank after 9 demonstrations": (74, 80),
    "share in the top 5 after 9": (69, 80),
    "the best two overlap the truth after 5 demonstrations of random tasks": (0, 9),
    "the best two overlap the truth after 5 demonstrations of tasks that cross the truth": (6, 9),
    "the best two lie inside the truth after 5 demonstrations of random tasks": (0, 9),
    "the best two lie inside the truth after 5 demonstrations of tasks that cross the truth": (
        1,
        9,
    ),
    "about 5 minutes on one core": (1, 1),
}
_WHY = (
    "Claims are checked with the paper's evidence, as then. What has changed since are the "
    "demonstrations: safe sets keep their border within half a cell (0.3.0), so that starts, goals "
    "and detours lie elsewhere, and restarts that cost the same but for rounding are one (0.4.0); "
    "and ranks, as gains that differ by rounding alone tie (0.4.0)."
)


def changes(claims: Sequence[Claim | Missing]) -> str:
    """Verdicts and numbers of settings that differ from the first report's, and why."""
    verdicts, settings = [], []
    for number, claim in enumerate(claims, start=1):
        if isinstance(claim, Missing):
            continue
        before = VERDICTS.get(claim.title, claim.verdict)
        if before != claim.verdict:
            verdicts.append(f"claim {number}, {before} to {claim.verdict}")
        for part in claim.parts:
            now = part.holding, len(part.checks)
            then = HOLDING.get(part.statement, now)
            if then != now:
                settings.append(
                    f"{part.statement} ({then[0]} of {then[1]} to {now[0]} of {now[1]})"
                )
    if not settings:
        return f"No verdict differs from version {FIRST}'s, nor does a number of settings.\n"
    differing = "; ".join(verdicts) if verdicts else "none"
    return (
        f"Verdicts that differ from version {FIRST}'s: {differing}. Numbers of settings that do: "
        f"{'; '.join(settings)}. {_WHY}\n"
    )
