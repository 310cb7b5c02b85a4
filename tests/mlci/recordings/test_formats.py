"""Every format and way of writing holds the same path; files that claim too much are refused."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from recorded_variants import VARIANTS, write_c3d, write_trc
from scipy.io import savemat

from mlci.recordings.files import FORMATS
from mlci.recordings.paths import Repair
from mlci.recordings.read import Readings, read_demonstrations
from mlci.spaces import Box, StateSpace
from mlci.systems import FunctionSystem, Pendulum

PENDULUM = Pendulum()
HEADER = "time,angle,angular_velocity\n"


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """A swing across the seam, sampled every 0.02 s."""
    time = np.arange(26) * 0.02
    return pd.DataFrame(
        {"time": time, "angle": 6.1 + np.sin(time), "angular_velocity": np.cos(time)}
    )


def read(path: Path, **options: object) -> Readings:
    """What comes of a file; samples without time are 0.02 s apart."""
    return read_demonstrations(path, PENDULUM, **{"dt": 0.02, **options})


@pytest.mark.parametrize("name", VARIANTS)
def test_the_same_path_is_read_from_each_variant(
    name: str, tmp_path: Path, table: pd.DataFrame
) -> None:
    suffix, write, options, exact = VARIANTS[name]
    write(table, tmp_path / f"swing.{suffix}")
    (demonstration,), problems, _ = read(tmp_path / f"swing.{suffix}", **options)
    assert problems == []
    expected = table[["angle", "angular_velocity"]].to_numpy()
    np.testing.assert_allclose(demonstration.states, expected, rtol=exact, atol=0)
    np.testing.assert_allclose(demonstration.times, table["time"], rtol=0, atol=3e-7)
    assert demonstration.task.horizon == pytest.approx(0.5, abs=3e-7)


def test_each_format_has_a_variant() -> None:
    written = {f".{variant.suffix}" for variant in VARIANTS.values()}
    assert written | {".trc", ".c3d"} == set(FORMATS)


@pytest.mark.parametrize(("suffix", "write"), [("c3d", write_c3d), ("trc", write_trc)])
def test_markers_are_read_in_the_systems_unit(
    suffix: str, write: object, tmp_path: Path, table: pd.DataFrame
) -> None:
    """A hand on a table; the file is in millimetres, the system in metres."""
    if suffix == "c3d":
        pytest.importorskip("ezc3d")
    space = StateSpace(Box([-9, -9], [9, 9]), [False, False], ("x", "y"), ("m", "m"))
    walker = FunctionSystem(lambda x, u: (u[..., 0], u[..., 1]), space, Box([-1, -1], [1, 1]))
    path = tmp_path / f"hand.{suffix}"
    write(table, path)  # type: ignore[operator]
    columns = {"x": "Hand x", "y": "Hand y"}
    (demonstration,), problems, _ = read_demonstrations(path, walker, columns=columns)
    assert problems == []
    expected = table[["angle", "angular_velocity"]].to_numpy()
    np.testing.assert_allclose(demonstration.states, expected, rtol=1e-6)  # float32 in C3D
    np.testing.assert_allclose(demonstration.times, table["time"], rtol=1e-6)
    path.write_bytes(path.read_bytes()[:200])
    assert len(read_demonstrations(path, walker, columns=columns).problems) == 1


def message(path: Path, **options: object) -> str:
    """What is wrong with a file."""
    demonstrations, (problem,), _ = read(path, **options)
    assert demonstrations == []
    return problem.message


@pytest.mark.parametrize(
    ("header", "options", "words"),
    [
        ("time,angle [m],angular_velocity", {}, "column 'angle [m]': the unit 'm' is none of what"),
        (
            "time,angle [mood],angular_velocity",
            {},
            "there is no unit 'mood': write one such as deg",
        ),
        ("time,angle [9^9^9],angular_velocity", {}, "there is no unit '9^9^9'"),
        ("time,angle,angular_velocity [Hz]", {}, "or say its unit, as in units={angular_velocity:"),
        ("time [deg],angle,angular_velocity", {}, "column 'time [deg]': the unit 'deg' is none"),
        ("time,angle,angular_velocity", {"time_unit": "rad"}, "the unit 'rad' is none of what"),
        (
            "time,angle [deg],angle [rad]",
            {},
            "has 2 columns 'angle' (angle [deg], angle [rad]): name",
        ),
        ("time,angle,angle", {}, "has 2 columns 'angle' (angle, angle): rename or remove all but"),
        ("when,angle,angular_velocity", {}, "no column time in its header (when, angle, angular"),
        ("time,angle,omega", {}, "say so, as in columns={angular_velocity: omega}"),
        ("time,angle,omega", {"columns": {"angle": "phi"}}, "no column phi or angular_velocity"),
        (
            "time,angle,angular_velocity",
            {"columns": {"angular_velocity": "angle"}},
            "column 'angle' is named for angle and for angular_velocity: columns= needs a column",
        ),
    ],
)
def test_names_and_units_that_do_not_fit_are_refused(
    tmp_path: Path, header: str, options: dict[str, object], words: str
) -> None:
    (tmp_path / "a.csv").write_text(f"{header}\n0,1,0\n1,1,0\n")
    assert words in message(tmp_path / "a.csv", **options)


def test_a_name_that_fits_exactly_wins_over_one_that_is_alike(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time,angle,Angle [deg],angular_velocity\n0,1,9,0\n1,2,9,0\n")
    (demonstration,), *_ = read(tmp_path / "a.csv")
    assert demonstration.states[:, 0].tolist() == [1, 2]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "# comment\n\n" + HEADER + "0,1,0\n# more\n1,x,0\n",
            "line 6, column 'angle': 'x' is not a",
        ),
        (HEADER + "0,1,0\nsoon,1,0\n", "line 3: time 'soon' is neither a number nor a timestamp"),
        (
            HEADER.replace(",", ";") + "0;1,5;0\n1;2,5\n",
            "line 3 has 2 values where the header has 3",
        ),
        (HEADER + "0,1,0\n0.5,1,0\n0.4,1,0\n", "line 4: time goes from 0.5 to 0.4 s, where each"),
    ],
)
def test_messages_tell_the_line_of_the_file(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.csv").write_text(text)
    assert words in message(tmp_path / "a.csv")


def test_what_is_assumed_of_time_is_noted(tmp_path: Path, table: pd.DataFrame) -> None:
    VARIANTS["no time"].write(table, tmp_path / "a.csv")
    VARIANTS["Unix time in ns"].write(table.iloc[:-1], tmp_path / "b.csv")
    notes = [str(note).rpartition("/")[2] for note in read(tmp_path).notes]
    assert notes == [
        "a.csv: no time: samples are taken to be 0.02 s apart",
        "b.csv: time is taken for Unix time in ns, by its size",
    ]


def npy(shape: str, data: bytes = b"", kind: str = "<f8") -> bytes:
    """An array file with a header that may lie."""
    text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode() + data


def archive(path: Path, **entries: bytes) -> Path:
    """A zip file with these entries."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, data in entries.items():
            file.writestr(f"{name}.npy", data)
    return path


