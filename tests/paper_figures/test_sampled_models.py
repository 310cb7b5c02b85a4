"""How fast Phi settles, by tables whose power is known, and the section that says so."""

from pathlib import Path

import numpy as np
import pytest
from method_studies import sampled_tables

from paper_figures.report import section_sampled
from paper_figures.report.study_tables import Missing, Results
from paper_figures.rows import Unsuited
from paper_figures.sampled_models import change_rows, draw, facts, slopes


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
