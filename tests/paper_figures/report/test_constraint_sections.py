"""Sections on soft constraints, transfer, areas and chosen tasks, by tables of known numbers."""

from pathlib import Path

import pandas as pd
import pytest
from choice_studies import area_cover_tables
from constraint_studies import control_tables, resolution_tables, soft_tables, transfer_tables
from method_studies import early_overlap_tables

from paper_figures.report import (
    section_areas,
    section_cells,
    section_controls,
    section_soft,
    section_transfer,
)
from paper_figures.report.chosen_for_claim_6 import chosen_tasks
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


def test_when_a_limit_is_found_and_how_often_one_is_imagined(tmp_path: Path) -> None:
    tables = control_tables()
    text = section_controls.section(results(tmp_path, "control_limits", tables))
    free, weak, weaker = (line for line in text.splitlines() if line.startswith("- "))
    assert free == (
        "- **No limit.** Some range is the answer with the model's chances in up to 50 % [45, 55 "
        "%] of sets, of 1, and in 2 % [0, 8 %] of those of 20; with calibrated chances in up to "
        "10 % [5, 15 %] of sets, of 1, and in 0 % [0, 6 %] of those of 20."
    )
    # 1 - 0.3 / 3 is 90 %.
    assert "u at most 1 rad/s².** The truth is first in 90 % of sets from 3 demonstr" in weak
    assert "u at least -0.5 rad/s²." in weaker
    assert "with no number that was tried" in weaker
    assert "| at most 1 | calibrated | 10 | 97 % [92, 100 %] | 50 % [45, 55 %] | 1 %" in text
    assert "| no limit | the model's | 1 | - | - | 50 % [45, 55 %] |" in text
    # 0.1 k + 0.02 n for each column k: of nothing 2 % after one demonstration, and so on.
    assert "| at most 1 | 10 | 20 % [19, 21 %] | 30 % [29, 31 %] | 40 % [39, 41 %] |" in text
    assert "| no limit | 2 |" not in text  # of sizes 1, 3 and 10
    del tables["joint_curve"]
    alone = section_controls.section(results(tmp_path / "alone", "control_limits", tables))
    assert "in one belief: the study `control_limits` has no table `joint_curve` yet" in alone
    limits = tables["cases"].query("truth != 'none'")
    some = results(tmp_path / "some", "control_limits", {**tables, "cases": limits})
    with pytest.raises(Missing, match="cannot be read: it compares truths"):
        section_controls.section(some)


def test_what_is_let_in_and_what_is_refused(tmp_path: Path) -> None:
    text = section_transfer.section(results(tmp_path, "transfer", transfer_tables()))
    derived, narrow = (line for line in text.splitlines() if line.startswith("- "))
    assert derived.startswith("- **margin: derived.**")
    assert "The inferred region is the truth in 0 of 2 points: demonstrators who stay" in derived
    assert (
        "lets in at most 50.00 % of trials at any strength; the target of 1 % is missed" in derived
    )
    assert narrow.startswith("- **margin: 0.1.**")
    assert "The inferred region is the truth in 2 of 2 points. Its own" in narrow
    assert "lets in at most 0.00 % of trials at any strength; the target of 1 % is met" in narrow
    assert "At 0.5 times the controls the tube lets in 50.0 % [45.1, 54.9 %] of trials" in narrow
    assert "At 2 times the controls the tube lets in 0.0 % [0.0, 1.0 %] of trials and" in narrow
    assert "refuses 50.0 % [43.1, 56.9 %] of safe states, the own safe set lets in 0.0 %" in narrow
    assert "| margin: 0.1 | 0.5 | never entered | - | 0.0 % [0.0, 8.8 %] | 10.0 % " in text


