"""Looking back: what the command line tells of a folder of results, and what it removes."""

import csv
import dataclasses
import io
import json
import os
import re
import shlex
import shutil
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import run_here
from hand_made import alter
from tiny_point import TINY, composed, computed, hopeless, planned

from experiments import infer, results
from experiments.collate.join import collate
from experiments.config.paths import CHECKOUT
from experiments.config.read import read_config
from experiments.config.settings import Settings
from experiments.lookback.archive import Archive
from experiments.lookback.cleaning import clean
from experiments.tracking.figure_notes import figure_note, write_note
from experiments.tracking.points import Point
from experiments.tracking.sealed import read_sealed
from experiments.tracking.study import write_plan
from experiments.tracking.tables import rounded

TABLES = (
    "attempts, dimensions, first, hypotheses, moves, paths, probabilities, ranks, regions, "
    "sampled, summary, trials, violations"
)


def finished(settings: Settings, folder: Path, **changes: object) -> Point:
    return computed(dataclasses.replace(settings, **changes), folder)


def swept(settings: Settings, folder: Path, study: str, **values: float) -> list[Point]:
    """A study of finished points, collated."""
    points = [finished(settings, folder, dt=dt, seed=values.get("seed", 0)) for dt in (1.0, 0.5)]
    write_plan(folder / study, [(point, [f"dt={point.config['dt']}"]) for point in points])
    collate(points, folder / study)
    return points


def outdate(point: Point) -> None:
    """Leave a finished point as an older version of the source would have."""
    alter(point.folder / "record.json", source="another")


def spelt(table: Path) -> list[dict[str, str]]:
    """The rows of a table on disk, every value as it is spelt there."""
    parquet = table.suffix == ".parquet"
    text = pd.read_parquet(table).to_csv(index=False) if parquet else table.read_text()
    return list(csv.DictReader(io.StringIO(text)))


def summary(point: Point) -> dict[str, str]:
    """The point's own summary."""
    (only,) = spelt(point.folder / "summary.csv")
    return only


def ask(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, folder: Path, *words: str
) -> tuple[int, str, str]:
    """Exit status and output of the command line."""
    capsys.readouterr()
    monkeypatch.setattr(sys, "argv", ["results", *words, "--results", str(folder)])
    status = results.main()
    out, err = capsys.readouterr()
    return status, out, err


@pytest.fixture
def look(capsys, monkeypatch, tmp_path):
    return lambda *words: ask(capsys, monkeypatch, tmp_path, *words)


def row(text: str, start: str) -> list[str]:
    """The words of the line that starts so."""
    return next(line.split() for line in text.splitlines() if line.startswith(start))


def test_every_state_is_counted(settings: Settings, tmp_path: Path, look) -> None:
    done, stale = swept(settings, tmp_path, "s")
    outdate(stale)
    no_goal = dataclasses.replace(hopeless(settings), dt=0.25)
    failed = planned(no_goal, tmp_path)
    with pytest.raises(RuntimeError, match="no demonstration was kept"):
        computed(no_goal, tmp_path)
    running = planned(dataclasses.replace(settings, dt=0.2), tmp_path)
    running.folder.mkdir()
    missing = planned(dataclasses.replace(settings, dt=0.1), tmp_path)
    points = [done, stale, failed, running, missing]
    write_plan(tmp_path / "s", [(point, [f"dt={point.config['dt']}"]) for point in points])
    tables = sorted(path.name for path in (tmp_path / "s" / "tables").iterdir())
    assert {path.name for path in done.folder.glob("*.csv")} < set(tables)
    with running.lock:
        status, out, _ = look("list")
        assert status == 0
        assert row(out, "study") == [
            *("study", "points", "done", "stale", "failed", "running", "missing", "shipped"),
            "tables",
        ]
        assert row(out, "s ") == ["s", "5", "1", "1", "1", "1", "1", "0", str(len(tables))]
        _, out, _ = look("list", "s")
        for point, state in zip(
            points, ["done", "stale", "failed", "running", "missing"], strict=True
        ):
            line = row(out, point.identity[:12])
            assert line[1:3] == [state, f"dt={point.config['dt']}"]
        _, out, _ = look("list", "s", "--state", "failed", "--state", "stale")
        assert [line.split()[0] for line in out.splitlines()[1:]] == [
            stale.identity[:12],
            failed.identity[:12],
        ]
    _, out, _ = look("show", failed.identity[:12])
    assert out.count("no demonstration was kept: of 6 trials") == 2  # the failure, and the log
    assert "Traceback" not in out


