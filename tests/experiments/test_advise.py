"""The advisor's verdicts, against where the paper's sweep found the truth, and its messages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commands import run_here
from hydra import compose, initialize_config_dir

from experiments import advise as command
from experiments.advise import Candidate, advise, recommend
from experiments.app import version_base
from experiments.config.command_line import quote_options
from experiments.config.paths import CONF
from experiments.config.read import ConfigError, plain_tree, read_advice_config
from experiments.config.settings import AdviceSettings
from experiments.sweep.plugins import register_plugins
from mlci.diagnosis import MOST_FROZEN, MOST_UNREACHABLE, Diagnosis
from mlci.grids import Grid
from mlci.systems import Pendulum

register_plugins()


def settings(*words: str) -> AdviceSettings:
    with initialize_config_dir(str(CONF), **version_base()):
        config = compose("advise", [quote_options(word) for word in words])
    return read_advice_config(plain_tree(config))


def advice(*words: str) -> tuple[int, list[str]]:
    lines: list[str] = []
    status = advise(settings(*words), lines.append)
    return status, "\n".join(lines).splitlines()


def verdicts(lines: list[str]) -> dict[tuple[str, float, int], str]:
    """The table's verdicts by grid, time step and start points."""
    head = next(i for i, line in enumerate(lines) if line.startswith("grid "))
    place = lines[head].index("verdict"), lines[head].index("goals")
    found = {}
    for line in lines[head + 1 :]:
        if line.startswith("goals "):
            return found
        grid, _, dt, samples = line.split()[:4]
        found[grid, float(dt), int(samples)] = line[slice(*place)].strip()
    raise AssertionError("the table has no end")


def test_pendulum_discretisations_are_told_apart_as_the_sweep_tells_them() -> None:
    """The sweep finds the truth wherever it is accepted, and nowhere else (README's table)."""
    status, lines = advice("pairs=16")
    assert status == 0
    found = verdicts(lines)
    centres = {key[:2] for key, verdict in found.items() if key[2] == 1 and verdict == "rejected"}
    assert centres == {("10x10", 0.1), ("10x10", 0.2), ("10x10", 0.25), ("20x20", 0.1)}
    assert {verdict for verdict in found.values()} == {"accepted", "rejected"}
    # In-cell start points mend all four, and are tried only there.
    assert {key[:2] for key in found if key[2] == 3} == centres
    assert all(verdict == "accepted" for key, verdict in found.items() if key[2] == 3)
    assert len(found) == 4 * 5 + 4
    reason = next(i for i, line in enumerate(lines) if line.startswith("20x20, 0.1 s"))
    reasons = " ".join(" ".join(lines[reason : reason + 6]).split())
    assert "100% of the cells no action changes the angular velocity cell" in reasons
    assert "goals cannot be reached by the tabular agent" in reasons
    assert "samples=3" in reasons
    recommended = next(i for i, line in enumerate(lines) if line.startswith("recommended"))
    assert lines[recommended].endswith("grid.shape=[20,20] dt=0.25 transition.samples=1")
    assert "at most half as wide as the hypotheses" in " ".join(lines[recommended:])


def test_the_thresholds_part_the_papers_sweep() -> None:
    """Goals out of reach and frozen cells condemn the same points, but for one kind.

    The table beside this file has what the sweep of the default choices gave.
    """
    summary = pd.read_csv(Path(__file__).with_name("paper_sweep.csv"))
    lost = 1 - summary["reachable"] / summary["demonstrations"] > MOST_UNREACHABLE
    frozen = summary[["frozen_angle", "frozen_angular_velocity"]].max(axis=1) > MOST_FROZEN

    def kinds(condemned: pd.Series[bool], *columns: str) -> set[tuple[float, ...]]:
        return set(summary.loc[condemned, list(columns)].itertuples(index=False, name=None))

    assert kinds(frozen, "cells", "dt") == {(100, 0.1), (100, 0.2), (100, 0.25), (400, 0.1)}
    assert not (frozen & ~lost).any()
    assert kinds(lost & ~frozen, "cells", "dt", "actions") == {(1600, 1.0, 5)}
    assert kinds(~lost, "cells", "dt").isdisjoint(kinds(frozen, "cells", "dt"))


def test_tasks_beyond_the_control_range_do_not_count() -> None:
    """In 1 s the double integrator can move by little: most tasks cannot be done by any grid."""
    status, lines = advice(
        "system=double_integrator", "horizon=1", "dts=[0.5]", "grids=[[20,20]]", "pairs=60"
    )
    count = int(lines[0].split()[1])
    chosen = settings("system=double_integrator")
    lower, upper = np.array([-3, -1.0]), np.array([3, 1.0])
    able = 0
    for trial in range(60):
        rng = np.random.default_rng(np.random.SeedSequence(0, spawn_key=(trial,)))
        start, goal = rng.uniform(lower, upper), rng.uniform(lower, upper)
        # The least effort is u = p + q t with these two from the ends; its peak is at an end.
        gap, turn = goal[0] - start[0] - start[1], goal[1] - start[1]
        ends = np.array([6 * gap - 2 * turn, -6 * gap + 4 * turn])
        able += bool(np.max(np.abs(ends)) <= chosen.model.control_limit)
    assert 0 < able < 30
    assert abs(count - able) <= 1  # a task at the limit, which sampling may move
    assert status in (0, 1)


