"""Sections on soft constraints and on transfer, by tables whose numbers are known."""

from pathlib import Path

import pytest
from constraint_studies import soft_tables, transfer_tables

from paper_figures.report import section_soft, section_transfer
from paper_figures.report.study_tables import Missing, Results


def results(folder: Path, study: str, tables: dict) -> Results:
    """A folder of results that holds some tables of a study."""
    (folder / study / "tables").mkdir(parents=True)
    for name, table in tables.items():
        table.to_csv(folder / study / "tables" / f"{name}.csv", index=False)
    return Results(folder)


def test_how_often_weights_are_in_their_intervals(tmp_path: Path) -> None:
    text = section_soft.section(results(tmp_path, "soft", soft_tables()))
    assert "108 of 120 intervals hold the true weight" in text
    # Nine of ten; quartiles of 4, 4.1 ... 4.9.
    assert "| C1 | 10 | 4 | 4.40 [4.20, 4.70] | 90 % [60, 98 %] | 0 % | 0 % | 100 % | 0 % |" in text
    assert "| C2 | 30 | 16 | 16.8 [16.4, wall] |" in text
    with pytest.raises(Missing):
        section_soft.section(Results(tmp_path / "elsewhere"))


def test_what_is_let_in_and_what_is_refused(tmp_path: Path) -> None:
    text = section_transfer.section(results(tmp_path, "transfer", transfer_tables()))
    assert "The inferred region is the truth in 2 of 2 points" in text
    assert "lets in at most 0.00 % of trials at any strength; the target of 1 % is met" in text
    assert "At 0.5 times the controls the tube lets in 50.0 %" in text
    assert "At 2 times the controls the tube refuses 50.0 %" in text
    assert "| 0.5 | never entered | - | 0.0 % [0.0, 8.8 %] | 10.0 % " in text
