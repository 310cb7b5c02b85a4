"""How fast Phi settles, by tables whose power is known, and the section that says so."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from paper_figures.report import section_sampled
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import Unsuited
from paper_figures.sampled_models import change_rows, draw, facts, slopes


def sampled_tables() -> dict[str, pd.DataFrame]:
    """With paths the change goes with the step, beside noise; with cells it goes with its root."""
    opening = [
        {"truth": truth, "cells": cells, "seed": 0} for truth in ("c1", "c2") for cells in (0, 400)
    ]
    halving = [
        {
            **each,
            "step": step,
            "shorter": step / 2,
            "trial": trial,
            "change": (0.1 * step ** (0.5 if each["cells"] else 1)) ** 2 + noise,
            "noise": noise,
        }
        for each in opening
        for noise in [0.0 if each["cells"] else 0.003]
        for step in (1.0, 0.5, 0.25)
        for trial in range(3)
    ]
    scores = {"brier": 0.02, "brier_low": 0.01, "brier_high": 0.03, "off_by": 0.001}
    scores |= {"log_score": -0.1, "log_score_low": -0.2, "log_score_high": -0.05}
    ranks = {"rank": 1.0, "rank_lowest": 1.0, "rank_highest": 2.0, "settled": 3, "doubted": 1}
    curve = {"median": 3.0, "median_low": 2.0, "median_high": 5.0}
    curve |= {"share_top_5": 0.8, "share_top_5_low": 0.7, "share_top_5_high": 0.9}
    return {
        "models": pd.DataFrame([{**each, **scores, **ranks} for each in opening]),
        "halving": pd.DataFrame(halving),
        "rank_curve": pd.DataFrame(
            [
                {"truth": each["truth"], "cells": each["cells"], "demonstrations": count, **curve}
                for each in opening
                for count in (5, 9, 12)
            ]
        ),
    }


def test_noise_of_samples_is_no_change_of_phi() -> None:
    tables = sampled_tables()
    rows = change_rows(tables["halving"]).set_index(["cells", "step"])
    np.testing.assert_allclose(rows.loc[(0, 0.5), ["rms", "low", "high"]].astype(float), 0.05)
    found = slopes(tables["halving"]).set_index("cells")
    np.testing.assert_allclose(found.loc[0].astype(float), 1.0)
    np.testing.assert_allclose(found.loc[400].astype(float), 0.5)


def test_the_caption_and_the_section_tell_ranks_and_slopes(tmp_path: Path) -> None:
    tables = sampled_tables()
    assert "C2, sampled paths, 12 demonstrations: median rank 3 (2 to 5)" in facts(**tables)
    folder = tmp_path / "sampled" / "tables"
    folder.mkdir(parents=True)
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    text = section_sampled.section(Results(tmp_path))
    assert "| C1 | sampled paths | 3.00 [2.00, 5.00] | 80 % [70, 90 %] |" in text
    assert "- 400 cells: the change of Phi goes with dt to the power of 0.500" in text
    assert "with all demonstrations 3 of the first ranks are settled" in text
    assert "| sampled paths | 0.0200 [0.0100, 0.0300] |" in text
    with pytest.raises(Missing):
        section_sampled.section(Results(tmp_path / "elsewhere"))


def test_without_samples_there_is_nothing_to_draw() -> None:
    tables = {name: table[table["cells"] > 0] for name, table in sampled_tables().items()}
    with pytest.raises(Unsuited, match="nothing is sampled"):
        draw(**tables)
