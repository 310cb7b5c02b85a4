"""Points and recorded demonstrations ranked by sampled paths, and what needs cells."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed, computed

from experiments.config.read import ConfigError, read_config, read_recorded_config
from experiments.console import answer_lines
from experiments.infer import infer
from experiments.page.words import answer_sentences
from experiments.point import model_tables
from experiments.point.inference import infer_point, point_answer
from experiments.point.model_choice import ModelChoice
from experiments.tracking.store import Store
from mlci.sampled.diagnosis import SamplingDiagnosis

SAMPLED = (*TINY, "model=sampled", "sampled.samples=300", "sampled.restarts=1")
SAMPLED += ("sampled.substeps=1", "misfit=9")
STUDY = ("models.trials=2", "models.steps=[1.0,0.5]", "models.tasks=2")


def test_a_sampled_point_has_the_tables_of_one_with_cells(tmp_path: Path) -> None:
    points = [
        computed(read_config(composed(*words, *STUDY))[0], tmp_path)
        for words in (SAMPLED, (*TINY, "misfit=9"))
    ]
    sampled, cells = (
        {path.stem: pd.read_csv(path) for path in point.folder.rglob("*.csv")} for point in points
    )
    assert sampled.keys() == cells.keys()
    for name, table in sampled.items():
        assert list(table.columns) == list(cells[name].columns), name
    assert set(sampled["summary"]["cells"]) == {0}
    assert np.all(sampled["hypotheses"]["gain"].dropna() < np.inf)
    halving, model = sampled["halving"], sampled["models"].iloc[0]
    assert np.all(halving["noise"] > 0)
    assert np.all(cells["halving"]["noise"] == 0)
    assert model["rank_lowest"] <= model["rank"] <= model["rank_highest"]
    done = sampled["trials"]["feasible"]
    assert np.all(sampled["trials"].loc[done, "final_state_error"] < 0.05)


def test_changes_and_noise_of_a_shorter_step_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two tasks and two regions; the second task is out of reach of the longer step."""
    few = SimpleNamespace(
        errors=np.array([[0.3, 0.05], [0.1, 0.1]]), effective=np.array([10.0, 5.0])
    )
    prepared = [
        SimpleNamespace(
            avoidance=np.array(alpha), reachable=np.array(reached), sampling=few, tasks=(0, 1)
        )
        for alpha, reached in (
            ([[0.5, 0.2], [1.0, 1.0]], [True, False]),
            ([[0.3, 0.1], [0.4, 0.4]], [True, True]),
        )
    ]
    asked: list[float] = []
    monkeypatch.setattr(model_tables, "formed_model", lambda it, _: asked.append(it.dt))
    monkeypatch.setattr(model_tables, "prepare", lambda *_, **__: prepared[len(asked) - 1])
    settings = read_config(composed(*TINY, "models.steps=[0.5,1.0]", "models.tasks=2"))[0]
    tasks = [SimpleNamespace(task=None)] * 2
    point: Any = SimpleNamespace(demonstrations=tasks, numbers=np.array([4, 7]))
    (row,) = model_tables.halving_table(settings, point).to_dict("records")
    assert asked == [1.0, 0.5]
    assert (row["step"], row["shorter"], row["trial"]) == (1.0, 0.5, 4)
    assert row["change"] == pytest.approx((0.2**2 + 0.1**2) / 2)
    assert row["noise"] == pytest.approx(2 * (0.3**2 - 0.1**2) / 2)  # 0.05 is within 1 / 10


def test_an_answer_says_which_ranks_are_settled(tmp_path: Path) -> None:
    settings = read_config(composed(*SAMPLED, "sampled.settle=1", "sampled.most=600"))[0]
    result = point_answer(settings, infer_point(settings, Store(tmp_path)))
    record, lines = result.record()["sampling"], list(answer_lines(result, 3))
    text = " ".join(" ".join(lines).split())
    assert "settled at 95 %" in text
    assert "standard errors of Phi are" in text
    assert any("sampled paths" in sentence for sentence in answer_sentences(result))
    json.dumps(record, allow_nan=False)
    regions = record["regions"]
    assert len(regions) == len(settings.candidates)
    settled = [name for name, each in regions.items() if each["lowest"] == each["highest"]]
    assert set(record["settled"]) == set(settled)


