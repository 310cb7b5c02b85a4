"""The table of errors of Phi by number of cells, of a tiny point."""

from pathlib import Path

import numpy as np
import pandas as pd
from tiny_point import TINY, composed, computed

from experiments.config.read import read_config


def test_kinds_of_cells_are_compared(tmp_path: Path) -> None:
    more = ("grid.shape=[8,8]", "resolution.counts=[30,100,256]", "resolution.tasks=2")
    more += ("resolution.paths=300", "resolution.finest=256")
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
    assert table["error_of_cells"].notna().all()
