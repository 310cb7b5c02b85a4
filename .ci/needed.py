"""The part of requirements.lock that running needs: python .ci/needed.py [EXTRA ...]

Prints the entries of the project's dependencies, of the named extras, and of all that these depend
on, as the lock file's comments tell; hashes and markers stay.
"""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def needed(lock: str, project: dict[str, object], extras: list[str]) -> str:
    """The entries of a lock file that dependencies and extras of a project need."""
    optional = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(line for extra in extras for line in optional[extra])]
    names = {re.split(r"[^\w.-]", line)[0].lower().replace("_", "-") for line in wanted}
    entries = re.findall(r"^[\w.-]+==.*\n(?:[ #].*\n)*", lock, re.MULTILINE)
    users = {  # of each package, by its entry's comments
        entry.partition("==")[0]: set(
            re.findall(r"^    #(?: via|  ) +([\w.-]+)$", entry, re.MULTILINE)
        )
        for entry in entries
    }
    while more := {name for name in users if name not in names and users[name] & names}:
        names |= more
    if unknown := names - users.keys():
        sys.exit(f"requirements.lock lacks {', '.join(sorted(unknown))}: run make lock")
    return "".join(entry for entry in entries if entry.partition("==")[0] in names)


if __name__ == "__main__":
    with open(ROOT / "pyproject.toml", "rb") as file:
        tables = tomllib.load(file)
    print(needed((ROOT / "requirements.lock").read_text(), tables["project"], sys.argv[1:]), end="")
