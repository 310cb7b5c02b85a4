"""What was known before, beside what came: of a tiny point; and truths drawn for a study."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tiny_point import composed

from experiments.config.paths import CONF
from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point import dynamics_tables
from experiments.point.dynamics_tables import dynamics_table, unconstrained_paths
from experiments.point.inference import infer_point
from experiments.point.ranking_tables import rank_table
from experiments.point.run import run_point
from experiments.point.truth_draw import drawn_truths
from experiments.tracking.store import Store
from experiments.tracking.trees import canonical_json
from mlci.outlook.outlook import FEATURES, outlook
from mlci.tabular import discretize

WORDS = ["system=damped_spring", "truth=cell", "truth.cell=54", "inference.calibrate=false"]
POINT = [*WORDS, "horizon=3.0", "dt=0.5", "actions=5", "grid.shape=[12,10]", "dynamics.tasks=6"]
POINT += ["demonstrations.pairs=8", "demonstrations.keep=5", "demonstrations.dt=0.05"]
POINT += ["demonstrations.restarts=1", "ranks.demonstrations=3", "ranks.subsets=4", "rollouts=1"]
POINT += ["safety.shape=[41,41]", "misfit=0"]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    return Store(tmp_path_factory.mktemp("store"))


def test_the_row_is_the_outlook_of_the_truth_and_its_ranks(store: Store) -> None:
    settings = read_config(composed(*POINT))[0]
    tables = run_point(settings, store, lambda line: None)
    (row,) = tables["dynamics"].to_dict("records")
    paths = unconstrained_paths(settings, store)
    assert row["system"] == "DampedSpring"
    assert row["tasks"] == len(paths) >= 3
    model = discretize(
        settings.model, settings.cells, settings.action_values, settings.dt, settings.candidates
    )
    (expected,) = outlook(model, paths).features([54], 3, 5)
    np.testing.assert_allclose([row[name] for name in FEATURES], expected)
    ranks = tables["ranks"].query("demonstrations == 3")
    assert row["demonstrations"] == 3
    assert row["top"] == pytest.approx((ranks["rank"] <= 5).mean())
    assert row["log_rank"] == pytest.approx(np.log(ranks["rank"]).mean())
    assert row["first"] == pytest.approx((ranks["rank"] == 1).mean())
    assert row["claim"] == pytest.approx(ranks["claim"].mean())
    assert row["out_of_reach"] == pytest.approx(1 - tables["trials"]["reachable"].mean())
    distance = tables["trials"]["violation_distance"]
    assert row["violation_distance"] == pytest.approx(distance.mean(), nan_ok=True)


def test_only_tasks_that_the_demonstrator_can_do_count(store: Store) -> None:
    settings = read_config(composed(*POINT))[0]
    paths = unconstrained_paths(settings, store)
    assert 0 < len(paths) < settings.dynamics.tasks
    for path in paths:
        miss = path.task.goal.lower - path.states[-1]  # a point
        assert np.linalg.norm(miss) <= settings.demonstrations.goal_tolerance


def test_a_truth_of_several_hypotheses_is_known_by_the_one_that_is_crossed_most(
    store: Store,
) -> None:
    wide = "truth.boxes=[{lower: [0.4, -0.8], upper: [0.8, 0.4]}]"
    settings = read_config(composed(*POINT, "truth.cell=null", wide))[0]
    covered = np.flatnonzero(settings.candidates.inside(settings.constraint))
    assert covered.tolist() == [63, 64, 65]
    point = infer_point(settings, store)
    ranks = rank_table(settings, point.inference, np.random.default_rng(0))
    measures = SimpleNamespace(violation_distance=np.ones(3))
    (row,) = dynamics_table(settings, point, measures, ranks, store).to_dict("records")
    known = outlook(point.tabular, unconstrained_paths(settings, store), point.hypotheses)
    assert np.argmax(known.crossed[covered]) == 1  # neither the first nor the last
    middle, first = known.features([64, 63], settings.ranks.demonstrations, settings.ranks.top)
    np.testing.assert_allclose([row[name] for name in FEATURES], middle)
    assert not np.allclose(middle, first)


def test_no_demonstration_has_a_part_in_what_is_known_before() -> None:
    one = read_config(composed(*POINT))[0]

    def inputs(part: str, **changes: object) -> bytes:
        """What the paths' key is made from, with changes of a part of the settings."""
        changed = dataclasses.replace(getattr(one, part), **changes) if part else one
        settings = dataclasses.replace(one, **({part: changed} if part else changes))
        return canonical_json(dynamics_tables.path_inputs(settings))

    before = inputs("")
    assert inputs("truth", cell=3) == inputs("grid", shape=(6, 6)) == before
    assert inputs("demonstrations", keep=4, rule_breaking=0.2) == before
    assert inputs("tasks", crossing=not one.tasks.crossing) == before
    assert inputs("demonstrations", pairs=7) == inputs("", seed=1, dt=1.0) == before
    assert inputs("demonstrations", iterations=3) != before
    assert inputs("tasks", upper=(1.0, 0.5)) != before
    assert inputs("dynamics", tasks=7) != before


def test_the_studys_truths_are_those_that_are_drawn(store: Store) -> None:
    settings: Settings = read_config(
        composed(*WORDS, "experiment=dynamics", "system=damped_spring", "dynamics.tasks=40")
    )[0]
    drawn = drawn_truths(settings, store, 5)
    text = (CONF / "experiment" / "dynamics.yaml").read_text()
    cells = re.findall(r'system=damped_spring,.*truth.cell=([\d,]+)"', text)
    assert sorted(int(cell) for part in cells for cell in part.split(",")) == drawn
    paths = unconstrained_paths(settings, store)
    for cell in drawn:
        box = settings.candidates.box(cell)
        inside = [np.any(box.contains(path.states)) for path in paths]
        assert np.mean(inside) >= 0.1 - 1e-9


def test_every_system_of_the_study_has_five_truths() -> None:
    text = Path(CONF / "experiment" / "dynamics.yaml").read_text()
    rows = re.findall(r'system=(\w+),.*truth.cell=([\d,]+)"', text)
    assert all(len(set(cells.split(","))) == 5 for _, cells in rows)
    assert len({system for system, _ in rows}) == len(rows) >= 10
