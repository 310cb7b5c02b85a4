"""A point's tables of sets, beside its ranking."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tiny_point import TINY, composed

from experiments.config.read import read_config
from experiments.point.run import run_point
from experiments.tracking.store import Store


def run(folder: Path, *words: str) -> tuple[dict, list[str]]:
    settings, lines = read_config(composed(*TINY, *words))[0], []
    return run_point(settings, Store(folder), lines.append), lines


def test_no_tables_where_nothing_is_asked(tmp_path: Path) -> None:
    tables, lines = run(tmp_path)
    assert not {"sets", "set_marginals"} & set(tables)
    assert not any(line.startswith("sets") for line in lines)


def test_sets_of_one_are_the_ranking(tmp_path: Path) -> None:
    """Where one hypothesis at most may be forbidden, marginals are the posterior."""
    tables, lines = run(tmp_path, "inference.sets.largest=1")
    posterior = tables["hypotheses"]["posterior"]
    np.testing.assert_allclose(tables["set_marginals"]["marginal"], posterior, atol=1e-12)
    assert any(line.startswith("sets") for line in lines)


@pytest.mark.parametrize("more", [[], ["inference.sets.adjacency=1.0"]])
def test_tables_of_sets_agree(tmp_path: Path, more: list[str]) -> None:
    tables, _ = run(tmp_path, "inference.sets.largest=4", *more)
    sets, marginals = tables["sets"], tables["set_marginals"]
    assert sets["probability"].sum() == pytest.approx(1)
    assert sets["probability"].is_monotonic_decreasing
    for number, marginal in zip(marginals["hypothesis"], marginals["marginal"], strict=True):
        has = [str(number) in names.split(", ") for names in sets["hypotheses"]]
        assert sets["probability"][has].sum() == pytest.approx(marginal, abs=1e-12)
    assert (
        sets["size"] == [len([n for n in s.split(", ") if n]) for s in sets["hypotheses"]]
    ).all()
    assert (marginals["standard_error"] == 0).all()
    again, _ = run(tmp_path, "inference.sets.largest=4", *more)
    assert again["sets"].equals(sets)
