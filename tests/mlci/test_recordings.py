import builtins
import re

import numpy as np
import pandas as pd
import pytest

from mlci.demonstrations import Demonstration, Task, even_times
from mlci.recordings.files import FORMATS
from mlci.recordings.paths import Repair
from mlci.recordings.read import read_demonstrations
from mlci.recordings.write import write_demonstration
from mlci.simulate import euler_step, rollout
from mlci.spaces import Box
from mlci.systems import Pendulum

PENDULUM = Pendulum()
HEADER = "time,angle,angular_velocity\n"
GOOD = HEADER + "0,1,0.5\n0.1,1.05,0.5\n0.2,1.1,0.5\n0.3,1.15,0.5\n"


@pytest.fixture
def swing():
    """A demonstration that winds one and a half times."""
    controls = np.random.default_rng(0).uniform(-1, 1, (300, 1))
    states = rollout(PENDULUM, [1.0, 2.5], controls, 0.01, step=euler_step)
    assert states[-1, 0] > 2.5 * np.pi
    return Demonstration(
        Task(states[0], Box.point(states[-1]), 3.0), states, controls, even_times(301, 0.01)
    )


def read_one(path, **options):
    """The demonstration of a file that can be used."""
    (demonstration,), problems, _ = read_demonstrations(path, PENDULUM, **options)
    assert problems == []
    return demonstration


def problem_with(path, text, **options):
    """What is wrong with a file of this content."""
    path.write_text(text)
    demonstrations, (problem,), _ = read_demonstrations(path, PENDULUM, **options)
    assert demonstrations == []
    assert problem.file == str(path)
    assert str(problem) == f"{path}: {problem.message}"
    return problem.message


def assert_same(read, written, controls=True):
    """The same samples, bit by bit, with start and goal off the ends."""
    assert np.array_equal(read.states, written.states)
    assert np.allclose(read.times, written.times, rtol=1e-12, atol=0)
    assert read.task.horizon == pytest.approx(written.task.horizon, rel=1e-12)
    assert np.array_equal(read.task.start, written.states[0])
    assert np.array_equal(read.task.goal.lower, written.states[-1])
    assert np.array_equal(read.task.goal.upper, written.states[-1])
    if controls:
        assert np.array_equal(read.controls, written.controls)
    else:
        assert read.controls is None


def test_csv_with_header_comes_back_bit_by_bit(tmp_path, swing):
    write_demonstration(tmp_path / "swing.csv", swing, PENDULUM.space)
    read = read_one(tmp_path / "swing.csv")
    assert read.name == "swing"
    assert_same(read, swing)
    lines = (tmp_path / "swing.csv").read_text().splitlines()
    assert lines[0] == (
        "time,angle,angular_velocity,control_1,goal_lower_angle,goal_lower_angular_velocity,"
        "goal_upper_angle,goal_upper_angular_velocity"
    )
    assert len(lines) == 302
    bare = Demonstration(swing.task, swing.states, None, swing.times)
    write_demonstration(tmp_path / "bare.csv", bare, PENDULUM.space)
    assert_same(read_one(tmp_path / "bare.csv"), swing, controls=False)


@pytest.mark.parametrize("suffix", ["csv", "npz", "parquet"])
@pytest.mark.parametrize("controls", [True, False])
def test_a_goal_comes_back_bit_by_bit(tmp_path, swing, suffix, controls):
    """A range of angles a turn away, at any velocity; a goal that is given wins."""
    end = swing.states[-1, 0]
    goal = Box([end - 2 * np.pi - 1 / 3, -np.inf], [end - 2 * np.pi + 1e-3, np.inf])
    task = Task(swing.states[0], goal, 3.0)
    written = Demonstration(task, swing.states, swing.controls if controls else None, swing.times)
    path = tmp_path / f"a.{suffix}"
    write_demonstration(tmp_path / "a.csv", written, PENDULUM.space)
    if suffix == "parquet":
        pd.read_csv(tmp_path / "a.csv").to_parquet(path)
    if suffix == "npz":
        corners = {"goal_lower": goal.lower, "goal_upper": goal.upper}
        held = {"controls": swing.controls} if controls else {}
        np.savez(path, states=swing.states, dt=0.01, **held, **corners)
    read = read_one(path)
    exact = suffix != "parquet"  # pandas reads numbers to the last bit but one
    assert np.allclose(read.states, swing.states, rtol=0 if exact else 1e-15, atol=0)
    for side in ("lower", "upper"):
        sides = getattr(read.task.goal, side), getattr(goal, side)
        assert np.allclose(*sides, rtol=0 if exact else 1e-15, atol=0)
    assert (read.controls is not None) == controls
    other = Box([end - 0.1, -np.inf], [end, np.inf])
    assert read_one(path, goal=other).task.goal is other


