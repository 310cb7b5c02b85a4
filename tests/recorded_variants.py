"""The same path as people's files hold it: a writer and what must be said about each."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.io import savemat


class Variant(NamedTuple):
    """One way to write a table of time [s], angle [rad] and angular_velocity [rad/s].

    Attributes:
        suffix: of the file.
        write: the table, to a path.
        options: what `read_demonstrations` must be told.
        exact: how near the numbers come back.
    """

    suffix: str
    write: Callable[[pd.DataFrame, Path], object]
    options: dict[str, Any] = {}  # noqa: RUF012
    exact: float = 0.0


DEGREES = {"angle": "deg", "angular_velocity": "deg/s"}
STATES = ["angle", "angular_velocity"]


def text(change: Callable[[pd.DataFrame], pd.DataFrame] = lambda t: t, **how: Any) -> Any:
    """A writer of delimited text."""
    return lambda table, path: change(table).to_csv(path, index=False, **how)


def renamed(**names: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """The same columns under other names."""
    return lambda table: table.rename(columns=names)


def in_degrees(table: pd.DataFrame) -> pd.DataFrame:
    """Angles in degrees."""
    return table.assign(**{name: np.rad2deg(table[name]) for name in STATES})


def after(
    head: str, change: Callable[[pd.DataFrame], pd.DataFrame] = lambda t: t, **how: Any
) -> Any:
    """A writer of text below other lines."""

    def write(table: pd.DataFrame, path: Path) -> None:
        path.write_text(head + change(table).to_csv(index=False, **how))

    return write


def write_npz(table: pd.DataFrame, path: Path) -> None:
    """An archive with arrays beside that are no numbers."""
    beside = {"subject": np.array("S3"), "notes": np.array([{"a": 1}, None], dtype=object)}
    np.savez(path, states=table[STATES].to_numpy(), time=table["time"], **beside)


def write_c3d(table: pd.DataFrame, path: Path) -> None:
    """A marker whose x [mm] is the angle and y the angular velocity, in thousandths."""
    import ezc3d

    points = np.ones((4, 1, len(table)))
    points[0, 0], points[1, 0] = 1000 * table["angle"], 1000 * table["angular_velocity"]
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [1 / table["time"][1]]
    content["parameters"]["POINT"]["LABELS"]["value"] = ["Hand"]
    content.add_parameter("POINT", "UNITS", ["mm"])
    content["data"]["points"] = points
    content.write(str(path))


def write_trc(table: pd.DataFrame, path: Path) -> None:
    """The same marker as OpenSim writes it."""
    rate = 1 / table["time"][1]
    rows = [
        f"{i + 1}\t{row.time!r}\t{1000 * row.angle!r}\t{1000 * row.angular_velocity!r}\t0.0\t"
        for i, row in enumerate(table.astype(object).itertuples())
    ]
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate",
        f"{rate:g}\t{rate:g}\t{len(table)}\t1\tmm\t{rate:g}",
        "Frame#\tTime\tHand\t\t",
        "\t\tX1\tY1\tZ1",
        "",
    ]
    path.write_text("\n".join([*head, *rows]) + "\n")


MOT = "swing\nversion=1\nnRows=9\ninDegrees={}\nendheader\n"
START = pd.Timestamp("2026-03-01 12:00:00")

VARIANTS: dict[str, Variant] = {
    "comma": Variant("csv", text()),
    "semicolon": Variant("csv", text(sep=";")),
    "decimal comma": Variant("csv", text(sep=";", decimal=",")),
    "german Excel": Variant(
        "csv",
        text(sep=";", decimal=",", encoding="utf-8-sig", lineterminator="\r\n"),
    ),
    "sep= of Excel": Variant("csv", after("sep=;\n", sep=";")),
    "tabs": Variant("tsv", text(sep="\t")),
    "tabs, decimal comma": Variant("txt", text(sep="\t", decimal=",")),
    "bars": Variant("txt", text(sep="|")),
    "spaces": Variant("txt", text(sep=" ")),
    "UTF-16": Variant("csv", text(encoding="utf-16")),
    "UTF-16 without a mark": Variant("csv", text(encoding="utf-16-le")),
    "comments": Variant("csv", after("# subject 3\n\n% of 2026\n")),
    "names in a comment": Variant(
        "txt",
        after("# a swing\n# time angle angular_velocity\n", sep=" ", header=False),
    ),
    "other names": Variant(
        "csv",
        text(renamed(time="t", angle="theta", angular_velocity="omega")),
        {"columns": {"angle": "theta", "angular_velocity": "OMEGA"}},
    ),
    "case, spaces and brackets": Variant(
        "csv",
        text(
            renamed(
                time="Time (s)", angle=" ANGLE [rad]", angular_velocity="Angular velocity [rad/s]"
            )
        ),
    ),
    "units in headers": Variant(
        "csv",
        text(
            lambda t: renamed(
                time="Time [ms]", angle="Angle [°]", angular_velocity="Angular_velocity (deg/s)"
            )(in_degrees(t).assign(time=t["time"] * 1000))
        ),
        exact=1e-13,
    ),
    "units that are given": Variant("csv", text(in_degrees), {"units": DEGREES}, 1e-13),
    "units that end names": Variant(
        "csv",
        text(
            lambda t: renamed(
                time="time_ms", angle="Angle / °", angular_velocity="angular_velocity_deg_s"
            )(in_degrees(t).assign(time=t["time"] * 1000))
        ),
        exact=1e-13,
    ),
    "units that end other names": Variant(
        "csv",
        text(
            lambda t: renamed(time="Time,s", angle="theta_deg", angular_velocity="omega_m")(
                t.assign(angle=np.rad2deg(t["angle"]))
            )
        ),
        {"columns": {"angle": "theta_deg", "angular_velocity": "omega_m"}},
        exact=1e-13,
    ),
    "units in capitals": Variant(
        "csv",
        text(
            lambda t: renamed(
                time="TIME [S]", angle="ANGLE [DEG]", angular_velocity="angular velocity (DEG/S)"
            )(in_degrees(t))
        ),
        exact=1e-13,
    ),
    "revolutions": Variant(
        "csv",
        text(
            lambda t: renamed(angle="angle [rev]", angular_velocity="angular_velocity [rev/min]")(
                t.assign(
                    angle=t["angle"] / (2 * np.pi),
                    angular_velocity=t["angular_velocity"] * 30 / np.pi,
                )
            )
        ),
        exact=1e-13,
    ),
    "powers in units": Variant(
        "csv",
        text(renamed(angle="angle [rad]", angular_velocity="angular_velocity (rad.s-1)")),
    ),
    "units below names": Variant(
        "txt",
        after(
            "time\tangle\tangular_velocity\n(s)\t(deg)\t(deg/s)\n",
            in_degrees,
            sep="\t",
            header=False,
        ),
        exact=1e-13,
    ),
    "lines above names": Variant("csv", after("Subject: 3\nRate,50\n\n")),
    "delimiters after the last": Variant(
        "csv",
        after(
            "time;angle;angular_velocity;;\n",
            lambda t: t.assign(empty=""),
            sep=";",
            header=False,
            lineterminator=";;\n",
        ),
    ),
    "decimal commas in quotes": Variant(
        "csv",
        lambda t, p: p.write_text(
            t.map(lambda x: repr(x).replace(".", ",")).to_csv(index=False, quoting=csv.QUOTE_ALL)
        ),
    ),
    "milliseconds": Variant(
        "csv", text(lambda t: t.assign(time=t["time"] * 1000)), {"time_unit": "ms"}
    ),
    "Unix time": Variant("csv", text(lambda t: t.assign(time=t["time"] + 1.7e9))),
    "Unix time in ns": Variant(
        "csv", text(lambda t: t.assign(time=(1.6e18 + t["time"] * 1e9).astype("int64")))
    ),
    "timestamps": Variant(
        "csv", text(lambda t: t.assign(time=START + pd.to_timedelta(t["time"], unit="s")))
    ),
    "minutes and seconds": Variant(
        "csv", text(lambda t: t.assign(time=[f"59:{s + 59.3:09.6f}" for s in t["time"]]))
    ),
    "times of day past midnight": Variant(
        "csv",
        text(
            lambda t: t.assign(
                time=(
                    pd.Timestamp("2026-03-01 23:59:59.8") + pd.to_timedelta(t["time"], unit="s")
                ).dt.strftime("%H:%M:%S.%f")
            )
        ),
    ),
    "durations": Variant(
        "csv", text(lambda t: t.assign(time=pd.to_timedelta(t["time"], unit="s")))
    ),
    "no time": Variant("csv", text(lambda t: t[STATES])),
    "numbers of samples": Variant(
        "csv",
        text(lambda t: t[STATES].assign(frame=range(7, 7 + len(t)))),
        {"columns": {"time": "frame"}, "time_unit": "samples"},
    ),
    "a column each, no header": Variant("csv", text(lambda t: t[STATES], header=False)),
    "a line each, no header": Variant("csv", text(lambda t: t[STATES].T, header=False)),
    "npz": Variant("npz", write_npz),
    "parquet": Variant("parquet", lambda t, p: t.to_parquet(p)),
    "parquet, timestamps": Variant(
        "parquet",
        lambda t, p: t.assign(time=START + pd.to_timedelta(t["time"], unit="s")).to_parquet(p),
    ),
    "parquet, float32 times": Variant(
        "parquet", lambda t, p: t.assign(time=t["time"].astype("float32")).to_parquet(p)
    ),
    "parquet, nested states": Variant(
        "parquet",
        lambda t, p: pd.DataFrame(
            {"timestamp": t["time"], "observation.state": list(t[STATES].to_numpy())}
        ).to_parquet(p),
        {"columns": {"states": "observation.state"}},
    ),
    "parquet, structs in another order": Variant(
        "parquet",
        lambda t, p: pd.DataFrame(
            {"time": t["time"], "states": t[STATES[::-1]].to_dict("records")}
        ).to_parquet(p),
    ),
    "parquet, names of two levels": Variant(
        "parquet",
        lambda t, p: t.set_axis(
            pd.MultiIndex.from_tuples([("time", ""), *(("hip", name) for name in STATES)]), axis=1
        ).to_parquet(p),
    ),
    "JSON, columns": Variant("json", lambda t, p: p.write_text(json.dumps(t.to_dict("list")))),
    "JSON, records": Variant("json", lambda t, p: p.write_text(json.dumps(t.to_dict("records")))),
    "JSON, lines": Variant(
        "json",
        lambda t, p: t.to_json(p, orient="records", lines=True, double_precision=15),
        exact=1e-14,
    ),
    "JSON, a line each": Variant(
        "jsonl",
        lambda t, p: t.to_json(p, orient="records", lines=True, double_precision=15),
        exact=1e-14,
    ),
    "JSON, nested, in another order": Variant(
        "json",
        lambda t, p: p.write_text(
            json.dumps(
                {
                    "about": {"id": 3},
                    "data": {
                        "time": t["time"].tolist(),
                        "states": t[STATES[::-1]].to_dict("list"),
                    },
                }
            )
        ),
    ),
    "JSON, records in an object": Variant(
        "json",
        lambda t, p: p.write_text(json.dumps({"name": "x", "samples": t.to_dict("records")})),
    ),
    "JSON, array of states": Variant(
        "json",
        lambda t, p: p.write_text(
            json.dumps({"dt": t["time"][1], "states": t[STATES].to_numpy().tolist()})
        ),
    ),
    "MATLAB": Variant(
        "mat",
        lambda t, p: savemat(p, {"t": t["time"].to_numpy(), "x": t[STATES].to_numpy()}),
        {"columns": {"states": "x"}},
    ),
    "MATLAB, rows, compressed": Variant(
        "mat",
        lambda t, p: savemat(
            p, {"time": t["time"].to_numpy(), "states": t[STATES].to_numpy().T}, do_compression=True
        ),
    ),
    "MATLAB, structs": Variant(
        "mat",
        lambda t, p: savemat(p, {"run": {"t": t["time"].to_numpy(), "hip": t.to_dict("list")}}),
        {"columns": {"time": "run.t"}},
    ),
    "Excel": Variant("xlsx", lambda t, p: t.to_excel(p, index=False), exact=1e-15),
    "Excel, timestamps below a gap": Variant(
        "xlsx",
        lambda t, p: t.assign(time=START + pd.to_timedelta(t["time"], unit="s")).to_excel(
            p, index=False, startrow=3
        ),
        exact=1e-15,
    ),
    "OpenSim .mot": Variant("mot", after(MOT.format("yes"), in_degrees, sep="\t"), exact=1e-13),
    "OpenSim .sto": Variant("sto", after(MOT.format("no"), sep=" ")),
}
