"""Kinds of evidence of one world, each against the inference that it is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point import evidence_kinds
from experiments.point.evidence_kinds import evidence_table
from experiments.point.inference import PointInference, infer_point
from experiments.tracking.store import Store
from mlci.evidence import PAPER, Rates
from mlci.inference import Inference
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
def test_each_kind_is_an_inference(kind: str, table: pd.DataFrame, point: PointInference) -> None:
    whole = inferred(point, kind)
    rows = table[table["evidence"] == kind]
    sets = {count: len(point.demonstrations) // count for count in (2, 3)}
    assert min(sets.values()) >= 2
    assert len(rows) == sum(sets.values())
    assert rows.loc[rows["demonstrations"] == 2, "best"].nunique() >= 2  # sets are told apart
    for _, row in rows.iterrows():
        count = row["demonstrations"]
        part = whole.of(slice(count * row["set"], count * (row["set"] + 1)))
        best = int(part.order[0])
        assert row["best"] == pytest.approx(part.posterior[best])
        assert row["right"] == (best == 6)
        assert row["of_truth"] == pytest.approx(part.posterior[6])
        assert row["top"] == (part.ranking.rank[6] <= 5)
        assert row["feasible"] == part.ranking.feasible.sum()
        assert (row["prior"], row["sets"]) == (0.5 / 10, sets[count])


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
    first = table[(table["set"] == 0) & (table["demonstrations"] == 2)]
    pd.testing.assert_frame_equal(
        small.drop(columns="sets"), first.drop(columns="sets").reset_index(drop=True)
    )
    assert set(small["sets"]) == {1}
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
    for _, row in nothing.iterrows():
        count, number = row["demonstrations"], row["set"]
        part = dataclasses.replace(inference, rates=PAPER, calibration=None).of(
            slice(count * number, count * (number + 1))
        )
        assert row["of_truth"] == pytest.approx(part.posterior_none)
        assert row["right"] == 0


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
        assert set(evidence_table(changed, point, point.calibration)["top"]) == {is_in}
