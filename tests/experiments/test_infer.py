"""The command for recorded demonstrations, on files that are written here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import run_here

from experiments import infer as command
from mlci.demonstrations import Demonstration
from mlci.demonstrator import Outcome, demonstrate, sample_trials
from mlci.grids import Grid
from mlci.recordings.write import write_demonstration
from mlci.regions import Regions
from mlci.safety.reachability import solve_safe_set
from mlci.safety.safety_filter import SafetyFilter, border_margin
from mlci.spaces import Box
from mlci.systems import Pendulum

TRUTH = Regions(Pendulum().space, [[np.pi, 0.0]], [[1.2 * np.pi, 1.2]])


def infer(folder: Path, *overrides: str) -> subprocess.CompletedProcess[str]:
    """The command's end and words, in a folder; to be quick, evidence is not calibrated."""
    return run_here(
        command.main,
        f"results={folder / 'results'}",
        "inference.calibrate=false",
        "next_tasks.candidates=4",
        *overrides,
        folder=folder,
    )


def saved(folder: Path) -> Path:
    """The one folder that a command wrote."""
    (only,) = (folder / "results" / "inference").iterdir()
    return only


@pytest.fixture(scope="module")
def shown() -> list[Demonstration]:
    """Demonstrations of the pendulum under a truth, from the project's own demonstrator."""
    system = Pendulum()
    grid = Grid(system.space, (61, 61))
    omega = solve_safe_set(system, grid, TRUTH)
    margin = border_margin(system, omega, 0.02)
    box = Box(np.array([0.0, -2.0]), np.array([2 * np.pi, 2.0]))
    trials = sample_trials(
        system, omega, box, trials=24, seed=3, horizon=5.0, dt=0.02, margin=margin, restarts=1
    )
    attempts = demonstrate(
        system, trials, TRUTH, SafetyFilter(system, omega, 0.02, margin), dt=0.02
    )
    return [attempt.demonstration for attempt in attempts if attempt.outcome is Outcome.KEPT]


def write_recorded(folder: Path, demonstrations: list[Demonstration]) -> None:
    """Write a folder with recorded files."""
    (folder / "recorded").mkdir()
    for demonstration in demonstrations:
        path = folder / "recorded" / f"{demonstration.name}.csv"
        write_demonstration(path, demonstration, Pendulum().space)


@pytest.fixture
def recorded(tmp_path: Path, shown: list[Demonstration]) -> Path:
    """A folder with the recorded files of some of them, as all take longer."""
    write_recorded(tmp_path, shown[:8])
    return tmp_path


def test_recorded_demonstrations_are_ranked_and_saved(
    tmp_path: Path, shown: list[Demonstration]
) -> None:
    write_recorded(tmp_path, shown)
    done = infer(tmp_path, "demonstrations=recorded", "grid=100", "dt=0.5", "top=3")
    assert done.returncode == 0, done.stderr
    folder = saved(tmp_path)
    hypotheses = pd.read_csv(folder / "hypotheses.csv")
    assert len(hypotheses) == 100
    truth = hypotheses[
        np.isclose(hypotheses["lower_angle"], np.pi)
        & np.isclose(hypotheses["lower_angular_velocity"], 0.0)
    ].iloc[0]
    assert truth["feasible"]
    assert truth["rank"] <= 5
    candidates = Regions.from_grid(Pendulum().space, (10, 10))
    violations = pd.read_csv(folder / "violations.csv").pivot(
        index="demonstration", columns="hypothesis", values="violated"
    )
    words = done.stdout.replace("*", "").split("hypotheses that each refutes")[1].split()
    refuted = " ".join(words)
    for demonstration in shown:
        expected = candidates.violated_by(demonstration.states)
        np.testing.assert_array_equal(violations.loc[demonstration.name], expected)
        numbers = " ".join(str(i) for i in np.flatnonzero(expected))
        assert f" {demonstration.name} {numbers} " in refuted
    best = hypotheses.sort_values(["rank", "hypothesis"]).iloc[0]
    assert f"{best['gain']:.3f}" in done.stdout
    assert (folder / "map.png").stat().st_size > 10_000
    page = (folder / "page.html").read_text()
    assert f"Region {best['hypothesis']:.0f} is the most likely to be avoided" in page
    assert f"page: {folder / 'page.html'}" in done.stdout
    assert "record next" in done.stdout
    assert "Of the tasks that could come next" in page
    answer = json.loads((folder / "answer.json").read_text())
    informations = [each["information"] for each in answer["next_tasks"]]
    assert len(informations) == 3
    assert all(information > 0 for information in informations)
    record = json.loads((folder / "record.json").read_text())
    assert record["config"]["dt"] == 0.5
    assert record["not_used"] == []