def test_what_claims_more_than_the_limit_is_refused_unread(tmp_path: Path) -> None:
    path = archive(tmp_path / "a.npz", states=npy("(1000000000000, 2)"))
    assert "claims 1.6e+13 bytes, more than the 4e+08 of max_memory" in message(path)
    path = archive(tmp_path / "b.npz", states=npy("(3, 2)", bytes(48)), beside=npy("(10**12,)"))
    assert "is damaged" not in str(read(path))  # what is not used is not looked at
    (tmp_path / "c.csv").write_text(HEADER + "0,1,0\n" * 100)
    assert "more than max_memory = 0.001 MB" in message(tmp_path / "c.csv", max_memory=0.001)
    pd.DataFrame({"time": np.zeros(10**6), "angle": 1.0, "angular_velocity": 0.0}).to_parquet(
        tmp_path / "d.parquet"
    )
    assert (tmp_path / "d.parquet").stat().st_size < 1e5
    assert "claims 2.4e+07 bytes" in message(tmp_path / "d.parquet", max_memory=10)


def test_a_workbook_that_unpacks_to_much_is_refused(tmp_path: Path, table: pd.DataFrame) -> None:
    table.to_excel(tmp_path / "a.xlsx", index=False)
    with zipfile.ZipFile(tmp_path / "a.xlsx", "a", zipfile.ZIP_DEFLATED) as file:
        file.writestr("xl/more.xml", bytes(10**6))
    assert "takes 2" in message(tmp_path / "a.xlsx", max_memory=5)