@pytest.mark.parametrize(
    ("conditions", "dts"),
    [
        (["dt<=0.5"], [0.5]),
        (["dt>0.5"], [1.0]),
        (["dt=1,0.5"], [0.5, 1.0]),
        (["dt!=1"], [0.5]),
        (["truth=wall", "cells>=96", "actions=3"], [0.5, 1.0]),
        (["grid.shape=[12,8]", "truth.name=wall", "cells_crossed<2"], [0.5]),
        (["system.target=mlci.systems.DoubleIntegrator", "dt<1"], [0.5]),
        (["safety.margin=null", "dt>=1"], [1.0]),
    ],
)
def test_query_finds_by_config_and_summary(
    conditions: list[str], dts: list[float], settings: Settings, tmp_path: Path, look
) -> None:
    points = swept(settings, tmp_path, "s")
    crossed = {point.config["dt"]: float(summary(point)["cells_crossed"]) for point in points}
    assert crossed[0.5] < 2 < crossed[1.0]
    status, out, _ = look("query", *conditions)
    assert status == 0
    for point in points:
        assert (point.identity[:12] in out) == (point.config["dt"] in dts)


def test_show_tells_config_record_and_results(settings: Settings, tmp_path: Path, look) -> None:
    points = swept(settings, tmp_path, "s")
    status, out, _ = look("show", points[0].identity[:9])
    assert status == 0
    assert row(out, "  grid.shape") == ["grid.shape", "[12,", "8]"]
    assert row(out, "  packages.numpy") == ["packages.numpy", np.__version__]
    error = summary(points[0])["final_state_error"]
    assert 0 < float(error) < 1
    assert row(out, "  final_state_error") == ["final_state_error", error]
    log = (points[0].folder / "log.txt").read_text().splitlines()
    assert log[0].startswith("answer          ")
    assert "demonstrations  5 of 6 kept" in "\n".join(log)
    assert out.splitlines()[-len(log) - 1 :] == ["log", *(f"  {line}" for line in log)]
    _, out, _ = look("show", "s")
    assert "s: 2 points: 2 done" in out
    assert row(out, "  dt ") == ["dt", "1.0,", "0.5"]


def test_diff_shows_what_differs_and_nothing_else(settings: Settings, tmp_path: Path, look) -> None:
    one, two = swept(settings, tmp_path, "s")
    alter(two.folder / "record.json", python="3.99", peak_memory_mb=1)
    status, out, _ = look("diff", one.identity[:12], two.identity[:12])
    assert status == 0
    assert "config: 1 differs" in out
    assert row(out, "  dt") == ["dt", "1.0", "0.5"]
    assert row(out, "  python")[2] == "3.99"
    errors = [summary(point)["final_state_error"] for point in (one, two)]
    assert errors[0] != errors[1]
    assert row(out, "  final_state_error") == ["final_state_error", *errors]
    assert "trials.csv" in out
    assert "attempts.csv" not in out
    assert summary(one)["pairs"] == summary(two)["pairs"]
    assert "  pairs" not in out
    assert "grid.shape" not in out
    assert "packages.numpy" not in out


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_export_is_one_exact_table(form: str, settings: Settings, tmp_path: Path, look) -> None:
    points = swept(settings, tmp_path, "s")
    out = tmp_path / f"all.{form}"
    status, text, _ = look("export", "s", "--format", form, "--out", str(out))
    assert status == 0
    assert "2 rows" in text
    table = pd.read_csv(out) if form == "csv" else pd.read_parquet(out)
    assert table["point"].tolist() == [point.identity for point in points]
    assert table["config.dt"].tolist() == table["dt"].tolist() == [1.0, 0.5]
    assert set(table["state"]) == {"done"}
    assert all(0 < error < 1 for error in table["final_state_error"].tolist())
    assert_holds(out, [point.folder / "summary.csv" for point in points])
    look("export", "s", "--format", form, "--out", str(out), "--table", "trials")
    assert_holds(out, [point.folder / "trials.csv" for point in points])


def assert_holds(table: Path, parts: list[Path]) -> None:
    """The table's rows are exactly those of its parts, in turn, beside other columns."""
    rows = [row for part in parts for row in spelt(part)]
    assert len({row["final_state_error"] for row in rows} - {""}) > 1
    assert [{key: line[key] for key in rows[0]} for line in spelt(table)] == rows


