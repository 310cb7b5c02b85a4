"""Points and recorded demonstrations on cells of each task's own, and what they cannot be asked."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed, computed

from experiments.config.read import ConfigError, read_config, read_recorded_config
from experiments.infer import infer
from experiments.point.stages import formed_model
from mlci.cells.refined_model import RefinedModel

SHARED = (*TINY, "grid.shape=[6,6]", "transition.samples=2")
REFINED = (*SHARED, "grid.refined=60")
_OF_POINTS = ("seed", "horizon", "truth", "rollouts", "misfit", "demonstrations", "safety", "ranks")


def test_a_refined_point_has_the_tables_of_one_with_equal_cells(tmp_path: Path) -> None:
    points = [
        computed(read_config(composed(*words, "misfit=9"))[0], tmp_path)
        for words in (REFINED, SHARED)
    ]
    refined, equal = (
        {path.stem: pd.read_csv(path) for path in point.folder.rglob("*.csv")} for point in points
    )
    assert refined.keys() == equal.keys()
    for name, table in refined.items():
        assert list(table.columns) == list(equal[name].columns), name
    assert set(refined["summary"]["cells"]) == {60}
    assert refined["trials"]["final_state_error"].notna().any()
    assert not np.allclose(refined["hypotheses"]["gain"], equal["hypotheses"]["gain"])


def test_the_first_cells_are_those_of_the_grid() -> None:
    settings = read_config(composed(*REFINED))[0]
    model = formed_model(settings, settings.candidates)
    assert isinstance(model, RefinedModel)
    assert (model.cells, model.model.states) == (60, 36)
    assert model.model.samples == settings.transition.samples


def test_recorded_demonstrations_are_ranked_on_refined_cells(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.linspace(0, 1, 21)
    path = {"time": time, "position": 0.2 * time**2, "velocity": 0.4 * time}
    pd.DataFrame(path).to_csv(tmp_path / "one.csv", index=False)
    words = [word for word in REFINED if word.split("=")[0].split(".")[0] not in _OF_POINTS]
    words += [f"demonstrations={tmp_path / 'one.csv'}", f"results={tmp_path / 'results'}"]
    words += ["next_tasks.candidates=3", "next_tasks.count=1", "inference.sets.largest=1"]
    settings = read_recorded_config(composed("truth=wall", *words, name="infer"))
    assert infer(settings) == 0
    assert "1 used" in capsys.readouterr().out
    (answer,) = tmp_path.rglob("answer.json")
    assert json.loads(answer.read_text())["sets"]["sizes"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("grid.refined=90", r"grid\.refined: 90 is less than the 100 cells of grid\.shape"),
        ("model=sampled", r"grid\.refined: 400, but model=sampled has no cells"),
        ("grid.offset=[0.5,0]", r"grid\.offset: \[0\.5, 0\.0\], but refined cells begin at the"),
        ("calibration.sets=2", r"calibration\.sets: 2 needs cells that all tasks share"),
        ("inference.shapes.count=9", r"inference\.shapes\.count: 9 needs cells that all tasks"),
        ("grid.refined=1000000 actions=999", r"grid\.refined: 1000000 cells with .* takes about"),
    ],
)
def test_what_refined_cells_cannot_be_is_refused(words: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_config(composed("grid=adaptive", *words.split()))


@pytest.mark.parametrize("words", ["soft=1", "estimate_temperature=true"])
def test_what_needs_shared_cells_is_refused_of_recordings(words: str) -> None:
    with pytest.raises(ConfigError, match="needs cells that all tasks share"):
        read_recorded_config(composed("grid=adaptive", "demonstrations=x", words, name="infer"))


def test_kinds_of_cells_that_are_too_many_are_refused() -> None:
    few = ("resolution.counts=[100]", "actions=999")
    for words in ("counts=[1000000]", "varying=[1000000]", "finest=1000000"):
        with pytest.raises(ConfigError, match=r"resolution\.counts: .* take about [0-9.e+]+ GB"):
            read_config(composed(*few, f"resolution.{words}"))
    read_config(composed("resolution.counts=[100]"))
    with pytest.raises(ConfigError, match=r"resolution\.varying: \[9, 9\] holds a value twice"):
        read_config(composed(*few, "resolution.varying=[9,9]"))