@pytest.mark.parametrize("suffix", sorted(FORMATS))
@pytest.mark.parametrize(
    "content", [b"", b"\x00" * 600, b"not one of them\n", bytes(range(256)) * 9]
)
def test_files_of_something_else_are_named(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    assert message(path)


def test_damaged_compression_and_what_is_no_file_are_named(tmp_path: Path) -> None:
    good = npy("(500, 2)", np.random.default_rng(0).normal(size=(500, 2)).tobytes())
    path = archive(tmp_path / "a.npz", states=good)
    data = bytearray(path.read_bytes())
    data[2000:2100] = bytes(100)
    path.write_bytes(data)
    assert "is damaged, or no .npz file" in message(path)
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "folder.csv" / "b.csv").write_text(HEADER + "0,1,0\n1,1,0\n")
    _, problems, _ = read(tmp_path)
    assert [problem.message for problem in problems][1:] == ["is not a file"]
    assert len(read(tmp_path / "folder.csv").demonstrations) == 1


@pytest.mark.parametrize("word", ["NA", "-", "", " ", "--", ".", "?", "NAN", "#DIV/0!", "-1.#IND"])
def test_what_people_write_for_no_number_is_a_gap(tmp_path: Path, word: str) -> None:
    (tmp_path / "a.csv").write_text(HEADER + f"0,1,0\n0.1,{word},0\n0.2,1.002,0\n")
    repair = Repair(np.array([0.1, 0.1]))
    (demonstration,), _, (note,) = read(tmp_path / "a.csv", repair=repair)
    assert note.message == "1 missing values of angle are bridged (line 3 first)"
    assert demonstration.states[1, 0] == pytest.approx(1.001)


def test_thousands_between_quotes_are_no_decimals(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + '"999",1,0\n"1,000",1,0\n"1,001",1,0\n')
    assert "time '1,000' is neither a number nor" in message(tmp_path / "a.csv")
    (tmp_path / "a.csv").write_text(HEADER + '"1,000",1,0\n"1,001",1,0\n')
    assert "time '1,000' is neither a number nor" in message(tmp_path / "a.csv")


def test_a_first_column_without_a_name_may_be_time(tmp_path: Path, table: pd.DataFrame) -> None:
    states = table[["angle", "angular_velocity"]]
    states.set_index(table["time"] * 3).rename_axis(None).to_csv(tmp_path / "a.csv")
    assert "no column time in its header (column 1, angle" in message(tmp_path / "a.csv")
    (demonstration,), *_ = read(tmp_path / "a.csv", columns={"time": "column 1"})
    np.testing.assert_allclose(demonstration.times, table["time"] * 3)
    states.to_csv(tmp_path / "a.csv")  # numbers of lines
    (demonstration,), *_ = read(tmp_path / "a.csv")
    np.testing.assert_allclose(demonstration.times, table["time"], atol=1e-12)


def test_of_two_joints_neither_is_taken(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        "time,hip.angle,knee.angle,angular_velocity\n0,1,2,0\n1,1,2,0\n"
    )
    words = "has 2 columns 'angle' (hip.angle, knee.angle): name the one to use, as in columns={ang"
    assert words in message(tmp_path / "a.csv")
    (demonstration,), *_ = read(tmp_path / "a.csv", columns={"angle": "knee.angle"})
    assert demonstration.states[0, 0] == 2


def test_an_angle_without_digits_for_where_it_is_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + "0,1e16,0\n1,1e16,0\n")
    assert "line 2: angle = 1e+16 is more than 1e+06 turns away" in message(tmp_path / "a.csv")


def test_texts_and_metadata_are_passed_over_in_a_folder(tmp_path: Path) -> None:
    beside = {
        "README.txt": "Recorded in 2026,\nby three people.\n1. The first\n",
        "metadata.json": '{"subject": "S1", "rate": 100, "bounds": [-1, 1]}',
        "people.json": '[{"name": "S1", "age": 30}]',
        "tasks.csv": "trial,start_angle,start_angular_velocity\na,1,0\n",
    }
    for name, text in beside.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "a.csv").write_text(HEADER + "0,1,0\n1,1,0\n")
    readings = read(tmp_path)
    assert (len(readings.demonstrations), readings.problems) == (1, [])
    assert [note.message for note in readings.notes] == [
        "is text without samples, and is passed over",
        "is JSON without samples, and is passed over",
        "is JSON without samples, and is passed over",
        "is a table of starts and goals (tasks=FILE), and is passed over",
    ]
    for name in beside:  # but not where it is asked for
        assert message(tmp_path / name).startswith("is ")


