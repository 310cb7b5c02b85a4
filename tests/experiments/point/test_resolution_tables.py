"""The table of errors of Phi by number of cells, of a tiny point."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from tiny_point import TINY, composed, computed

from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.point.inference import infer_point
from experiments.tracking.store import Store
from mlci.demonstrations import Task
from mlci.grids import Grid
from mlci.preparation import prepare
from mlci.sampled.model import SampledModel
from mlci.spaces import Floats
from mlci.tabular import discretize


def test_kinds_of_cells_are_compared(tmp_path: Path) -> None:
    more = ("grid.shape=[8,8]", "resolution.counts=[30,100,256]", "resolution.tasks=2")
    more += ("resolution.paths=300", "resolution.finest=256")
    more += ("demonstrations.clip=true", "horizon=4.0")  # tasks that sampled paths can do as well
    point = computed(read_config(composed(*TINY, *more))[0], tmp_path)
    table = pd.read_csv(next(point.folder.rglob("resolution.csv")))
    counts = table.groupby("kind")["count"].agg(lambda each: sorted(set(each)))
    assert counts["centre"] == counts["averaged"] == counts["multilinear"] == [25, 100, 256]
    assert np.all(np.array(counts["round goals"]) > [25, 100, 256])
    assert counts["varying"] == [100, 256]  # 30 are fewer than the first cells
    assert counts["of each task"] == [100, 256]
    assert np.array_equal(np.unique(table["task"]), [0, 1])
    finest = table[(table["kind"] == "centre") & (table["count"] == 256)]
    assert np.all(finest["error_of_cells"] == 0)  # it is its own limit
    assert table["error"].between(0, 1).all()
    expected = {"centre": 1, "averaged": 2}  # start points along each dimension
    settings = read_config(composed(*TINY, *more))[0]
    tasks = [each.task for each in infer_point(settings, Store(tmp_path / "store")).demonstrations]
    limit = phi_of(settings, (16, 16), 1, tasks[:2])
    sampled = [sampled_model(settings).distribution(task) for task in tasks[:2]]
    for kind, samples in expected.items():
        for count, shape in ((25, (5, 5)), (100, (10, 10)), (256, (16, 16))):
            rows = table[(table["kind"] == kind) & (table["count"] == count)]
            phi = phi_of(settings, shape, samples, tasks[:2])
            for row, of_task, of_limit, paths in zip(
                rows.itertuples(), phi, limit, sampled, strict=True
            ):
                assert row.possible == (of_task is not None)
                assert row.error_of_cells == pytest.approx(rms(of_task, of_limit), abs=1e-9)
                reference = paths.violation_probabilities()
                assert row.error == pytest.approx(rms(of_task, reference), abs=1e-9)
                noise = rms(paths.avoidance_errors(), None)
                assert row.noise == pytest.approx(noise, rel=1e-9)
                assert row.trusted == paths.diagnosis.trusted
    multilinear = table[(table["kind"] == "multilinear") & (table["count"] == 100)]
    assert not np.allclose(multilinear["error"], table[table["count"] == 100]["error"].iloc[0])


def rms(one: Floats | None, other: Floats | None) -> float:
    """Root mean square difference; None stands for nothing."""
    first, second = (0.0 if each is None else each for each in (one, other))
    return float(np.sqrt(np.mean(np.square(np.subtract(first, second)))))


def phi_of(
    settings: Settings, shape: tuple[int, int], samples: int, tasks: list[Task]
) -> list[Floats | None]:
    """Phi of each task on a grid of a shape; None where it cannot be done."""
    grid = Grid(settings.model.space, shape)
    actions, regions = settings.action_values, settings.candidates
    model = discretize(settings.model, grid, actions, settings.dt, regions, samples)
    prepared = prepare(model, tasks)
    return [
        1 - alpha if possible else None
        for alpha, possible in zip(prepared.avoidance, prepared.reachable, strict=True)
    ]


def sampled_model(settings: Settings) -> SampledModel:
    """The reference without cells."""
    return SampledModel(
        settings.model,
        settings.candidates,
        settings.dt,
        samples=300,
        tolerance=0.02,
        limit=settings.model.control_box,
    )
