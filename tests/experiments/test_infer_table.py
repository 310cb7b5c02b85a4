"""`infer.py table=FILE`: the grid of experiments/README.md, a world of chance, and wrong files."""

from __future__ import annotations

import json
import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import run_here
from toy_tables import chancy_world

from experiments import infer as command

README = Path(__file__).parents[2] / "experiments" / "README.md"
# After each constraint, of Scobee and Sastry's code.
KL = [24.623707798, 16.706309105, 12.055524120, 7.661890326, 2.724126394]
KL += [1.513969539, 0.862539251, 0.402498614, 0.054855427]


def infer(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return run_here(command.main, f"results={folder / 'results'}", *words, folder=folder)


def saved(folder: Path) -> Path:
    (only,) = (folder / "results" / "inference").iterdir()
    return only


def test_the_readmes_grid_gives_the_published_sequence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    section = README.read_text().split("## A finite world")[1].split("\n## ")[0]
    blocks = {
        kind: re.search(rf"```{kind}\n(.*?)```", section, re.DOTALL)[1]  # type: ignore[index]
        for kind in ("python", "yaml", "bash", "text")
    }
    monkeypatch.chdir(tmp_path)
    exec(blocks["python"], {})
    (tmp_path / "grid" / "world.yaml").write_text(blocks["yaml"])
    done = infer(tmp_path, *blocks["bash"].split()[2:])
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(blocks["text"])
    answer = json.loads((saved(tmp_path) / "answer.json").read_text())
    added = ["action 5", "green", "state 31", "state 39", "state 47", "state 37", "state 54"]
    assert answer["selection"]["added"] == [*added, "action 3", "action 4"]
    np.testing.assert_allclose(answer["selection"]["kl"][1:], KL, atol=1e-8)
    assert answer["first"]["hypothesis"] == "action 5"
    assert answer["demonstrations"][0]["moves"] == 14
    assert "state 8" in answer["demonstrations"][0]["violates"]
    selection = pd.read_csv(saved(tmp_path) / "selection.csv")
    np.testing.assert_allclose(selection["kl"], KL, atol=1e-8)
    hypotheses = pd.read_csv(saved(tmp_path) / "hypotheses.csv")
    total = hypotheses["posterior"].sum() + answer["posterior_none"]
    assert len(hypotheses) == 91
    assert total == pytest.approx(1)


def chancy_files(folder: Path, changes: str = "") -> None:
    """The world of chance: moves in numpy's form, and two paths of 4 steps."""
    table = chancy_world()
    np.savez(folder / "moves.npz", transitions=table.transitions.toarray().reshape(5, 3, 5),
             reward=table.reward)  # fmt: skip
    lines = "moves: moves.npz\nstart: {0: 0.5, 4: 0.5}\nhorizon: 4\n"
    sets = "hypotheses: {each: [states], sets: {risk: {moves: [[1, 0], [2, 0]]}}}\n"
    changed = {line.partition(":")[0] for line in changes.splitlines()}
    kept = [line for line in (lines + sets).splitlines() if line.partition(":")[0] not in changed]
    (folder / "world.yaml").write_text("\n".join([*kept, changes]))
    rows = (
        "trial,state,action\n1,0,0\n1,1,2\n1,4,1\n1,0,2\n1,2,\n2,4,0\n2,0,2\n2,2,2\n2,4,1\n2,0,\n"
    )
    (folder / "paths.csv").write_text(rows)


def test_where_chance_decides_the_command_says_which_model_it_takes(tmp_path: Path) -> None:
    chancy_files(tmp_path)
    done = infer(tmp_path, "table=world.yaml", "demonstrations=paths.csv")
    assert done.returncode == 0, done.stderr
    words = " ".join(done.stdout.split())
    assert "several are not selected: the KL divergence is of trajectories" in words
    assert "maximum causal entropy for 4 steps; evidence is the ratio of two" in words
    answer = json.loads((saved(tmp_path) / "answer.json").read_text())
    assert answer["selection"] is None
    assert answer["first"]["hypothesis"] == "state 3"
    assert not (saved(tmp_path) / "selection.csv").exists()


def test_a_path_that_cannot_be_used_is_told_and_the_status_is_1(tmp_path: Path) -> None:
    chancy_files(tmp_path)
    with (tmp_path / "paths.csv").open("a") as file:
        file.write("3,2,0\n3,4,\n")
    done = infer(tmp_path, "table=world.yaml", "demonstrations=paths.csv")
    assert done.returncode == 1
    assert "paths.csv, trial 3: line 12: the path begins in state '2', where the" in done.stderr
    assert "2 used, 1 not used" in done.stdout
    done = infer(tmp_path, "table=world.yaml", "demonstrations=nothing.csv")
    assert (done.returncode, done.stdout) == (1, "no demonstration could be used\n")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ("reward: -1\n", "world.yaml: reward: give one of all moves here, or rewards in moves.npz"),
        ("goals: [7]\n", "world.yaml: goals: there is no state '7'; there are 0, 1, 2, 3, 4"),
        ("gaols: [4]\n", "world.yaml: gaols: unknown key; did you mean goals?"),
        ("horizon: 0\n", "world.yaml: horizon: 0 must be at least 1"),
        ("discount: 2\n", "world.yaml: discount: 2.0 must be at most 1"),
        ("moves: none.csv\n", "none.csv: there is no such file"),
        ("start: 9\n", "world.yaml: start: there is no state '9'"),
        (
            "start: {0: 0.5}\n",
            "world.yaml: start: probabilities must add up to 1, not 0.5; write a state",
        ),
        ("hypotheses: {each: []}\n", "world.yaml: hypotheses: there are none"),
        ("hypotheses: {sets: {a: {}}}\n", "hypotheses.sets.a: forbids nothing; give states"),
        ("hypotheses: {sets: {state 1: {states: [1]}}}\n", "of `each` has this name; take another"),
        ("hypotheses: {sets: {a: {actions: [x]}}}\n", "hypotheses.sets.a: there is no action 'x'"),
        ("horizon: [\n", "not valid YAML"),
        ("horizon: null\n", "world.yaml: goals: there are none, so that no path ends; give goals"),
        (
            "horizon: null\ngoals: 3\nstart: 1\nmoves: traps.csv\nreward: -1\n",
            "world.yaml: goals: none can be reached from state '1', where the start leads",
        ),
        (
            "horizon: null\ngoals: 3\nstart: 0\nmoves: chance.csv\nreward: -1\n",
            "world.yaml: goals: none can be reached from state '1', where the start leads",
        ),
        (
            "horizon: 1000000\nmoves: many.csv\nstates: 100000\nreward: -1\nstart: 0\n",
            "world.yaml: horizon: 1000000 moves among 100000 states take about 2.4e+03 GB",
        ),
        ("moves: ''\n", "world.yaml: moves: '' is empty"),
        ("moves: .\n", "is not a file"),
        ("moves: folder.npz\n", "folder.npz: is not a file"),
        ("moves: pipe.csv\n", "pipe.csv: is not a file"),
        ('moves: "a\\0b"\n', "cannot be read (embedded null byte)"),
        (
            "start: 1\nmoves: complex.npz\n",
            "complex.npz: has a reward of complex128, not of numbers",
        ),
        ("start: null\n", "world.yaml: start: None is no name; write a word or a whole number"),
        ("goals: 3.5\n", "world.yaml: goals: 3.5 is no name; write a word"),
        ("start: on\n", "world.yaml: start: there is no state 'on'"),
        ("start: 010\n", "world.yaml: start: there is no state '10'"),
        ("temperature: 1e-320\n", "rewards over temperature must lie within 1e+09 nat"),
        (
            "start: {0: 0.5, 4: 0.5}\nstart: 1\n",
            "line 5: not valid YAML (start stands in line 4 too",
        ),
        ("start: {0: 0.5, 0: 0.5}\n", "(0 stands in line 4 too; keep one)"),
        ("start: {[0]: 1}\n", "not valid YAML (a key must be a word or a number)"),
        ("goals: &a [*a]\n", "line 5: not valid YAML (*a refers to another place; write it out)"),
        ("goals: !!int x\n", "not valid YAML (invalid literal for int()"),
        ("goals: " + "[" * 3000 + "]" * 3000 + "\n", "world.yaml: is nested too deeply"),
        (
            "hypotheses: {sets: {a: {state: [1]}}}\n",
            "sets.a.state: unknown key; did you mean states?",
        ),
        (
            "hypotheses: {sets: {a: {moves: [[0, 0, 1]]}}}\n",
            "moves[0]: [0, 0, 1] has 3 entries; give 2",
        ),
        ("hypotheses: {sets: {a: {moves: [[0]]}}}\n", "moves[0]: [0] has too few entries; give 2"),
        (
            "moves: many.csv\nreward: -1\nstart: 0\nhypotheses: {sets: {a: {moves: [[1, 0]]}}}\n",
            "sets.a: there is no move '0' in '1'",
        ),
        ('hypotheses: {sets: {"a\\nb": {states: [1]}}}\n', "'a\\nb' is no name; write a word"),
        ('hypotheses: {sets: {"\\ud800": {states: [1]}}}\n', "'\\ud800' is no name; write a word"),
    ],
)
def test_worlds_that_cannot_be_taken(tmp_path: Path, changes: str, message: str) -> None:
    chancy_files(tmp_path, changes)
    (tmp_path / "folder.npz").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    np.savez(tmp_path / "complex.npz", successor=[[1], [0]], reward=np.array(1j))
    head = "state,action,next\n"
    (tmp_path / "traps.csv").write_text(
        head + "".join(f"{s},{a},{s}\n" for s in range(4) for a in "01")
    )
    (tmp_path / "many.csv").write_text(head + "0,0,1\n")
    (tmp_path / "chance.csv").write_text(
        "state,action,next,probability\n0,0,1,0.5\n0,0,3,0.5\n1,0,1,1\n"
    )
    done = infer(tmp_path, "table=world.yaml", "demonstrations=paths.csv")
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())