def test_how_errors_fall_with_cells(tmp_path: Path) -> None:
    text = section_cells.section(results(tmp_path, "cells", resolution_tables()))
    # Of the two tasks that are trusted the errors are 1 and 2 times 0.1 (100 / count)^power.
    assert "- against sampled paths: 400 cells, varying, err by 0.0395 [" in text
    assert "1600 cells, equal, averaged, by 0.0395 [" in text
    assert text.count("is met") == 4
    line = next(line for line in text.splitlines() if line.startswith("| equal, from centres"))
    assert "100: 0.158 [" in line
    assert "4 of 4 tasks not possible" in line
    assert line.endswith("| 0.50 |")
    assert "| 1600: 0.00625 [0.00625, 0.00625] | 1.00 |" in text
    worse = resolution_tables()["resolution"]
    worse.loc[worse["kind"] == "varying", "error"] *= 1.1
    text = section_cells.section(results(tmp_path / "w", "cells", {"resolution": worse}))
    assert text.count("is missed") == 1
    # Varying cells err by 1 / count, and by a tenth more as much as a tenth fewer: 440.
    assert "is missed: about 440 are needed.\n" in text
    assert text.count("Varying cells begin as equal ones") == 1


def in_four_dimensions(most: int) -> pd.DataFrame:
    """Two tasks that err by 3 and 4 noises, of which one is taken off: sqrt((8 + 15) / 2)."""
    rows = [
        {"seed": 0, "kind": kind, "count": count, "task": task, "possible": True}
        | {
            "error": (3 + task) * noise,
            "noise": noise,
            "trusted": True,
            "error_of_cells": float("nan"),
        }
        for kind, counts in (("averaged", (10_000, most)), ("of each task", (12_000,)))
        for count in counts
        for task in (0, 1)
        for noise in (0.02 if count == 10_000 else 0.01,)
    ]
    return pd.DataFrame(rows)


def test_errors_in_four_dimensions_without_the_errors_of_samples(tmp_path: Path) -> None:
    tables = {"resolution": in_four_dimensions(300_000)}
    text = section_cells.telescope_section(results(tmp_path, "cells_telescope", tables))
    assert (
        "12000 cells, varying, for each task alone, err by 0.0339 [0.0283, 0.0387], 300000" in text
    )
    assert text.count("is met") == 1
    assert "10000: 0.0678 [" in text
    assert "very many equal cells" not in text.split("Error against")[1]
    assert "equal, multilinear |" not in text


def test_more_cells_than_were_tried_err_as_their_order_says(tmp_path: Path) -> None:
    """Four times as many cells err by half, so that those of 30 times as many do by a fifth."""
    table = in_four_dimensions(40_000)
    tables = {"resolution": table}
    text = section_cells.telescope_section(results(tmp_path, "cells_telescope", tables))
    assert "40000 cells, equal, averaged, by 0.0339 [0.0283, 0.0387]. 300000 of these were" in text
    # 0.0339 (40000 / 300000)^0.5
    assert "with the order 0.50, they err by 0.0124, and the target, no larger an error, is" in text
    assert text.count("is missed") == 1
    few = {"resolution": table[table["count"] != 10_000]}
    text = section_cells.telescope_section(results(tmp_path / "few", "cells_telescope", few))
    assert "300000 of these were not tried." in text


def test_transfer_of_points_that_are_of_no_case_is_missing(tmp_path: Path) -> None:
    tables = transfer_tables()
    some = results(tmp_path, "transfer", {**tables, "cases": tables["cases"][:1]})
    with pytest.raises(Missing, match="cannot be read: some points are of no case"):
        section_transfer.section(some)


def area_curve() -> pd.DataFrame:
    """The methods' overlap, and what else the section tells."""
    curve = area_cover_tables()["area_curve"].assign(regions=2.0, seeds=10, expected=0.5)
    scores = {f"{name}{end}": 0.5 for name in ("precision", "recall") for end in ("", "_low")}
    return curve.assign(**scores, precision_high=0.6, recall_high=0.6)