def test_a_goal_that_is_none_is_named(tmp_path):
    head = "time,angle,angular_velocity,goal_lower_angle,goal_lower_angular_velocity,"
    head += "goal_upper_angle,goal_upper_angular_velocity\n"
    path, rest = tmp_path / "a.csv", "0.1,1,0,,,,\n"
    assert "ends 1 away from the goal" in problem_with(path, f"{head}0,1,0,2,-1,2,1\n{rest}")
    for corners in ("2,-1,0,1", "0,,2,1", "0,oops,2,1"):
        message = problem_with(path, f"{head}0,1,0,{corners}\n{rest}")
        assert "a goal that is no box" in message
    assert "has 0 sample(s)" in problem_with(path, head)
    np.savez(tmp_path / "a.npz", states=np.ones((3, 2)), dt=1, goal_lower=[1], goal_upper=[1, 1])
    _, (problem,), _ = read_demonstrations(tmp_path / "a.npz", PENDULUM)
    assert "needs 'goal_lower' and 'goal_upper' of shape (2,)" in problem.message


def test_lines_of_one_dimension_each(tmp_path, swing):
    held = np.append(swing.controls[:, 0], 0.0)
    np.savetxt(tmp_path / "all.csv", np.vstack([swing.states.T, held]), "%.17g", delimiter=",")
    np.savetxt(tmp_path / "states.csv", swing.states.T, "%.17g", delimiter=",")
    assert_same(read_one(tmp_path / "all.csv"), swing)
    assert_same(read_one(tmp_path / "states.csv"), swing, controls=False)
    assert read_one(tmp_path / "all.csv", dt=0.5).task.horizon == 150.0


@pytest.mark.parametrize("extra", [0, 1])
def test_numpy_archive(tmp_path, swing, extra):
    held = np.pad(swing.controls, ((0, extra), (0, 0)))
    np.savez(tmp_path / "a.npz", states=swing.states, controls=held, dt=0.01)
    np.savez(tmp_path / "b.npz", states=swing.states, time=np.arange(301) * 0.01 + 7)
    assert_same(read_one(tmp_path / "a.npz"), swing)
    second = read_one(tmp_path / "b.npz")
    assert second.controls is None
    assert second.times[1] == pytest.approx(0.01, rel=1e-12)


def test_parquet(tmp_path, swing):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    names = ["angular_velocity", "note", "angle", "time"]
    columns = [swing.states[:, 1], ["x"] * 301, swing.states[:, 0], np.arange(301) * 0.01]
    parquet.write_table(
        pyarrow.table(dict(zip(names, columns, strict=True))), tmp_path / "a.parquet"
    )
    assert_same(read_one(tmp_path / "a.parquet"), swing, controls=False)
    assert "is damaged, or no .parquet file" in problem_with(tmp_path / "b.parquet", "no table")


def test_parquet_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    real = builtins.__import__

    def without_pyarrow(name, *args, **options):
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return real(name, *args, **options)

    monkeypatch.setattr(builtins, "__import__", without_pyarrow)
    assert "pip install pyarrow" in problem_with(tmp_path / "a.parquet", "")


def test_jumps_at_the_seam_are_undone(tmp_path, swing):
    wrapped = Demonstration(
        Task(swing.states[0], swing.task.goal, 3.0),
        PENDULUM.space.wrap(swing.states),
        None,
        swing.times,
    )
    write_demonstration(tmp_path / "a.csv", wrapped, PENDULUM.space)
    np.testing.assert_allclose(read_one(tmp_path / "a.csv").states, swing.states, atol=1e-12)


def test_columns_in_any_order_rounded_times_blank_lines_and_a_byte_order_mark(tmp_path):
    text = "\ufefftime,foot,angular_velocity, angle\n0.000,L,2,1\n0.033,R,2,1.1\n\n0.067,L,2,1.2\n"
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    read = read_one(tmp_path / "a.csv")
    assert read.states.tolist() == [[1, 2], [1.1, 2], [1.2, 2]]
    assert read.times.tolist() == [0, 0.033, 0.067]