def candidate(shape: tuple[int, int], dt: float, **changes: object) -> Candidate:
    """A faultless one, but for the changes."""
    perfect = Candidate(
        Grid(Pendulum().space, shape), dt, 1, Diagnosis(0.0, 0.0, 3.0, (0.0, 0.0)),
        np.ones(20, dtype=bool), False, 0.1, 0.1,
    )  # fmt: skip
    return replace(perfect, **changes)  # type: ignore[arg-type]


def test_each_rule_of_the_recommendation_gives_way_to_the_one_before() -> None:
    unreached = np.arange(20) > 1
    slow, leaving = Diagnosis(0.0, 0.0, 1.0, (0.0, 0.0)), Diagnosis(0.0, 0.9, 3.0, (0.0, 0.0))
    best = candidate((20, 20), 0.25)
    worse = [
        candidate((5, 5), 0.1, reached=unreached),
        candidate((6, 6), 0.1, diagnosis=leaving),
        candidate((7, 7), 0.1, coarse=True),
        candidate((8, 8), 0.1, diagnosis=slow),
        candidate((20, 20), 0.5),
        candidate((30, 30), 0.1),
        candidate((15, 15), 0.1, samples=3),
    ]
    chosen, reasons = recommend([*worse, best])
    assert chosen is best
    assert "no" not in " ".join(reasons).split()
    expected = {1: "has a concern", 2: "wider than half a hypothesis", 3: "fewer than 2 cells"}
    for left, reason in expected.items():
        chosen, reasons = recommend(worse[: left + 1])
        if left == 1:
            assert chosen is worse[1]
            assert reason in " ".join(reasons)
    chosen, reasons = recommend([worse[2]])
    assert expected[2] in " ".join(reasons)
    chosen, reasons = recommend([worse[3]])
    assert expected[3] in " ".join(reasons)
    assert recommend(worse[:1]) == (None, [])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["dts=[0.25,0.3]"], "dts[1]: 0.3 does not cut the horizon 5.0 into whole steps; try"),
        (["dts=[]"], "dts: [] is empty"),
        (["dts=[-1.0]"], "dts[0]: -1.0 must be above 0"),
        (["dts=[0.5,0.5]"], "dts: [0.5, 0.5] holds a value twice"),
        (["grids=[[9,9],[9,9]]"], "grids: [(9, 9), (9, 9)] holds a value twice"),
        (["pairs=1000000"], "pairs: 1000000 must be at most 10000"),
        (["remedy=1000"], "remedy: 1000 must be at most 20"),
        (["pairs=0"], "pairs: 0 must be at least 1"),
        (["remedy=0"], "remedy: 0 must be at least 1"),
        (["budget=50"], "budget: 50 states hold none of the grids; raise it, or set grids"),
        (["grids=[[20,20],[20]]"], "grids[1]: [20] must have 2 entries, one each for angle"),
        (["grids=[[20,0]]"], "grids[0][1]: 0 must be at least 1"),
        (["+dtt=0.2"], "dtt: unknown key; did you mean dts?"),
        (["actions=[9,9]"], "actions: [9, 9] must be one number, or a list of 1"),
        (["tasks.upper=[1.0]"], "tasks.upper: [1.0] must have 2 entries"),
        (["system=double_integrator", "horizon=0.1", "dts=[0.1]", "pairs=3"], "tasks: none of the"),
    ],
)
def test_a_wrong_config_is_refused_in_words(words: list[str], message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        advice(*words)
    assert message in str(caught.value)


def test_the_command_prints_its_table_and_its_status(tmp_path: Path) -> None:
    """From another folder; status 1 where nothing can be recommended, and nothing is written."""
    words = ["system=double_integrator", "grids=[[4,4]]", "dts=[0.1]", "remedy=1", "pairs=4"]
    done = run_here(command.main, *words, folder=tmp_path)
    assert done.returncode == 1, done.stderr
    assert "recommended     none: raise budget, add larger dts or grids" in done.stdout
    assert "rejected" in done.stdout
    assert not list(tmp_path.iterdir())


def test_cells_of_the_tasks_own_are_compared_with_sampled_paths() -> None:
    """Finer cells come nearer; with as many as there are they are the recommended ones."""
    words = ("grids=[[10,10]]", "dts=[0.5]", "pairs=4", "hypotheses.shape=[5,5]")
    _, lines = advice(*words, "grid=adaptive", "grid.refined=400")
    text = " ".join(" ".join(lines).split())
    own = float(
        text.split("grid.refined=400: cells of the task's own differ from these paths by ")[
            1
        ].split()[0]
    )
    equal = float(text.split("cells differ from them by ")[1].split()[0])
    assert own < equal
    with pytest.raises(ConfigError, match=r"grid\.refined: 50 is less than the 100 cells"):
        settings("grid=adaptive", "grid.refined=50")
