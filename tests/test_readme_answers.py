"""The READMEs' examples give sensible answers: what is in the way is first, and not for sure."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import run_here

from experiments import run
from mlci.inference import Inference

ROOT = Path(__file__).resolve().parents[1]
# Fewer trials than by default, and a coarser safe set.
SMALLER = [
    "demonstrations.pairs=70",
    "demonstrations.restarts=1",
    "demonstrations.keep=65",
    "safety.shape=[21,21,12]",
    "ranks.demonstrations=1",
    "ranks.subsets=1",
    "rollouts=1",
]


def blocks(readme: str, language: str) -> list[str]:
    """The blocks of a language in a README."""
    text = (ROOT / readme).read_text()
    return re.findall(rf"^```{language}\n(.*?)^```", text, flags=re.MULTILINE | re.DOTALL)


def inferred(block: str) -> Inference:
    """What a block of Python infers."""
    names: dict[str, object] = {}
    exec(block, names)
    inference = names["inference"]
    assert isinstance(inference, Inference)
    return inference


def assert_sensible(inference: Inference) -> None:
    """One or two demonstrations rank something first, and make nothing certain."""
    assert 1 < inference.gain[inference.order[0]] < 10
    assert not np.any(inference.gain == np.inf)
    assert 0.05 < inference.posterior_none < 0.5


def test_two_paths_around_something_make_it_first() -> None:
    """The robot's way would lead through the cells beside the middle; both paths go round them."""
    inference = inferred(blocks("mlci/README.md", "python")[0])
    assert_sensible(inference)
    assert [inference.hypotheses.names[i] for i in inference.order[:2]] == ["15", "21"]


def test_a_pendulum_that_goes_the_long_way_avoids_what_is_on_the_short_one() -> None:
    """The first five: angles from 0.5 to 3, on the way up."""
    (block,) = [each for each in blocks("mlci/README.md", "python") if "mlci.prepare(" in each]
    inference = inferred(block)
    assert_sensible(inference)
    first = inference.order[:5]
    lower, upper = inference.hypotheses.lower[first], inference.hypotheses.upper[first]
    assert np.all((upper[:, 0] > 0.5) & (lower[:, 0] < 3.0))
    assert np.all(lower[:, 1] >= 0)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with the forklift's module and config."""
    (module,) = [block for block in blocks("conf/README.md", "python") if "Forklift" in block]
    (tmp_path / "forklift.py").write_text(module)
    (config,) = [block for block in blocks("conf/README.md", "yaml") if "forklift" in block]
    (tmp_path / "conf" / "subject").mkdir(parents=True)
    (tmp_path / "conf" / "subject" / "forklift.yaml").write_text(config)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("forklift", None)


@pytest.mark.long
def test_the_forklifts_pillar_is_first(folder: Path) -> None:
    """A region of the pillar comes first with a finite gain, and nothing is certain."""
    words = ["subject=forklift", f"results={folder / 'results'}", *SMALLER]
    done = run_here(run.main, *words, folder=folder)
    assert done.returncode == 0, done.stderr
    (point,) = (folder / "results" / "points").iterdir()
    table = pd.read_csv(point / "hypotheses.csv").sort_values(["rank", "hypothesis"])
    assert table["covered_by_truth"].sum() == 4
    best = table.iloc[0]
    assert best["covered_by_truth"]
    assert 1 < best["gain"] < 20
    assert table["posterior"].max() < 0.99
    assert "(truth)" in done.stdout