def test_areas_of_shapes_and_their_ceilings(tmp_path: Path) -> None:
    text = section_areas.section(results(tmp_path / "with", "areas", {"area_curve": area_curve()}))
    # 0.1 + 0.1 k + 0.2 after four demonstrations, of the fourth, sixth, seventh and eighth method.
    assert "With 4 demonstrations it reaches 0.80 [0.75, 0.85], against 0.60 of squares" in text
    assert "and expects 0.50. What could" in text
    assert "overlap all of it by 1.0 [0.95, 1.1]" in text
    assert "the same inference reaches 0.90 [0.85, 0.95]" in text
    assert "4 chosen tasks reach 1.1 [1.1, 1.2], more than 0.80 [0.75, 0.85] of random" in text
    assert "where all that is assumed is right, 1.2 [1.1, 1.2]" in text
    # Ceilings reach nothing: they know the truth.
    assert "with 1 (*best area of shapes*)" in text
    assert "(*all of the truth that was shown*)" not in text

    cells = area_curve().query("method in ['single', 'greedy', 'climb']").drop(columns="expected")
    text = section_areas.section(results(tmp_path / "without", "areas", {"area_curve": cells}))
    assert "shapes" not in text


@pytest.mark.parametrize(
    ("reached", "verdict"),
    [(0.3, "too hopeful"), (0.48, "as it comes out"), (0.9, "too careful")],
)
def test_whether_expected_overlaps_come_out(tmp_path: Path, reached: float, verdict: str) -> None:
    curve = area_curve()
    ends = {"iou": reached, "iou_low": reached - 0.05, "iou_high": reached + 0.05}
    more = curve[curve["demonstrations"] == 4].assign(demonstrations=8, **ends)
    text = section_areas.section(
        results(tmp_path, "areas", {"area_curve": pd.concat([curve, more])})
    )
    assert f"with 8 it reaches {reached:.2f} and expects 0.50, which is {verdict}. What" in text


def test_areas_are_told_from_outside_where_that_was_measured(tmp_path: Path) -> None:
    folder = results(tmp_path, "areas", {"area_curve": area_curve()})
    text = section_areas.section(folder)
    assert "`python -m tests.benchmark.shortest_ways` makes it." in text
    rows = [
        {"measure": name, "demonstrations": size, "mean": value, "low": value - 0.1, "high": 0.9}
        for size, of_size in ((4, (0.4, 0.5)), (8, (0.6, 0.7)))
        for name, value in zip(("overlap", "expected"), of_size, strict=True)
    ]
    rows += [{"measure": f"ratio_{q}", "mean": 1 + q} for q in (0.1, 0.5, 0.9)]
    summary = pd.DataFrame(rows)
    outside = results(tmp_path, "shortest_ways", {"summary": summary})
    text = section_areas.section(outside)
    assert "spend 1.50 times as much in the median, 1.10 at the 10th percentile and 1.90" in text
    assert (
        "with 4 tasks 0.40 [0.30, 0.90], expecting 0.50, and with 8 tasks 0.60 [0.50, 0.90]" in text
    )


def test_what_five_chosen_tasks_do_for_claim_6(tmp_path: Path) -> None:
    tables = early_overlap_tables()
    text = chosen_tasks(results(tmp_path / "with", "next_task_telescope", tables))
    assert "over 8 pools from 2 sets of tasks" in text
    (line,) = (line for line in text.splitlines() if "| simulated demonstrator | chosen |" in line)
    shares = [cell.split(" %")[0].strip() for cell in line.split("|")[3:-1]]
    assert shares == ["50", "0", "100", "50", "10"]
    assert (
        "the most probable area overlaps the truth in 100 % [100, 100 %], more than 0 % [0, 0 %] "
        "after random ones" in text
    )
    assert "overlap it in 0 % [0, 0 %], which the intervals do not tell apart from 0 %" in text


def test_claim_6_says_how_to_choose_tasks_where_nobody_did(tmp_path: Path) -> None:
    text = chosen_tasks(Results(tmp_path))
    assert "Tasks that are chosen: the study `next_task_telescope` has no table" in text
    assert "experiment=next_task_telescope` makes it." in text