def test_a_bad_file_is_named_and_the_others_are_not_lost(recorded: Path) -> None:
    bad = recorded / "recorded" / "bad.csv"
    bad.write_text("time,angle,angular_velocity\n0,1,0\n0.01,inf,0\n0.02,1,0\n")
    done = infer(recorded, "demonstrations=[recorded]", "grid=100", "dt=0.5")
    assert done.returncode == 1
    assert "bad.csv: line 3" in done.stderr
    record = json.loads((saved(recorded) / "record.json").read_text())
    assert len(record["not_used"]) == 1


def test_the_temperature_is_told_on_demand(recorded: Path) -> None:
    coarse = ("demonstrations=recorded", "grid=100", "dt=0.5", "inference.calibrate=false")
    done = infer(recorded, *coarse, "estimate_temperature=true")
    assert done.returncode == 0, done.stderr
    assert "(the paths look" in " ".join(done.stdout.split())
    answer = json.loads((saved(recorded) / "answer.json").read_text())
    estimate = answer["temperature_estimate"]
    assert answer["sets"] is None
    assert estimate["lower"] <= estimate["temperature"] <= estimate["upper"]


def test_controls_and_sets_are_told_on_demand(recorded: Path) -> None:
    coarse = ("demonstrations=recorded", "grid=100", "dt=0.5", "inference.sets.largest=2")
    asked = "hypotheses.controls.ranges=[{lower: [1.4], upper: [null]}]"
    done = infer(recorded, *coarse, asked, "hypotheses.controls.shares=[0.25]")
    assert done.returncode == 0, done.stderr
    words = " ".join(done.stdout.split())
    assert "assumed at most one range is forbidden, and no region" in words
    folder = saved(recorded)
    table = pd.read_csv(folder / "controls.csv")
    record = json.loads((folder / "answer.json").read_text())["controls"]
    assert [each["name"] for each in record["ranges"]] == table["name"].tolist()
    above = next(each for each in record["ranges"] if each["lower"] == [1.4])
    assert above["upper"] == [None]
    # Applied where the recorded controls say so, as a mean over a time step.
    applied = 0
    for path in (recorded / "recorded").iterdir():
        controls = pd.read_csv(path)["control_1"].dropna().to_numpy()
        means = np.convolve(controls, np.full(25, 1 / 25), "valid")
        applied += bool(np.max(means) > 1.4 + 0.02 * 4)
    assert above["applied_by"] == applied
    page = (folder / "page.html").read_text()
    assert "If several regions may be avoided at once, the likeliest answer is" in page
    assert "That takes for granted: at most one range is forbidden" in page
    assert "Controls" in page


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("hypotheses.controls=[0.5]", "hypotheses.controls"),
        ("hypotheses.controls.shares=[2.0]", "hypotheses.controls.shares[0]: 2.0 must be below 1"),
        ("hypotheses.controls.ranges=[{lower: [0.5, 1], upper: [null]}]", "entries, one a control"),
        ("hypotheses.controls.ranges=[{lower: [0.6], upper: [0.9]}]", "none of the 9 actions"),
    ],
)
def test_ranges_of_controls_that_cannot_be_are_refused_at_once(
    tmp_path: Path, word: str, message: str
) -> None:
    done = infer(tmp_path, "demonstrations=nowhere", word)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (tmp_path / "results").exists()


