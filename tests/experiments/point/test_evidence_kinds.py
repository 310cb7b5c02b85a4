"""Kinds of evidence of one world, each against the inference that it is."""

from __future__ import annotations

import dataclasses
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point import evidence_kinds
from experiments.point.belief_counts import EDGES
from experiments.point.evidence_kinds import SETS, evidence_table
from experiments.point.inference import PointInference, infer_point
from experiments.point.streams import Purpose, stream
from experiments.tracking.store import Store
from mlci.evidence import PAPER, Rates
from mlci.inference import Inference
from mlci.metrics import random_subsets
from mlci.preparation import infer

WORLD = [
    *("system=double_integrator", "truth=cell", "truth.cell=6", "inference=calibrated"),
    *("demonstrations.pairs=12", "demonstrations.keep=8", "calibration.sets=1"),
    *("calibration.demonstrations=[2,3]", "tasks.lower=[-2.0,-1.0]", "tasks.upper=[2.0,1.0]"),
]


@pytest.fixture(scope="module")
def settings() -> Settings:
    tiny = [
        word for word in TINY if not word.startswith(("truth", "inference", "demonstrations.p"))
    ]
    return read_config(composed(*(word for word in tiny if "keep" not in word), *WORLD))[0]


@pytest.fixture(scope="module")
def point(settings: Settings, tmp_path_factory: pytest.TempPathFactory) -> PointInference:
    return infer_point(settings, Store(tmp_path_factory.mktemp("store")))


@pytest.fixture(scope="module")
def table(settings: Settings, point: PointInference) -> pd.DataFrame:
    assert point.calibration is not None
    return evidence_table(settings, point, point.calibration)


def inferred(point: PointInference, kind: str) -> Inference:
    """The inference of a kind, from the library."""
    exact = kind != "paper"
    rate = float(kind.rpartition(" ")[2]) if kind.startswith("model error") else 0.0
    calibrated = kind == "calibrated" and point.calibration is not None
    return infer(
        point.model,
        point.demonstrations,
        hypotheses=point.hypotheses,
        rates=Rates(rate) if rate else PAPER,
        calibration=point.calibration.map if calibrated and point.calibration else None,
        exact_ends=exact,
        tolerance=np.inf,
    )


@pytest.mark.parametrize(
    "kind",
    ["paper", "exact ends", "model error 0.05", "model error 0.1", "model error 0.2", "calibrated"],
)
def test_each_kind_is_an_inference(
    kind: str, table: pd.DataFrame, point: PointInference, settings: Settings
) -> None:
    whole, numbers = inferred(point, kind), len(point.demonstrations)
    subsets = random_subsets(numbers, 3, SETS, stream(settings.seed, Purpose.EVIDENCE, 7))
    rows = table[table["evidence"] == kind]
    assert (rows["prior"] == 0.5 / 10).all()
    assert (rows["sets"] == SETS).all()
    assert (rows["best"] / rows["count"]).nunique() >= 2  # sets are told apart
    for size in (2, 3):
        sums: dict[int, np.ndarray] = {}
        for subset in subsets[size - 1]:
            part = whole.of(subset)
            best = int(part.order[0])
            place = min(int(np.searchsorted(EDGES, part.posterior[best], side="right")), 11)
            log_truth = np.log(max(part.posterior[6], 1e-10))
            values = [1, part.posterior[best], best == 6, log_truth, part.ranking.rank[6] <= 5]
            sums[place] = sums.get(place, 0.0) + np.array(values, dtype=float)
        found = rows[rows["demonstrations"] == size].set_index("bin")
        found = found[["count", "best", "right", "log_truth", "top"]]
        assert found.index.tolist() == sorted(sums)
        for place, expected in sums.items():
            assert found.loc[place].to_numpy() == pytest.approx(expected)


def test_the_mean_over_random_sets_estimates_that_over_all(
    table: pd.DataFrame, point: PointInference
) -> None:
    whole = inferred(point, "exact ends")
    every = [whole.of(pair) for pair in combinations(range(len(point.demonstrations)), 2)]
    for name, value in (
        ("best", [np.max(part.posterior) for part in every]),
        ("log_truth", [np.log(max(part.posterior[6], 1e-10)) for part in every]),
    ):
        rows = table[(table["evidence"] == "exact ends") & (table["demonstrations"] == 2)]
        assert np.std(value) > 0
        error = np.std(value) / np.sqrt(SETS)
        assert abs(rows[name].sum() / SETS - np.mean(value)) < 4 * error


def test_a_world_has_no_sets_that_are_larger_than_it(
    settings: Settings, point: PointInference, table: pd.DataFrame
) -> None:
    assert point.calibration is not None
    two, one = (
        dataclasses.replace(
            point,
            demonstrations=point.demonstrations[:count],
            inference=point.inference.of(slice(count)),
        )
        for count in (2, 1)
    )
    small = evidence_table(settings, two, point.calibration)
    assert set(small["demonstrations"]) == {2}
    assert (small["count"] == SETS).all()  # the one set that there is
    nothing = evidence_table(settings, one, point.calibration)
    assert nothing.empty
    assert list(nothing.columns) == list(table.columns)


def test_the_prior_is_that_of_what_is_true(settings: Settings, point: PointInference) -> None:
    """Of a hypothesis or of nothing, which are as probable as each other at one prior only."""
    assert point.calibration is not None
    inference = dataclasses.replace(point.inference, prior_none=0.3)
    point = dataclasses.replace(point, inference=inference)
    assert evidence_table(settings, point, point.calibration)["prior"].unique() == pytest.approx(
        0.7 / 10
    )
    truth = dataclasses.replace(settings.truth, cell=None)
    nothing = evidence_table(
        dataclasses.replace(settings, truth=truth), point, point.calibration
    ).query("evidence == 'exact ends'")
    assert nothing["prior"].unique() == pytest.approx(0.3)
    assert nothing["top"].isna().all()
    assert (nothing["right"] == 0).all()
    whole = dataclasses.replace(inference, rates=PAPER, calibration=None)
    subsets = random_subsets(len(inference.names), 3, SETS, stream(0, Purpose.EVIDENCE, 0))
    for size in (2, 3):
        expected = [np.log(whole.of(subset).posterior_none) for subset in subsets[size - 1]]
        found = nothing.loc[nothing["demonstrations"] == size, "log_truth"]
        assert found.sum() == pytest.approx(sum(expected))


def test_a_rank_of_just_the_last_place_is_in_the_top(
    settings: Settings, point: PointInference, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hypothesis 6 is the seventh where evidence falls with the number."""
    assert point.calibration is not None
    shape = point.inference.violated.shape
    by_hand = dataclasses.replace(
        point.inference,
        avoidance=np.broadcast_to(np.linspace(0.1, 0.9, shape[1]), shape),
        violated=np.zeros(shape, dtype=bool),
        rates=PAPER,
        calibration=None,
    )
    monkeypatch.setattr(evidence_kinds, "_kinds", lambda *_: {"by hand": by_hand})
    for top, is_in in ((7, 1), (6, 0)):
        ranks = dataclasses.replace(settings.ranks, top=top)
        changed = dataclasses.replace(settings, ranks=ranks)
        table = evidence_table(changed, point, point.calibration)
        assert (table["top"] == table["count"] * is_in).all()
