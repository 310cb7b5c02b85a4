"""C3D files of motion capture: markers, whose coordinates become columns `NAME x`, `y` and `z`.

The package ezc3d reads them in a process of its own, since a damaged file can crash it.
"""

from __future__ import annotations

import io
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

from mlci.recordings import c3d_process
from mlci.recordings.table import Table, Unusable, Wants

_PATIENCE = 60.0  # [s] for one file


def read(file: Path, _wants: Wants, limit: int) -> Table:
    """The markers of a C3D file.

    Args:
        file: the file.
        limit: bytes of memory that reading may take.

    Raises:
        Unusable: ezc3d is not there, a damaged file, or one without markers.
    """
    if find_spec("ezc3d") is None:
        raise Unusable("reading .c3d needs ezc3d: pip install ezc3d")
    command = [sys.executable, "-P", str(c3d_process.__file__), str(file), str(limit)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        raise Unusable(f"is not read within {_PATIENCE:g} s: it is damaged") from None
    if done.returncode != 0:
        reason = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["it crashes"]
        raise Unusable(f"is damaged, or no .c3d file ({reason[0][:200]})")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
        points, labels = arrays["points"], arrays["labels"].tolist()
        rate, unit = float(arrays["rate"]), str(arrays["unit"])
    if not (labels and points.shape[1] and rate > 0):
        raise Unusable("holds no markers, or no rate")
    columns: dict[str, object] = {"time": np.arange(points.shape[2]) / rate}
    for number, label in enumerate(labels[: points.shape[1]]):
        columns |= {f"{label} {axis}": points[i, number] for i, axis in enumerate("xyz")}
    units = {name: unit for name in columns if name != "time" and unit}
    return Table(file, pd.DataFrame(columns), units)
