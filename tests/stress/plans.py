"""Every study of conf/experiment, planned at full size: each combination is a point, and another.

The config of a point is the one that Hydra itself composes: for so many points of each study that
each of its swept values stands in one of them; with `plans.py --all` for every point.

Run by `make stress`; ends with an error at the first study whose plan is not as it must be.
"""

from __future__ import annotations

import re
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

import joblib
from commands import run_here
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.types import RunMode

from experiments import run
from experiments.app import version_base
from experiments.config.paths import CONF
from experiments.config.read import plain_tree
from experiments.sweep.combinations import Combinations
from experiments.sweep.composer import Composer


def main() -> None:
    """Plan all studies, on half of the cores."""
    studies = sorted(path.stem for path in CONF.glob("experiment/*.yaml"))
    half = max(1, joblib.cpu_count() // 2)  # `make stress` runs two files at a time
    for line in joblib.Parallel(n_jobs=half, batch_size=1)(map(joblib.delayed(check), studies)):
        print(line, flush=True)


def check(study: str) -> str:
    """Plan a study and compose its points; returns what its sweep says first."""
    with tempfile.TemporaryDirectory() as folder:
        words = ["-m", f"experiment={study}", "sweep.dry_run=true", f"results={folder}/r"]
        done = run_here(run.main, *words, folder=Path(folder))
    assert done.returncode == 0, f"{study}: {done.stderr}"
    first, *others = done.stdout.splitlines()
    assert re.fullmatch(r"(\d+) points?: \1 missing; \1 to run", first), f"{study}: {first}"
    assert "repeat others" not in done.stdout, f"{study}: {others[0]}"
    assert "stand for all of" not in done.stdout or study == "smoke", f"{study}: {others}"
    compare_with_hydra(study)
    return f"{study}: {first}"


def compare_with_hydra(study: str) -> None:
    """Compose points of a study in both ways."""
    with initialize_config_dir(str(CONF), **version_base()):
        loader = GlobalHydra.instance().config_loader()
        words = [f"experiment={study}"]
        base = loader.load_configuration("config", words, RunMode.MULTIRUN)
        swept = {key: base.hydra.sweeper.get(key) for key in ("params", "settings", "cases")}
        composer = Composer(loader, base)
        parser = OverridesParser.create(config_loader=loader)
        jobs = Combinations(**swept).overrides(words, parser)
        for job in jobs if "--all" in sys.argv else with_new_values(jobs):
            ours, theirs = composer.tree(job), plain_tree(loader.load_sweep_config(base, job))
            assert ours == theirs, f"{study}: {job}"


def with_new_values(jobs: Iterable[Sequence[str]]) -> Iterator[Sequence[str]]:
    """The jobs in which an override stands that did not in those before."""
    met: set[str] = set()
    for job in jobs:
        if not met.issuperset(job):
            met.update(job)
            yield job


if __name__ == "__main__":
    main()
