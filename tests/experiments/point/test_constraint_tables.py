"""The tables of soft constraints and of transfer, of a tiny point."""

from pathlib import Path

import numpy as np
import pandas as pd
from tiny_point import TINY, composed, computed

from experiments.config.read import read_config


def test_tables_that_are_asked_for(tmp_path: Path) -> None:
    more = ("soft.sets=3", "soft.weights=[0.0,5.0]", "soft.demonstrations=[2]")
    more += ("transfer.strengths=[0.5,1.0]", "transfer.trials=20", "transfer.states=50")
    settings = read_config(composed(*TINY, *more, "safety.margin=0.2"))[0]
    point = computed(settings, tmp_path)
    tables = {path.stem: pd.read_csv(path) for path in point.folder.rglob("*.csv")}
    soft, transfer = tables["soft"], tables["transfer"]
    assert len(soft) == 6
    assert np.all(soft["lower"] <= soft["estimate"])
    assert np.all(soft["estimate"] <= soft["upper"])
    assert list(transfer["strength"].unique()) == [0.5, 1.0]
    nominal = transfer[transfer["strength"] == 1].set_index("method")
    assert nominal.loc["tube", "entered"] == nominal.loc["own safe set", "entered"]
    assert nominal.loc["own safe set", "safe"] + nominal.loc["own safe set", "doomed"] <= 50
    assert set(tables["transfer_values"]["strength"]) == {0.5, 1.0}