def test_soft_or_hard_is_told_on_demand(recorded: Path) -> None:
    coarse = ("demonstrations=recorded", "grid=100", "dt=0.5", "inference.calibrate=false")
    done = infer(recorded, *coarse, "soft=2")
    assert done.returncode == 0, done.stderr
    answer = json.loads((saved(recorded) / "answer.json").read_text())
    first, second = answer["weights"]
    assert first["region"] == answer["first"]["region"] != second["region"]
    assert f"soft or hard? region {first['region']}, " in " ".join(done.stdout.split())
    refused = infer(recorded, *coarse, "soft=2", "transition.samples=200")
    assert refused.returncode == 2
    assert "soft: 2, but a weight needs every single move, and 36000000 are more" in refused.stderr


@pytest.mark.parametrize("largest", [2, 5])
def test_a_belief_over_sets_on_demand(recorded: Path, largest: int) -> None:
    """Pairs of a hundred hypotheses exactly, and sets of up to five from a sample, since with rule
    breaking no violation excludes any."""
    words = ["demonstrations=recorded", "grid=100", "dt=0.5", f"inference.sets.largest={largest}"]
    words += ["inference.rule_breaking=0.05", "inference.sets.steps=40"]
    done = infer(recorded, *words)
    assert done.returncode == 0, done.stderr
    sets = json.loads((saved(recorded) / "answer.json").read_text())["sets"]
    said = " ".join(done.stdout.split())
    assert "forbidden, alone or with others" in said
    assert sum(sets["sizes"]) == pytest.approx(1)
    assert 2 <= len(sets["sizes"]) <= largest + 1
    mean = sum(size * share for size, share in enumerate(sets["sizes"]))
    assert sum(sets["marginals"].values()) == pytest.approx(mean)
    assert sets["sizes"][0] == pytest.approx(sets["none"])
    assert (sets["sampled"] is None) == (largest == 2)
    if sets["sampled"] is not None:
        assert sets["sampled"]["effective_samples"] > 1
        assert "chains" in said


def test_durations_that_dt_does_not_divide(recorded: Path) -> None:
    done = infer(recorded, "demonstrations=recorded", "grid=100", "dt=0.3")
    assert done.returncode == 0, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("note: trial_0")
    assert line.endswith("more: its 5 s count as 17 steps of 0.3 s, 5.1 s")


def test_an_answer_that_nobody_reads_on_is_saved(recorded: Path) -> None:
    words = ["demonstrations=recorded", "results=results", "inference.calibrate=false"]
    script = Path(command.__file__)
    done = subprocess.run(
        f"{sys.executable} {script} {' '.join(words)} grid=100 dt=0.5 | true",
        shell=True,
        cwd=recorded,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},  # so that the first line finds no reader
        capture_output=True,
        timeout=600,
    )
    assert not done.stderr
    assert {file.name for file in saved(recorded).iterdir()} >= {"answer.json", "page.html"}


def test_the_same_states_at_other_times_are_another_result(recorded: Path) -> None:
    words = f"demonstrations={recorded / 'recorded'}", "grid=100", "dt=0.5"
    assert infer(recorded, *words).returncode == 0
    first = saved(recorded)
    for file in (recorded / "recorded").glob("*.csv"):
        table = pd.read_csv(file)
        table.assign(time=table["time"] * 1.2).to_csv(file, index=False)
    assert infer(recorded, *words).returncode == 0
    assert len(list(first.parent.iterdir())) == 2


def test_times_in_milliseconds_are_refused_at_once(recorded: Path) -> None:
    for path in (recorded / "recorded").iterdir():
        table = pd.read_csv(path)
        table.assign(time=table["time"] * 1000).to_csv(path, index=False)
    refused = infer(recorded, "demonstrations=recorded", "grid=100", "dt=0.5")
    assert refused.returncode == 1
    assert "lasts 5000 s, 10000 steps of 0.5 s: is time in ms?" in refused.stderr
    assert not (recorded / "results").exists()
    done = infer(recorded, "demonstrations=recorded", "grid=100", "dt=0.5", "time_unit=ms")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ([], "demonstrations: missing"),
        (["demonstrations=nowhere", "dtt=1"], "dtt: unknown key; did you mean dt?"),
        (["demonstrations=nowhere", "dt=0"], "dt: 0.0 must be above 0"),
        (["demonstrations=nowhere", "start=[1]"], "start: [1.0] must have 2 entries"),
        (["demonstrations=nowhere", "grid=7"], "grid: there is no 7"),
        (["demonstrations="], "demonstrations: empty; name a folder"),
        (["demonstrations=[]"], "demonstrations: empty; name a folder"),
        (["demonstrations=a", "units={angel: deg}"], "units: there is no angel; there are angle, "),
        (["demonstrations=a", "columns={angel: x}"], "columns: there is no angel; there are time"),
    ],
)
def test_a_wrong_command_gets_one_clear_error(
    tmp_path: Path, overrides: list[str], message: str
) -> None:
    done = infer(tmp_path, *overrides)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [None, "time,angle\n0,1\n1,2\n"])