def test_export_to_the_terminal_is_csv(settings: Settings, tmp_path: Path, look) -> None:
    swept(settings, tmp_path, "s")
    _, out, _ = look("export", "s")
    assert len(pd.read_csv(io.StringIO(out))) == 2


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["status", "smoek"], "did you mean smoke?"),
        (["show", "zz"], "no such study or point"),
        (["show", "0" * 31], "no such study or point"),
        (["list", "smoek"], "did you mean smoke?"),
        (["export", "smoke", "--table", "trails"], f"no such table; there are {TABLES}"),
        (["export", "smoke", "--format", "parquet"], "needs --out"),
        (["diff", "smoke", "smoke"], "is a study"),
        (["query", "dtt=1"], "did you mean dt?"),
        (["query", "dt<"], "cannot be read"),
        (["query", "dt=7"], "no finished point has dt=7"),
        (["query", "dt!=1,0.5"], "no finished point has dt!=1,0.5"),
    ],
)
def test_mistakes_are_told_in_a_line(
    words: list[str], told: str, settings: Settings, tmp_path: Path, look
) -> None:
    swept(settings, tmp_path, "smoke")
    status, out, err = look(*words)
    assert status == 2
    assert out == ""
    assert told in err
    assert len(err.splitlines()) == 1


def test_beginning_of_several_points_is_refused(settings: Settings, tmp_path: Path, look) -> None:
    for name in (f"abc{number:029}" for number in (1, 2)):
        (tmp_path / "points" / name).mkdir(parents=True)
    status, _, err = look("show", "abc")
    assert status == 2
    assert "2 points begin so" in err


def everything(folder: Path) -> set[Path]:
    """All files but locks and what is in the trash."""
    inside = {path for path in folder.rglob("*") if path.is_file()}
    return {path for path in inside if path.relative_to(folder).parts[0] not in (".locks", "trash")}


def test_clean_removes_what_no_study_uses_and_only_when_told(
    settings: Settings, tmp_path: Path, look
) -> None:
    swept(settings, tmp_path, "s")
    old, new = tmp_path / "s" / "tables" / ".a.csv-x.part", tmp_path / "store" / ".b-y.part"
    for path in (old, new):
        path.write_text("half")
    os.utime(old, (time.time() - 7200,) * 2)
    used = everything(tmp_path) - {old}
    loose = finished(settings, tmp_path, seed=5)
    before = everything(tmp_path)
    status, out, _ = look("clean")
    assert status == 0
    assert everything(tmp_path) == before
    assert f"unused: point {loose.identity[:12]}, in no study" in out
    stored = json.loads((loose.folder / "record.json").read_text())["stages"]["demonstrations"]
    assert f"unused: stored demonstrations {stored[:12]}" in out
    assert out.count("unused:") == 3
    look("clean", "--yes")
    assert everything(tmp_path) == used
    assert not loose.folder.exists()
    (moved,) = (tmp_path / "trash").iterdir()
    assert (moved / "points" / loose.identity / "record.json").exists()
    _, out, _ = look("clean", "--yes")
    assert out == "nothing to clean\n"
    status, out, _ = look("empty-trash")
    assert status == 0
    assert out.startswith(f"removed: {moved} (")
    assert not moved.exists()


def test_clean_keeps_a_running_point_and_then_the_store(
    settings: Settings, tmp_path: Path, look
) -> None:
    swept(settings, tmp_path, "s")
    loose = finished(settings, tmp_path, seed=5)
    before = everything(tmp_path)
    with loose.lock:
        _, out, _ = look("clean")
        assert "unused" not in out
        _, out, _ = look("clean", "--yes")
    assert "it is running" in out
    assert everything(tmp_path) >= before


def test_clean_keeps_points_of_old_tables_and_the_store_of_unfinished_studies(
    settings: Settings, tmp_path: Path, look
) -> None:
    swept(settings, tmp_path, "s")
    missing = planned(dataclasses.replace(settings, dt=0.1), tmp_path)
    write_plan(tmp_path / "s", [(missing, ["dt=0.1"])])
    loose = finished(settings, tmp_path, seed=5)
    before = everything(tmp_path)
    _, out, _ = look("clean", "--yes")
    assert "the store is kept" in out
    assert before - everything(tmp_path) == set(
        path for path in before if loose.folder in path.parents
    )