def test_recorded_demonstrations_are_ranked_by_sampled_paths(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    time = np.linspace(0, 1, 21)
    path = {"time": time, "position": 0.2 * time**2, "velocity": 0.4 * time}
    pd.DataFrame(path).to_csv(tmp_path / "one.csv", index=False)
    words = [word for word in SAMPLED if word.split("=")[0] not in _OF_POINTS]
    words += [f"demonstrations={tmp_path / 'one.csv'}", f"results={tmp_path / 'results'}"]
    words += ["next_tasks.candidates=3", "next_tasks.count=1", "inference.sets.largest=1"]
    settings = read_recorded_config(composed("truth=wall", *words, name="infer"))
    assert infer(settings) == 0
    assert "settled at 95 %" in " ".join(capsys.readouterr().out.split())
    (answer,) = tmp_path.rglob("answer.json")
    assert json.loads(answer.read_text())["sampling"]["level"] == 0.95
    pairs = pd.read_csv(answer.parent / "violations.csv")
    assert np.all(pairs["error"] > 0)
    assert not pairs["resolved"].all()


_OF_POINTS = {"truth", "horizon", "safety.shape", "demonstrations.pairs", "demonstrations.keep"}
_OF_POINTS |= {"demonstrations.restarts", "demonstrations.dt", "ranks.demonstrations", "misfit"}
_OF_POINTS |= {"ranks.subsets", "rollouts"}


@pytest.mark.parametrize(
    "words",
    [
        *("inference.exact_ends=false", "transition.samples=3", "soft.weights=[1.0]"),
        "inference.shapes.count=10",
        *("next_task.repetitions=1", "baselines.paths=1", "calibration.sets=1"),
    ],
)
def test_what_needs_cells_is_refused(words: str) -> None:
    truth = ["truth=none"] if "calibration" in words else []
    with pytest.raises(ConfigError, match="needs cells, and model=sampled has none; set it to"):
        read_config(composed("model=sampled", *truth, words))
    read_config(composed(*truth, words))


@pytest.mark.parametrize("words", ["soft=1", "estimate_temperature=true"])
def test_what_needs_cells_is_refused_of_recordings(words: str) -> None:
    with pytest.raises(ConfigError, match="needs cells"):
        read_recorded_config(composed("model=sampled", "demonstrations=x", words, name="infer"))


def test_a_budget_below_the_first_samples_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"sampled\.most: 100 is less than the 4000"):
        read_config(composed("model=sampled", "sampled.most=100"))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("sampled.tolerance=1e-300", r"sampled\.tolerance: 1e-300 is lost in the rounding"),
        ("sampled.substeps=1000000", r"sampled\.most: .*; lower sampled\.most, sampled\.substeps"),
    ],
)
def test_what_samples_cannot_be_is_refused(words: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_config(composed("model=sampled", words))


@pytest.mark.parametrize(
    "words", ["models.steps=[0.5,0.5]", "resolution.counts=[100,100]", "soft.weights=[1.0,1]"]
)
def test_what_is_given_twice_is_refused(words: str) -> None:
    with pytest.raises(ConfigError, match="holds a value twice"):
        read_config(composed(words))


def test_advice_on_models_follows_what_both_say() -> None:
    well = SamplingDiagnosis(4000, 0.7, 1500.0, 0.2, np.ones(1), 0.0, 2)
    alike = ModelChoice(0.3, well, 0.005, 0.006, 0.02)
    assert alike.lines()[-1].startswith("model=tabular: it has no error of samples")
    assert "10 times what samples explain" in replace(alike, apart=0.05).lines()[1]
    assert replace(alike, apart=0.05).lines()[-1].startswith("model=sampled where probabilities")
    assert replace(alike, apart=None).lines()[-1].startswith("model=sampled: no grid")
    thin = replace(well, effective=5.0)
    assert "not to be believed: 5 effective" in replace(alike, samples=thin).lines()[-1]
    assert replace(alike, samples=None).lines() == [
        "model=tabular: no sampled path does the task (0.3 s)"
    ]


@pytest.mark.parametrize("first", [6, 7])
def test_the_truth_has_the_rank_of_the_best_hypothesis_inside(first: int, tmp_path: Path) -> None:
    """Of slices of 0.6 m, 1.2 m of truth hold two; one of them is in the way of every task."""
    wide = "truth.boxes=[{lower: [0.6, null], upper: [1.8, null]}]"
    settings = read_config(composed(*TINY, wide, "models.trials=2", "misfit=0"))[0]
    point = infer_point(settings, Store(tmp_path))
    covered = np.flatnonzero(point.inference.hypotheses.inside(settings.constraint))
    assert covered.tolist() == [6, 7]
    alpha = np.full(point.inference.avoidance.shape, 0.9)
    alpha[:, first] = 0.1
    nothing = np.zeros(alpha.shape, dtype=bool)
    inference = replace(point.inference, avoidance=alpha, violated=nothing)
    tables = model_tables.model_tables(settings, replace(point, inference=inference))
    (row,) = tables["models"].to_dict("records")
    assert (row["rank"], row["rank_lowest"], row["rank_highest"]) == (1, 1, 1)