def test_controls_are_never_needed(tmp_path):
    (tmp_path / "a.csv").write_text(
        "time,angle,angular_velocity,control_1\n0,1,0,oops\n1,1,0,2\n2,1,0,\n"
    )
    assert read_one(tmp_path / "a.csv").controls is None
    (tmp_path / "a.csv").write_text("1,1,1\n0,0,0\n2,oops,2\n")
    assert read_one(tmp_path / "a.csv").controls is None


def test_start_and_goal_may_be_given(tmp_path):
    (tmp_path / "a.csv").write_text(GOOD)
    goal = Box(np.array([1.1 - 2 * np.pi, -np.inf]), np.array([1.2 - 2 * np.pi, np.inf]))
    start = np.array([1.01 + 4 * np.pi, 0.5])
    read = read_one(tmp_path / "a.csv", start=start, goal=goal)
    assert np.array_equal(read.task.start, start)
    assert read.task.goal is goal
    np.testing.assert_allclose(read.states[:, 0] - 4 * np.pi, [1, 1.05, 1.1, 1.15])
    for option, message in (
        ({"start": [1.2, 0.5]}, "begins 0.2 away from the start that was given, more than 0.05"),
        ({"goal": Box.point([1.15, 0.7])}, "ends 0.2 away from the goal that was given"),
    ):
        assert message in problem_with(tmp_path / "a.csv", GOOD, **option)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        (HEADER, r"has 0 sample\(s\): a demonstration needs at least 2"),
        (HEADER + "0,1,0\n", r"has 1 sample\(s\)"),
        ("1\n2\n3\n", r"has 1 sample\(s\)"),
        (GOOD + "0.4,nan,0.5\n0.5,1.25,1\n", "line 6: angle is missing for 0.2 s"),
        (GOOD + "0.4,1.2,\n0.5,1.2,1\n", "line 6: angular_velocity is missing"),
        (GOOD + "0.4,inf,0.5\n", "line 6: angle = inf is not a finite number"),
        (GOOD + "0.4,oops,0.5\n", "line 6, column 'angle': 'oops' is not a number"),
        (GOOD + "0.4,1.2\n", "line 6 has 2 values where the header has 3"),
        (GOOD + "0.4,1.2,6.5\n", r"line 6: angular_velocity = 6\.5 is outside .*\(bounds -6 to 6;"),
        (GOOD + "0.3,1.2,0.5\n", r"line 6: time goes from 0\.3 to 0\.3 s"),
        (GOOD + "nan,1.2,0.5\n", r"line 6: time goes from 0\.3 to nan s"),
        (HEADER + "0,1,0\n0,1,0\n", r"line 3: time goes from 0 to 0 s"),
        (HEADER + "nan,1,0\nnan,1,0\n", r"line 3: time goes from nan to nan s"),
        (HEADER + "1,1,0\n0,1,0\n", r"line 3: time goes from 1 to 0 s"),
        ("time,theta,angular_velocity\n0,1,0\n", r"no column angle in its header \(time, theta"),
        ("what is this\nreally\n", "no column time or angle or angular_velocity"),
        (
            "1,2\n3,4\n5,6\n7,8\n",
            r"no header and 4 lines of 2 values: it needs 2 lines .* or 3 .*time,angle,",
        ),
        ("1,2,3\n0,nan,0\n", "line 2, column 2: angular_velocity is missing"),
        ("1,2,3\n0,x,0\n", "line 2, column 2: 'x' is not a number"),
        ("1,2,3\n0,0,-7\n", "line 2, column 3: angular_velocity = -7 is outside"),
    ],
)
def test_what_is_wrong_with_a_text_is_named(tmp_path, text, message):
    path = tmp_path / "a.csv"
    assert re.search(message, problem_with(path, text))


def test_what_is_wrong_with_an_archive_is_named(tmp_path):
    def message(**arrays):
        np.savez(tmp_path / "a.npz", **arrays)
        _, (problem,), _ = read_demonstrations(tmp_path / "a.npz", PENDULUM)
        return problem.message

    states = np.zeros((5, 2))
    assert "has no column angle or angular_velocity in its header (x)" in message(x=[1, 2, 3], dt=1)
    assert "'states' of shape (K+1, 2), not (K+1, 5)" in message(states=states.T, dt=0.1)
    assert "needs 'states' of shape (4,), not (5, 2)" in message(states=states, time=np.arange(4))
    assert "needs a time step dt above 0, not -1 s" in message(states=states, dt=-1.0)
    states[3, 0] = np.inf
    assert "sample 3: angle = inf is not a finite number" in message(states=states, dt=0.1)
    assert "array 'states.npy' is of object, not of numbers" in message(states=np.array([{}]))
    assert "is damaged, or no .npz file" in problem_with(tmp_path / "b.npz", "PK, no zip")
    assert "is damaged, or no .npz file" in problem_with(tmp_path / "b.npz", "")