def test_where_no_demonstration_can_be_used_each_file_is_told(
    tmp_path: Path, content: str | None
) -> None:
    if content is not None:
        (tmp_path / "a.csv").write_text(content)
    done = infer(tmp_path, "demonstrations=a.csv")
    assert done.returncode == 1
    assert "no demonstration could be used; the lines above say why" in done.stdout
    lacks = "there is no such file" if content is None else "has no column angular_velocity"
    assert f"not used: a.csv: {lacks}" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "results").exists()


def test_trials_of_one_file_with_copies_gaps_and_doubts(
    tmp_path: Path, shown: list[Demonstration]
) -> None:
    """The third is the first again, in the fourth the angle is in degrees, the last has a hole."""
    tables = []
    for number, which in enumerate([0, 1, 0, 2, 3]):
        states = shown[which].states * ([180 / np.pi, 1.0] if number == 3 else 1.0)
        table = pd.DataFrame(states, columns=list(Pendulum().space.names))
        tables.append(table.assign(time=shown[which].times, run=f"r{number}"))
    tables[1].loc[40, "angle"] = np.nan
    tables[4].loc[40:90, "angle"] = np.nan
    pd.concat(tables).sort_values("time", kind="stable").to_csv(tmp_path / "all.csv", index=False)
    ends = shown[1].states[[0, -1]]
    heads = ["trial", "goal_lower_angle", "goal_lower_angular_velocity"]
    heads += [head.replace("lower", "upper") for head in heads[1:]]
    corners = [ends[1, 0] - 0.1, -np.inf, ends[1, 0] + 0.1, np.inf]
    pd.DataFrame([["all_r1", *corners]], columns=heads).to_csv(tmp_path / "tasks.csv", index=False)
    words = ["demonstrations=all.csv", "grid=100", "dt=0.5", "group_by=run", "tasks=tasks.csv"]
    done = infer(tmp_path, *words, "crossing.time=0.05")
    assert done.returncode == 1
    assert "all.csv, trial r4: line " in done.stderr
    for note in (
        "5 trials by run",
        "all_r2: is a copy of all_r0, and is not counted",
        "trial r1: 1 missing values of angle are bridged",
        "tasks: has no row for all_r0, all_r2, all_r3, all_r4: start and goal are read off",
    ):
        assert note in done.stderr, note
    said = " ".join(done.stdout.split())
    assert "recordings 2 of 3 are plausible" in said
    assert "doubtful all_r3: angle moves 57.2 times faster than angular velocity says" in said
    folder = saved(tmp_path)
    answer = json.loads((folder / "answer.json").read_text())
    assert answer["crossing"] == {"depth": 0.0, "time": 0.05}
    assert [each["name"] for each in answer["recordings"]] == ["all_r0", "all_r1", "all_r3"]
    assert any("do not move as the dynamics allow: all_r3" in each for each in answer["warnings"])


def test_crossings_that_do_not_count_overstate_what_is_not_calibrated(recorded: Path) -> None:
    words = f"demonstrations={recorded / 'recorded'}", "grid=100", "dt=0.5"
    done = infer(recorded, *words, "crossing.depth=0.05")
    assert "note: crossing: shallow or short crossings of the recordings do not" in done.stderr
    assert "slightly overstated" in (saved(recorded) / "page.html").read_text()
    assert "overstated" not in infer(recorded, *words).stderr


def test_a_table_of_tasks_that_is_none_is_a_wrong_config(recorded: Path) -> None:
    for word in ("tasks=nowhere.csv", "tasks=recorded/trial_000.csv"):
        done = infer(recorded, "demonstrations=recorded", "grid=100", word)
        assert done.returncode == 2
        assert "tasks: " in done.stderr
