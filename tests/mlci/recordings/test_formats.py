"""Every format and way of writing holds the same path; files that claim too much are refused."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from recorded_variants import VARIANTS, write_c3d, write_trc

from mlci.recordings.files import FORMATS
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
        ("time,angle,omega", {"columns": {"angle": "phi"}}, "no column angle or angular_velocity"),
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


def test_hidden_files_are_passed_over(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + "0,1,0\n1,1,0\n")
    (tmp_path / "._a.csv").write_bytes(b"\x00\x05\x16\x07")
    assert [len(part) for part in read(tmp_path)] == [1, 0, 0]
    assert len(read(tmp_path / "._a.csv").problems) == 1


def test_a_name_that_is_no_text_is_shown(tmp_path: Path) -> None:
    path = tmp_path / "d\udcff.csv"
    path.write_text(HEADER + "0,1,0\n1,1,0\n")
    (demonstration,), *_ = read(tmp_path)
    assert demonstration.name == "d\\udcff"


def test_nanoseconds_since_1970_lose_no_digit(tmp_path: Path) -> None:
    """As floating-point numbers they would be rounded to 256 ns."""
    rows = [f"{1_700_000_000_000_000_000 + 1000 * k},1,0\n" for k in range(5)]
    (tmp_path / "a.csv").write_text(HEADER + "".join(rows))
    (demonstration,), *_ = read(tmp_path / "a.csv")
    np.testing.assert_allclose(demonstration.times, np.arange(5) * 1e-6, rtol=1e-12)