def test_clean_refuses_when_it_cannot_know(settings: Settings, tmp_path: Path, look) -> None:
    swept(settings, tmp_path, "s")
    finished(settings, tmp_path, seed=5)
    (tmp_path / "s" / "study.json").write_text("{")
    before = everything(tmp_path)
    status, _, err = look("clean", "--yes")
    assert status == 2
    assert "study.json cannot be read" in err
    assert everything(tmp_path) == before
    status, out, _ = look("list")
    assert status == 0
    assert "study.json cannot be read" in out


def drawn(folder: Path) -> None:
    """A figure of the table `trials`, as far as its note goes."""
    (folder / "figures").mkdir()
    for suffix in ("png", "pdf", "txt"):
        (folder / "figures" / f"curve.{suffix}").write_text("drawn")
    data = (folder / "tables" / "trials.csv").read_bytes()
    note = figure_note(folder / "figures" / "curve", "rank_curve", {"trials.csv": data})
    write_note(folder, {"curve": note})


def test_status_is_up_to_date_after_a_sweep(settings: Settings, tmp_path: Path, look) -> None:
    swept(settings, tmp_path, "s")
    _, out, _ = look("status")
    assert "figures not drawn" in out
    drawn(tmp_path / "s")
    status, out, _ = look("status", "s")
    assert status == 0
    assert out.splitlines() == [
        "s: 2 points: 2 done",
        "  tables  up to date",
        "  figure  curve: up to date",
    ]


def test_figures_alike_share_a_line_that_fits(
    settings: Settings, tmp_path: Path, look, monkeypatch: pytest.MonkeyPatch
) -> None:
    swept(settings, tmp_path, "s")
    folder = tmp_path / "s"
    drawn(folder)
    data = (folder / "tables" / "trials.csv").read_bytes()
    notes = {}
    for name in ("curve", "map"):
        for suffix in ("png", "pdf", "txt"):
            (folder / "figures" / f"{name}.{suffix}").write_text("drawn")
        notes[name] = figure_note(folder / "figures" / name, "rank_curve", {"trials.csv": data})
    write_note(folder, notes)
    monkeypatch.setattr("experiments.results.terminal_width", lambda: 30)
    assert look("status", "s")[1].splitlines()[2:] == [
        "  figures curve, map: up to",
        "          date",
    ]


@pytest.mark.parametrize(
    ("harm", "tables", "figure"),
    [
        ("alter", "table trials.csv was changed", "table trials.csv has changed since"),
        ("remove", "table trials.csv is missing", "table trials.csv is missing"),
        ("unplot", None, "curve.pdf is missing"),
        ("retype", None, "curve.txt was changed after it was drawn"),
        ("edit", None, "the code that draws has changed since"),
        ("stale", "2 points are stale", "2 points are stale"),
        ("rerun", "points have run again since", None),
        ("replan", "other points than the study's last sweep", "1 point is missing"),
        ("rename", "the study's last sweep was stopped before it wrote them", None),
    ],
)
def test_status_tells_why_not(
    harm: str,
    tables: str | None,
    figure: str | None,
    settings: Settings,
    tmp_path: Path,
    look,
) -> None:
    points = swept(settings, tmp_path, "s")
    drawn(tmp_path / "s")
    table = tmp_path / "s" / "tables" / "trials.csv"
    if harm == "alter":
        table.write_text(table.read_text() + "1\n")
    elif harm == "remove":
        table.unlink()
    elif harm == "unplot":
        (tmp_path / "s" / "figures" / "curve.pdf").unlink()
    elif harm == "retype":
        (tmp_path / "s" / "figures" / "curve.txt").write_text("by hand")
    elif harm == "edit":
        note = tmp_path / "s" / "figures" / "figures.json"
        (curve,) = read_sealed(note)["figures"].values()
        alter(note, figures={"curve": {**curve, "drawn_by": "another"}})
    elif harm == "stale":
        for point in points:
            outdate(point)
        collate(points, tmp_path / "s")
    elif harm == "rerun":
        computed(dataclasses.replace(settings, dt=1.0), tmp_path, force=True)
    elif harm == "rename":
        write_plan(tmp_path / "s", [(point, ["case=other"]) for point in points])
    else:
        missing = planned(dataclasses.replace(settings, dt=0.1), tmp_path)
        write_plan(tmp_path / "s", [(missing, [])])
    _, out, _ = look("status")
    for start, told in (("  tables", tables), ("  figure", figure)):
        line = next(line for line in out.splitlines() if line.startswith(start))
        if told is None:
            assert line.endswith("up to date")
            assert "not up to date" not in line
        else:
            assert "not up to date: " in line
            assert told in line


