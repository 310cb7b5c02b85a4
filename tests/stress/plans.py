"""Every study of conf/experiment, planned at full size: each combination is a point, and another.

Run by `make stress`; ends with an error at the first study whose plan is not as it must be.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

from commands import run_here

from experiments import run
from experiments.config.paths import CONF


def main() -> None:
    """Plan all studies."""
    for path in sorted(CONF.glob("experiment/*.yaml")):
        with tempfile.TemporaryDirectory() as folder:
            words = ["-m", f"experiment={path.stem}", "sweep.dry_run=true", f"results={folder}/r"]
            done = run_here(run.main, *words, folder=Path(folder))
        assert done.returncode == 0, f"{path}: {done.stderr}"
        first, *others = done.stdout.splitlines()
        assert re.fullmatch(r"(\d+) points: \1 missing; \1 to run", first), f"{path}: {first}"
        assert "repeat others" not in done.stdout, f"{path}: {others[0]}"
        assert "stand for all of" not in done.stdout or path.stem == "smoke", f"{path}: {others}"
        print(f"{path.stem}: {first}", flush=True)


if __name__ == "__main__":
    main()
