"""Where the numbers come from: studies, points, versions of the source, machines."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any

from paper_figures.report.markdown import table
from paper_figures.report.study_tables import Missing, Results, command

_HEAD = (
    "study",
    "points",
    "digest of their identities",
    "source",
    "git commit",
    "changed since",
    "run (UTC)",
    "time of all points",
    "a point",
    "most memory of one",
    "command",
)


def section(results: Results) -> str:
    """A line for each study with tables, then their machines and packages.

    Raises:
        Missing: there is no study.
    """
    listings = _listings(results)
    if not listings:
        raise Missing("paper", "no study is there yet")
    rows = [_row(study, listing) for study, listing in listings.items()]
    machines, versions = (
        "; ".join(sorted({name for listing in listings.values() for name in listing[key]}))
        for key in ("machines", "versions")
    )
    return (
        "All numbers above are read from tables in `results/`; `python experiments/results.py "
        "status` tells whether they and the figures are those of the points and of the code of "
        "now. `study.json` beside each study's tables has the full lists and digests. Times are "
        "those of single points added up, so several cores need less.\n\n"
        + table(_HEAD, rows, words=len(_HEAD))
        + f"\nMachines: {machines}.\n\nVersions: {versions}.\n"
    )


def _listings(results: Results) -> dict[str, dict[str, Any]]:
    """What the tables of each study that tells came from."""
    listings = {}
    for study in results.studies():
        try:
            listings[study] = results.listing(study)
        except Missing:
            continue
    return listings


def _row(study: str, listing: Mapping[str, Any]) -> list[object]:
    """The line of a study."""
    points, seconds = listing["points"], listing["seconds"]
    first, last = (moment[:16].replace("T", " ") for moment in listing["started"])
    return [
        study,
        len(points),
        f"`{hashlib.sha256(chr(10).join(points).encode()).hexdigest()[:12]}`",
        ", ".join(f"`{source[:12]}`" for source in listing["sources"]),
        ", ".join(f"`{commit[:12]}`" for commit in listing["commits"]) or "unknown",
        "yes" if listing["dirty"] else "no",
        f"{first} to {last}",
        f"{seconds:.0f} s",
        f"{seconds / len(points):.1f} s",
        f"{listing['peak_memory_mb']} MB",
        f"`{command(study)}`",
    ]
