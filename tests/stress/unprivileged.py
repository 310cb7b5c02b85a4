"""Commands of a user without rights on a folder of results with parts that cannot be read.

Run by `make stress`; as root it gives up the rights that root has beyond others, by `setpriv`.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from pathlib import Path

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

import tampering

PARTS = ("points", "points/*0", "points/*/record.json", "s", "s/study.json", "s/tables", "store")
PARTS += ("s/tables/*.csv", "paper/figures", "store/*", ".")


def _close(results: Path, part: str) -> int:
    """Take all rights from a part of the folder of results; how many paths that were."""
    paths = [results] if part == "." else sorted(results.glob(part))[:1]
    if not paths and part == "points/*0":
        paths = sorted(results.glob("points/*"))[:1]
    for path in paths:
        path.chmod(0)
    return len(paths)


def _everything(folder: Path) -> dict[str, int]:
    """Every path with its size."""
    return {str(path): path.lstat().st_size for path in folder.rglob("*")}


def _open(folder: Path) -> None:
    """Give all rights back, from the top."""
    folder.chmod(0o755)
    for top, folders, files in os.walk(folder):
        for name in (*folders, *files):
            Path(top, name).chmod(0o755)


def check() -> int:
    """Call every command on every folder with a closed part; returns how many calls it tried."""
    base = Path(tempfile.mkdtemp(prefix="unprivileged-"))
    results = tampering.pristine(base)
    listed = tampering.read_study(results / "s")
    tampering.IDENTITIES.update(enumerate(listed.points))
    shutil.copytree(results, base / "pristine")
    tried = 0
    for part in PARTS:
        for name in tampering.commands():
            shutil.rmtree(results)
            shutil.copytree(base / "pristine", results)
            before = _everything(results)
            assert _close(results, part), part
            ending = tampering.call(name, results)
            _open(results)
            where = f"{name} where {part} is closed: status {ending.status}\n{ending.text}"
            assert ending.status in (0, 1, 2), where
            assert "Traceback" not in ending.text, where
            assert ending.status == 0 or ending.text.strip(), where
            if name.startswith("clean"):
                gone = set(before) - set(_everything(results))
                assert not gone or ending.status == 0, f"{where}\n{gone}"
                assert not gone or part in ("s/tables/*.csv", "paper/figures"), f"{where}\n{gone}"
            tried += 1
    shutil.rmtree(base)
    return tried


def main() -> None:
    """Check without the rights of root, if this is root."""
    if os.geteuid() == 0 and sys.argv[1:] != ["restricted"]:
        setpriv = shutil.which("setpriv")
        if setpriv is None:
            print("unprivileged: not tried, as root has no setpriv here")
            return
        dropped = "--bounding-set=-dac_override,-dac_read_search,-fowner"
        os.execv(setpriv, [setpriv, dropped, sys.executable, __file__, "restricted"])
    print(f"unprivileged: {check()} commands, each with a clear end")


if __name__ == "__main__":
    main()