def test_other_things_that_are_wrong_with_the_command_line(tmp_path: Path) -> None:
    done = infer(tmp_path, "table=none.yaml", "demonstrations=paths.csv")
    assert done.returncode == 2
    assert "none.yaml: cannot be read (No such file or directory)" in done.stderr
    (tmp_path / "list.yaml").write_text("- 1\n")
    done = infer(tmp_path, "table=list.yaml", "demonstrations=paths.csv")
    assert "list.yaml: holds no keys with values, such as moves: moves.csv" in done.stderr
    done = infer(tmp_path, "table=list.yaml", "demonstrations=paths.csv", "grid=400")
    assert done.returncode == 2
    assert "grid" in done.stderr
    (tmp_path / "latin.yaml").write_bytes(b"moves: m\xfcll\n")
    done = infer(tmp_path, "table=latin.yaml", "demonstrations=paths.csv")
    assert "latin.yaml: byte 8 is not UTF-8; save it as UTF-8" in done.stderr
    done = infer(tmp_path, "table=", "demonstrations=")
    assert done.returncode == 2
    assert "table: empty; name the file of a world" in done.stderr
    assert "demonstrations: empty; name a folder, a pattern or a file" in done.stderr
    done = infer(tmp_path, "table=~nobody_of_that_name/w.yaml", "demonstrations=paths.csv")
    assert "w.yaml: cannot be read (Could not determine home directory.)" in done.stderr
    done = infer(tmp_path, f"table={tmp_path}", "demonstrations=paths.csv")
    assert ": is not a file" in done.stderr
