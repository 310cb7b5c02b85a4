"""Reads a C3D file, and writes its markers to standard output: python c3d_process.py FILE BYTES.

It imports nothing of this project, so that it starts quickly.
"""

from __future__ import annotations

import contextlib
import io
import sys

_BASE = 1 << 31  # bytes of addresses that Python and numpy take before any file


def main() -> None:
    """Read the file within a limit of memory."""
    path, limit = sys.argv[1], int(sys.argv[2])
    with contextlib.suppress(ImportError, ValueError, OSError):  # where there are such limits
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_BASE + limit, _BASE + limit))
    import ezc3d
    import numpy as np

    content = ezc3d.c3d(path)
    point = content["parameters"]["POINT"]
    units = point["UNITS"]["value"] if "UNITS" in point else []
    stream = io.BytesIO()
    np.savez(
        stream,
        points=content["data"]["points"][:3],
        labels=np.array(point["LABELS"]["value"], dtype=str),
        rate=float(point["RATE"]["value"][0]),
        unit=units[0] if units else "",
    )
    sys.stdout.buffer.write(stream.getvalue())


if __name__ == "__main__":
    main()
