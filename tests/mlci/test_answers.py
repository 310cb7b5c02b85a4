"""What is said of an inference: on a model of a floor, and on inferences made by hand."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from mlci.answers import Answer, answer, cut_by, unseen
from mlci.demonstrations import Demonstration
from mlci.evidence import Rates
from mlci.grids import Grid
from mlci.inference import Inference
from mlci.preparation import infer
from mlci.regions import Regions
from mlci.soft.weight import WeightEstimate
from mlci.spaces import Box, StateSpace
from mlci.systems import DoubleIntegrator
from mlci.tabular import action_grid, discretize
from mlci.temperature import TemperatureEstimate

SYSTEM = DoubleIntegrator()
HYPOTHESES = Regions.from_grid(SYSTEM.space, (6, 6))
MODEL = discretize(SYSTEM, Grid(SYSTEM.space, (12, 10)), action_grid(SYSTEM, 5), 0.5, HYPOTHESES)


def smooth(start: float, end: float, name: str) -> Demonstration:
    """From rest to rest in 5 s."""
    share = np.linspace(0, 1, 501)
    place = start + (end - start) * share**2 * (3 - 2 * share)
    states = np.column_stack([place, np.gradient(place, 0.01)])
    return Demonstration.from_path(states, 0.01, goal=Box.point([end, 0.0]), name=name)


def to_and_fro() -> list[Demonstration]:
    """Three paths, and one that goes a long way round for nothing."""
    paths = [smooth(-1.1, 1.1, "there"), smooth(1.2, -1.2, "back"), smooth(-1.0, 1.2, "again")]
    time = np.arange(501) * 0.01
    place = -1.1 + 1.6 * np.sin(2 * np.pi * time / 5) ** 2 * np.sign(time - 2.5)
    states = np.column_stack([place, np.gradient(place, 0.01)])
    return [*paths, Demonstration.from_path(states, 0.01, name="astray")]


@pytest.fixture(scope="module")
def result() -> Answer:
    demonstrations = to_and_fro()
    return answer(MODEL, demonstrations, infer(MODEL, demonstrations))


def test_the_temperature_that_paths_look_like_is_told(result: Answer) -> None:
    estimate = TemperatureEstimate(1.0, 0.4, 0.2, 0.9, (0.01, 100.0), ("there", "back"))
    more = replace(result, temperature_estimate=estimate)
    assert "temperature 1 (the paths look like 0.4 (0.2 to 0.9))" in more.assumptions
    assert estimate.warnings[0] in more.warnings
    assert json.loads(json.dumps(more.record()))["temperature_estimate"]["lower"] == 0.2
    assert result.record()["temperature_estimate"] is None


def test_whether_regions_are_soft_is_told(result: Answer) -> None:
    estimate = WeightEstimate("1", np.inf, 2.0, np.inf, 3.0, 0.0, 0.0, 0.7, 4)
    (record,) = json.loads(json.dumps(replace(result, weights=(estimate,)).record()))["weights"]
    assert (record["region"], record["lower"], record["upper"]) == ("1", 2.0, None)
    assert record["verdict"] == "as a wall"
    assert result.record()["weights"] == []


def test_the_parts_are_of_the_inference(result: Answer) -> None:
    inference = result.inference
    assert result.support.region == inference.order[0]
    assert result.inference.credible.share == 0.95
    assert result.misfit.count.tolist() == inference.violated.sum(axis=1).tolist()
    assert result.misfit.is_rare.tolist() == [False, False, False, True]
    (rare,) = [text for text in result.warnings if "the model's own" in text]
    assert "1 of 4 demonstrations" in rare
    assert rare.endswith(": astray")
    assert result.warnings[: len(inference.warnings)] == inference.warnings


def test_assumptions_are_the_inferences(result: Answer) -> None:
    other = replace(
        result,
        inference=replace(result.inference, rates=Rates(0.2, 0.05), prior_none=0.4),
        temperature=2.0,
        exact_ends=False,
    )
    words = "; ".join(other.assumptions)
    for part in (
        "at most one region", "none 0.4", "model error 0.2", "rule breaking 0.05",
        "temperature 2", "at cells",
    ):  # fmt: skip
        assert part in words
    assert "at states" in "; ".join(result.assumptions)


def test_the_record_is_json_with_the_same_numbers(result: Answer) -> None:
    record = json.loads(json.dumps(result.record(), allow_nan=False))
    first = result.support.region
    assert record["first"] == {
        "region": str(first),
        "gain": result.inference.gain[first],
        "posterior": result.inference.posterior[first],
    }
    assert [row["name"] for row in record["demonstrations"]] == list(result.inference.names)
    assert [row["first_without"] for row in record["demonstrations"]] == [
        str(i) for i in result.support.first_without
    ]
    area = record["credible_set"]["areas"][0]
    assert area["regions"] == [str(i) for i in result.inference.credible.areas[0].regions]
    assert set(area["lower"]) == set(SYSTEM.space.names)
    assert record["warnings"] == result.warnings
    endless = replace(
        result, inference=replace(result.inference, avoidance=np.zeros((4, 36)), rates=Rates())
    )
    assert json.loads(json.dumps(endless.record(), allow_nan=False))["first"]["gain"] is None


def test_regions_that_no_task_could_have_shown() -> None:
    """Ten tasks that each enter with .004 make .04, with .006 .06; a violation has shown it."""
    phi = np.tile([0.004, 0.006, 0.0, 0.0, 0.004], (11, 1))
    phi[10] = 0.5  # of a task that cannot be done
    violated = np.zeros((11, 5), dtype=bool)
    violated[3, 3] = True
    inference = Inference(
        Regions.from_grid(SYSTEM.space, (5, None)),
        tuple(map(str, range(11))),
        1 - phi,
        violated,
        np.arange(11) < 10,
    )
    assert unseen(inference).tolist() == [0, 2, 4]


def test_sides_that_are_no_borders_of_cells() -> None:
    """A ring of five cells that begin at .5, and a line of four that ends at 4."""
    space = StateSpace(Box([0.0, 0.0], [5.0, 4.0]), [True, False], ("angle", "place"))
    grid = Grid(space, (5, 4), (0.5, 0.0))
    boxes = [
        Box([0.5, 0.0], [1.5, 1.0]),
        Box([0.0, 0.0], [1.0, 1.0]),  # both sides half a cell off
        Box([4.5, 0.5], [5.5, 1.0]),  # across the seam; one side in the middle of a cell
        Box([-0.5, -3.3], [0.5, 9.0]),  # beyond the bounds of the line
        Box([-np.inf, 1.0], [np.inf, 3.0]),
        Box([1.5 + 1e-9, 1.0], [2.5, 3.5]),  # rounding is no cut
    ]
    cut = cut_by(grid, Regions.from_boxes(space, boxes))
    expected = [[0, 0], [1, 0], [0, 1], [0, 0], [0, 0], [0, 1]]
    np.testing.assert_array_equal(cut, np.array(expected, dtype=bool))


def test_a_grid_that_cuts_regions_is_a_warning(result: Answer) -> None:
    (cut,) = [text for text in result.warnings if "cuts" in text]
    assert cut == (
        "the grid cuts 36 of 36 regions: their borders in velocity are no borders of cells"
    )
    (hidden,) = [text for text in result.warnings if "none of the tasks" in text]
    assert f"{len(result.unseen)} of 36 regions" in hidden
    neither = replace(result, unseen=result.unseen[:0], cut=np.zeros((36, 2), bool))
    others = neither.warnings[len(result.inference.warnings) :]
    assert [text for text in others if "the model's own" not in text] == []


def test_doubts_about_the_recordings_come_first(result: Answer) -> None:
    doubtful = replace(result, doubts=("1 of 3 recordings turn too far",))
    assert doubtful.warnings == ["1 of 3 recordings turn too far", *result.warnings]
    assert doubtful.record()["warnings"][0] == "1 of 3 recordings turn too far"