def test_bytes_that_are_no_text_are_named(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"1,2\n\x00\x01" * 20)
    _, (problem,), _ = read_demonstrations(tmp_path / "a.csv", PENDULUM)
    assert "line 2: is not text (character 0)" in problem.message


def test_one_bad_file_does_not_lose_the_others(tmp_path):
    other = GOOD.replace("1.15", "1.16")
    for name, text in (("b", GOOD), ("a", "oops"), ("c", other), ("d", HEADER)):
        (tmp_path / f"{name}.csv").write_text(text)
    (tmp_path / "notes.pdf").write_text("ignored in a folder")
    (tmp_path / "._b.csv").write_text("hidden")
    for paths in (tmp_path, str(tmp_path / "*.csv"), [tmp_path / f"{name}.csv" for name in "abcd"]):
        demonstrations, problems, _ = read_demonstrations(paths, PENDULUM)
        assert [item.name for item in demonstrations] == ["b", "c"]
        assert [item.file for item in problems] == [str(tmp_path / f"{x}.csv") for x in "ad"]


def test_paths_that_stand_for_nothing_twice_the_same_or_alike(tmp_path):
    (tmp_path / "other").mkdir()
    (tmp_path / "empty").mkdir()
    (tmp_path / "a.csv").write_text(GOOD)
    (tmp_path / "other" / "a.csv").write_text(GOOD.replace("1.15", "1.16"))
    names = ["none.csv", "no*.csv", "empty", "a.csv", "*.csv", "other"]
    found, problems, _ = read_demonstrations([tmp_path / name for name in names], PENDULUM)
    assert [item.name for item in found] == [
        str(tmp_path / "a.csv"),
        str(tmp_path / "other" / "a.csv"),
    ]
    assert [str(item).split(": ")[1] for item in problems] == [
        "there is no such file",
        "there is no such file",
        f"holds no file of {', '.join(FORMATS)}",
    ]
    assert "cannot read '.pdf' files" in problem_with(tmp_path / "a.pdf", GOOD)


def test_time_step_must_be_positive(tmp_path):
    with pytest.raises(ValueError, match="must be positive, not 0"):
        read_demonstrations(tmp_path, PENDULUM, dt=0)


def test_positions_alone_are_enough_where_a_velocity_is_derived(tmp_path):
    times = np.arange(101) / 100
    angle = 6.0 + np.sin(2 * times)
    for name, head in (("a", "time,angle"), ("b", "time,angle,angular_velocity")):
        rows = [f"{t:.2f},{a % (2 * np.pi):.6f}" for t, a in zip(times, angle, strict=True)]
        rows = [f"{row},77" if name == "b" else row for row in rows]  # a velocity that is not used
        (tmp_path / f"{name}.csv").write_text("\n".join([head, *rows]))
    repair = Repair(derived={"angular_velocity": "angle"})
    found, problems, notes = read_demonstrations(tmp_path, PENDULUM, repair=repair)
    assert problems == []
    assert [str(note) for note in notes] == ["b: is a copy of a, and is not counted"]
    np.testing.assert_allclose(found[0].states[:, 1], 2 * np.cos(2 * times), atol=0.01)
    assert read_demonstrations(tmp_path, PENDULUM)[0] == []


def test_a_goal_counts_in_a_line_that_lacks_a_state(tmp_path):
    """The line is left out, as no state is known before; its goal is not."""
    corners = [f"goal_{end}_{name}" for end in ("lower", "upper") for name in PENDULUM.space.names]
    head = ",".join([HEADER.strip(), *corners])
    (tmp_path / "a.csv").write_text(f"{head}\n0,,0,1,-1,2,1\n0.1,1,0,,,,\n0.2,1.1,0,,,,\n")
    read = read_one(tmp_path / "a.csv")
    assert len(read.states) == 2
    assert read.task.goal.lower.tolist() == [1, -1]
    assert read.task.goal.upper.tolist() == [2, 1]