def test_a_recording_that_is_empty_or_in_other_words_is_not_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(HEADER)
    (tmp_path / "b.txt").write_text("when,theta,omega\n0,1,0\n1,1,0\n")
    (tmp_path / "c.json").write_text(str({"theta": [1.0] * 20}).replace("'", '"'))
    (tmp_path / "d.csv").write_text("by three people\n")
    assert len(read(tmp_path).problems) == 4


def test_trials_in_json_are_told_apart(tmp_path: Path, table: pd.DataFrame) -> None:
    trial = table.to_dict("list")
    trials = [{**trial, "angle": [float(k)] * 26, "name": f"S{k}"} for k in (1, 2)]
    (tmp_path / "a.json").write_text(json.dumps({"trials": trials}))
    found, problems, _ = read(tmp_path / "a.json")
    assert problems == []
    assert [each.name for each in found] == ["a_1", "a_2"]
    assert [each.states[0, 0] for each in found] == [1.0, 2.0]


def test_arrays_of_structs_are_named(tmp_path: Path) -> None:
    trials = np.array([(1.0,), (2.0,)], dtype=[("time", "O")])
    savemat(tmp_path / "a.mat", {"trials": trials})
    assert "variable 'trials' is a struct (1, 2): save a file" in message(tmp_path / "a.mat")


def test_half_precision_and_times_beyond_all_bounds(tmp_path: Path, table: pd.DataFrame) -> None:
    with np.errstate(over="raise"):
        np.savez(tmp_path / "a.npz", **{n: table[n].to_numpy(dtype="f2") for n in table})
        (demonstration,), *_ = read(tmp_path / "a.npz")
        np.testing.assert_allclose(demonstration.times, table["time"], atol=1e-3)
        (tmp_path / "a.csv").write_text(HEADER + "-1.7e308,1,0\n1.7e308,1,0\n")
        assert "holds a time of 1.7e+308 s: is its unit s?" in message(tmp_path / "a.csv")


def test_a_struct_that_unpacks_to_much_is_refused(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"run": {"time": np.zeros(10**6)}}, do_compression=True)
    assert (tmp_path / "a.mat").stat().st_size < 2e4
    assert "unpacks to more than half of max_memory" in message(tmp_path / "a.mat", max_memory=10)


def test_a_matrix_that_takes_much_as_floats_is_refused_before_it_is_loaded(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"time": np.zeros((1, 3 * 10**6), dtype=np.int8)})
    assert "claims 2.4e+07 bytes, more than the 1e+07" in message(tmp_path / "a.mat", max_memory=10)


def test_hidden_files_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + "0,1,0\n1,1,0\n")
    (tmp_path / "._a.csv").write_bytes(b"\x00\x05\x16\x07")
    assert [len(part) for part in read(tmp_path)] == [1, 0, 0]
    assert len(read(tmp_path / "._a.csv").problems) == 1


def test_a_name_that_is_no_text_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "d\udcff\n\x1b[31m.csv"
    path.write_text(HEADER + "0,1,0\n1,1,0\n")
    (demonstration,), *_ = read(tmp_path)
    assert demonstration.name == "d\\udcff\\n\\x1b[31m"


def test_a_home_that_nobody_has_is_named() -> None:
    _, (problem,), _ = read(Path("~nobody-of-this-name/a.csv"))
    assert problem.message.startswith("cannot be looked into (")


def test_nanoseconds_since_1970_lose_no_digit(tmp_path: Path) -> None:
    """As floating-point numbers they would be rounded to 256 ns."""
    rows = [f"{1_700_000_000_000_000_000 + 1000 * k},1,0\n" for k in range(5)]
    (tmp_path / "a.csv").write_text(HEADER + "".join(rows))
    (demonstration,), *_ = read(tmp_path / "a.csv")
    np.testing.assert_allclose(demonstration.times, np.arange(5) * 1e-6, rtol=1e-12)
