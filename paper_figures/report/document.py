"""The whole report as Markdown: claims, then what the paper left open, then where it comes from."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

from experiments.tracking.figure_notes import file_change, read_note
from paper_figures.report.chapters import CLAIMS, SECTIONS, Figure
from paper_figures.report.earlier import changes
from paper_figures.report.markdown import contents, figure, table, without_markup
from paper_figures.report.study_tables import Missing, Results, absent
from paper_figures.report.verdict import RULES, Claim

FOLDER = "paper"  # the study whose folder holds the report


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