@pytest.mark.parametrize("words", [[], ["inference.calibrate=false"], ["inference=paper"]])
def test_infer_on_a_points_recorded_files_gives_its_ranking_back(
    tmp_path: Path, look, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    """With goals that are ranges, which the ends of the paths do not tell; and of controls."""
    monkeypatch.setenv("HOME", str(tmp_path))
    words = [*words, "hypotheses.controls.shares=[0.5]"]
    calibrated = len(words) == 1
    of_point = [word for word in TINY if not word.startswith("inference")]
    goal = "tasks.goal=[0.6,null]"
    point = computed(read_config(composed(*of_point, goal, *words))[0], tmp_path)
    folder = tmp_path / "recorded"
    status, out, _ = look("demonstrations", point.identity[:8], "--out", str(folder))
    assert status == 0
    trials = pd.read_csv(point.folder / "trials.csv")["trial"]
    assert f"{len(trials)} demonstrations into {folder}" in out
    expected = [f"trial_{i:03d}" for i in trials]
    assert sorted(path.stem for path in folder.iterdir() if path.is_file()) == expected
    assert (folder / "calibration").exists() == calibrated
    model = ["system=double_integrator", "dt=0.5", "actions=3", "grid.shape=[12,8]"]
    done = run_here(
        infer.main, "demonstrations=~/recorded", f"results={tmp_path / 'else'}", *model, *words,
        folder=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert ("calibrated by the tasks of the point" in done.stderr) == calibrated
    (written,) = (tmp_path / "else" / "inference").iterdir()
    ranking, expected = (pd.read_csv(each / "hypotheses.csv") for each in (written, point.folder))
    # To the last digit that a point writes.
    pd.testing.assert_frame_equal(rounded(ranking), expected[ranking.columns], check_exact=True)
    assert ranking["gain"].max() > 0.1
    ranges, expected = (pd.read_csv(each / "controls.csv") for each in (written, point.folder))
    pd.testing.assert_frame_equal(rounded(ranges), expected[ranges.columns], check_exact=True)


def test_a_point_that_is_named_by_its_folder_is_found_wherever_it_is(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    point = finished(settings, tmp_path / "else")
    (tmp_path / "link").symlink_to(point.folder)
    monkeypatch.chdir(tmp_path)
    out = str(tmp_path / "recorded")
    for words in (
        ("show", str(point.folder)),
        ("show", f"else/points/{point.identity}/"),
        ("show", "link"),
        ("demonstrations", str(point.folder), "--out", out),
        ("diff", str(point.folder), point.identity[:8]),
    ):
        monkeypatch.setattr(sys, "argv", ["results", *words])
        assert results.main() == 0, capsys.readouterr()
    assert "demonstrations into" in capsys.readouterr().out
    elsewhere = tmp_path / "points"
    elsewhere.mkdir()
    monkeypatch.setattr(sys, "argv", ["results", "show", str(elsewhere / "abc")])
    assert results.main() == 2


def test_a_point_s_page_has_its_ranking_and_its_truth(
    settings: Settings, tmp_path: Path, look
) -> None:
    point, out = finished(settings, tmp_path), tmp_path / "point.html"
    status, words, err = look("page", point.identity[:8], "--out", str(out))
    assert (status, err) == (0, "")
    assert f"written: {out}" in words
    text = out.read_text()
    data = json.loads(re.search(r'id="data">(.*?)</script>', text)[1])
    table = pd.read_csv(point.folder / "hypotheses.csv")
    assert data["rank"][-1] == table["rank"].tolist()
    chances = np.where(np.array(data["chance"][-1]) < 0, 0, data["chance"][-1])
    np.testing.assert_allclose(chances / 1000, table["posterior"], atol=5.1e-4)
    assert "Forbidden in truth: position" in text
    assert 'class="truth"' in text
    outdate(point)
    status, _, err = look("page", point.identity, "--out", str(out))
    assert status == 2
    assert "the source has changed since it ran; run it again first" in err
    missing = planned(dataclasses.replace(settings, dt=0.1), tmp_path)
    missing.folder.mkdir()
    status, _, err = look("page", missing.identity)
    assert status == 2
    assert "has not finished; run it first" in err


def test_demonstrations_that_are_not_there_are_told(
    settings: Settings, tmp_path: Path, look
) -> None:
    point = finished(settings, tmp_path)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a.csv").touch()
    folder = str(tmp_path / "out")
    for name, out, message in (
        (planned(dataclasses.replace(settings, dt=0.1), tmp_path).identity, folder, "no such"),
        (point.identity, str(tmp_path / "full"), "is not empty"),
    ):
        status, _, err = look("demonstrations", name, "--out", out)
        assert status == 2
        assert message in err
    calibrated = ["inference.calibrate=true", "demonstrations.goal_tolerance=1.0"]
    other = computed(read_config(composed(*TINY, *calibrated))[0], tmp_path)
    for stage, identity, what in (
        ("forecasts", other.identity, "calibration is"),
        ("demonstrations", point.identity, "demonstrations are"),
    ):
        shutil.rmtree(tmp_path / "store" / stage)
        status, _, err = look("demonstrations", identity, "--out", folder)
        assert status == 2
        assert f"its stored {what} gone; run it again" in err
    (point.folder / "record.json").unlink()
    status, _, err = look("demonstrations", point.identity, "--out", folder)
    assert "has not finished" in err
    assert not Path(folder).exists()


@pytest.mark.parametrize("name", ["", *results._EXAMPLES])
def test_help_fits_the_terminal_and_its_examples_can_be_typed(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    parser = results._parser()
    with pytest.raises(SystemExit):
        parser.parse_args([*name.split(), "--help"])
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    examples = re.findall(r"  python experiments/results\.py (.*)", text)
    assert len(examples) == 3
    for example in examples:
        assert parser.parse_args(shlex.split(example)).command


def test_clean_passes_over_a_report_of_studies_that_have_not_run(
    settings: Settings, tmp_path: Path, look
) -> None:
    swept(settings, tmp_path, "s")
    (tmp_path / "paper").mkdir()
    for name in ("REPORT.md", "REPORT.html", "report.json"):
        (tmp_path / "paper" / name).write_text("{}")
    assert look("clean") == (0, "nothing to clean\n", "")
    (tmp_path / "paper" / "mine").touch()
    status, _, err = look("clean")
    assert status == 2
    assert "paper: has no study.json" in err


@pytest.mark.parametrize("harm", ["renamed", "link", "file"])
def test_clean_fails_closed(harm: str, settings: Settings, tmp_path: Path, look) -> None:
    swept(settings, tmp_path, "s")
    loose = finished(settings, tmp_path, seed=5)
    if harm == "renamed":
        (tmp_path / "s" / "study.json").rename(tmp_path / "s" / "study.json.bak")
    elif harm == "link":
        (tmp_path / "elsewhere" / "a").mkdir(parents=True)
        (tmp_path / "points" / ("0" * 32)).symlink_to(tmp_path / "elsewhere")
        (tmp_path / "elsewhere" / "study.json").touch()
    else:
        (tmp_path / "points" / "mine").write_text("a file")
    before = everything(tmp_path)
    status, out, err = look("clean", "--yes")
    assert (status, out) == (2, "")
    assert err.startswith("nothing is cleaned:")
    assert everything(tmp_path) == before
    assert loose.record()


def test_clean_waits_while_a_sweep_lists_its_points(
    settings: Settings, tmp_path: Path, look
) -> None:
    """What a plan has just come to name is kept, whatever was read before."""
    point = finished(settings, tmp_path, seed=5)
    archive = Archive(tmp_path)
    assert archive.points
    assert not archive.studies
    write_plan(tmp_path / "s", [(point, ["seed=5"])])
    assert list(clean(archive, remove=True)) == ["nothing to clean"]
    assert point.record()


def test_examples_name_points_that_exist() -> None:
    assert CHECKOUT is not None
    texts = [(CHECKOUT / "experiments" / "README.md").read_text(), str(results._EXAMPLES)]
    names = {name for text in texts for name in re.findall(r"\b(?=\w*\d)[0-9a-f]{6}\b", text)}
    points = json.loads((CHECKOUT / "results" / "paper" / "study.json").read_bytes())["points"]
    assert names
    for name in names:
        assert len([point for point in points if point.startswith(name)]) == 1, name
