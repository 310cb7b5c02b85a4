"""Where the numbers come from: studies, points, versions of the source, machines."""

from __future__ import annotations

import hashlib

from paper_figures.report.markdown import table
from paper_figures.report.study_tables import Missing, Results, command


def costs(results: Results) -> str:
    """A line for each study: how many points, their time and memory.

    Raises:
        Missing: there is no study.
    """
    rows = []
    for study in results.studies():
        try:
            listed = results.listing(study)
        except Missing:
            continue
        points, seconds = len(listed["points"]), listed["seconds"]
        memory = f"{listed['peak_memory_mb']} MB"
        rows.append([study, points, f"{seconds:.0f} s", f"{seconds / points:.1f} s", memory])
    if not rows:
        raise Missing("paper", "no study is there yet")
    return table(["study", "points", "all points", "a point", "most memory of one"], rows)


def section(results: Results) -> str:
    """A line for each study with tables, then their machines and packages.

    Raises:
        Missing: there is no study.
    """
    rows, machines, versions = [], set[str](), set[str]()
    for study in results.studies():
        try:
            listed = results.listing(study)
        except Missing:
            continue
        points = listed["points"]
        started = [moment[:16].replace("T", " ") for moment in listed["started"]]
        rows.append(
            [
                study,
                len(points),
                f"`{hashlib.sha256(chr(10).join(points).encode()).hexdigest()[:12]}`",
                ", ".join(f"`{source[:12]}`" for source in listed["sources"]),
                ", ".join(f"`{commit[:12]}`" for commit in listed["commits"]) or "unknown",
                "yes" if listed["dirty"] else "no",
                f"{started[0]} to {started[1]}",
                f"{listed['seconds']:.0f} s",
                f"{listed['peak_memory_mb']} MB",
                f"`{command(study)}`",
            ]
        )
        machines.update(listed["machines"])
        versions.update(listed["versions"])
    if not rows:
        raise Missing("paper", "no study is there yet")
    head = [
        "study",
        "points",
        "digest of their identities",
        "source",
        "git commit",
        "changed since",
    ]
    head += ["run (UTC)", "time of all points", "most memory of one", "command"]
    return (
        "All numbers above are read from tables in `results/`; `python experiments/results.py "
        "status` tells whether they and the figures are those of the points and of the code of "
        "now. "
        "`study.json` beside each study's tables has the full lists and digests.\n\n"
        + table(head, rows, words=len(head))
        + f"\nMachines: {'; '.join(sorted(machines))}.\n"
        + f"\nVersions: {'; '.join(sorted(versions))}.\n"
    )
