"""What the points of a study are instances of, in the words of the study's own file.

A case of `hydra.sweeper.cases` has a name, which its points get as `case='temperature: 0.5'`. The
name changes no result and is no part of a point's identity; it is read from the study's plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.collate.finished import LAST_OPENING

if TYPE_CHECKING:
    import pandas as pd


def case_names(plan: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """The case of each point that has one, in the order of the plan.

    Args:
        plan: the overrides that make each point, by its identity, as the study lists them.
    """
    names = {}
    for point, overrides in plan.items():
        cases = [word.partition("=")[2] for word in overrides if word.startswith("case=")]
        if cases and (name := cases[-1].strip("'\"")):
            names[point] = name
    return names


def case_table(
    summary: Path, points: Sequence[str], names: Mapping[str, str]
) -> pd.DataFrame | None:
    """The names of a study's cases, for joining with its tables of groups.

    Args:
        summary: the collated table of that name, a row a point.
        points: identities, in the order of those rows.
        names: the case of each point that has one, in the order of the plan.

    Returns:
        The columns that open those tables (all but `seed`), a row a group, the cases in the order
        of the plan; `case`, its name; `choice` and `value`, the parts of the name before and after
        its colon. None if no point has a name.
    """
    if not any(point in names for point in points):
        return None
    import pandas as pd

    rows = pd.read_csv(summary, dtype=str, keep_default_na=False)
    rows = rows[list(rows.columns[: rows.columns.get_loc(LAST_OPENING)])]
    cases = [names.get(point, "") for point in points]
    parts = [name.partition(": ") for name in cases]
    rows = rows.assign(
        case=cases, choice=[part[0] for part in parts], value=[part[2] for part in parts]
    )
    rows = rows[rows["case"] != ""].drop_duplicates()
    place = {name: i for i, name in enumerate(dict.fromkeys(names.values()))}
    return rows.sort_values("case", key=lambda case: case.map(place), kind="stable")
