"""A folder of 200 damaged recordings of all formats, with three good ones among them.

Run by `make stress`. infer.py must rank the good ones, name what it does not use, exit with 1, show
no traceback, and stay under 1 GB and 60 s of processor time.
"""

from __future__ import annotations

import io
import json
import os
import random
import re
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

from recorded_variants import VARIANTS, write_c3d, write_trc

from mlci.recordings.files import FORMATS

SEED, COUNT, GOOD = 11, 200, 3
MOST_BYTES, MOST_SECONDS = 1e9, 60.0
NOT_UTF_8 = os.fsdecode(b"not_utf_8_\xff\xfe.csv")

# Runs a command, and writes processor time [s] and memory [bytes]: of this process alone, as what
# is started by one that has much memory counts as having it too.
MEASURE = """
import resource, subprocess, sys
status = subprocess.run(sys.argv[2:]).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss * 1024, file=open(sys.argv[1], "w"))
sys.exit(status)
"""

Damage = Callable[[bytes, random.Random], bytes]


def cut(data: bytes, random_: random.Random) -> bytes:
    """Less of it."""
    return data[: random_.randrange(len(data))]


def flipped(data: bytes, random_: random.Random) -> bytes:
    """Some bytes are others."""
    changed = bytearray(data)
    for _ in range(random_.randrange(1, 30)):
        changed[random_.randrange(len(changed))] = random_.randrange(256)
    return bytes(changed)


def flipped_head(data: bytes, random_: random.Random) -> bytes:
    """Some of the first bytes, or of the last, are others: there sizes are claimed."""
    changed = bytearray(data)
    for _ in range(random_.randrange(1, 12)):
        place = random_.randrange(min(600, len(changed)))
        changed[place if random_.random() < 0.5 else -place - 1] = random_.choice([0, 127, 255, 9])
    return bytes(changed)


def blanked(data: bytes, random_: random.Random) -> bytes:
    """A part of it is zeros."""
    first = random_.randrange(len(data))
    return data[:first] + bytes(min(300, len(data) - first)) + data[first + 300 :]


def noise(data: bytes, random_: random.Random) -> bytes:
    """Nothing of it is left."""
    return random_.randbytes(len(data))


def nothing(_data: bytes, _random: random.Random) -> bytes:
    """An empty file."""
    return b""


DAMAGES: tuple[Damage, ...] = (cut, flipped, flipped_head, blanked, noise, nothing)


def swing(turn: float = 0.0) -> pd.DataFrame:
    """A path of the pendulum."""
    time = np.arange(101) * 0.01
    return pd.DataFrame(
        {
            "time": time,
            "angle": 1 + turn + 0.3 * np.sin(time),
            "angular_velocity": 0.3 * np.cos(time),
        }
    )


def originals(folder: Path) -> dict[str, bytes]:
    """The content of a good file of each format, by suffix."""
    writers = {
        variant.suffix: variant.write for variant in VARIANTS.values() if not variant.options
    }
    writers |= {"c3d": write_c3d, "trc": write_trc}
    content = {}
    for suffix, write in writers.items():
        path = folder / f"original.{suffix}"
        write(swing(), path)
        content[suffix] = path.read_bytes()
        path.unlink()
    assert {f".{suffix}" for suffix in content} == set(FORMATS)
    return content


def zipped(**entries: bytes) -> bytes:
    """A zip file."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in entries.items():
            archive.writestr(name.replace("__", "/") + ".npy", data)
    return stream.getvalue()


def array_file(shape: str, data: bytes = b"") -> bytes:
    """A numpy array with a header that claims a shape."""
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode() + data


def write_claims(folder: Path) -> None:
    """Files that claim, or unpack to, far more than they hold."""
    huge = bytes(400_000_000)
    files = {
        "shape.npz": zipped(states=array_file("(1000000000000, 2)"), time=array_file("(5,)")),
        "bomb.npz": zipped(states=array_file("(200000000, 2)", huge)),
        "bomb.xlsx": zipped(sheet=huge),
        "deep.json": b"[" * 100_000,
        "deep_object.json": b'{"time":' * 100_000,
        "units.csv": b"time,angle [9**9**9**9],angular_velocity\n0,1,0\n1,1,0\n",
        "one_line.csv": b"1," * 3_000_000,
        "numbers.csv": b"time,angle,angular_velocity\n" + b"9" * 5_000_000 + b",1,0\n1,1,0\n",
        "wide.json": json.dumps({"time": [0, 1], "states": [[1] * 1000] * 2}).encode(),
        "endless.csv": b"time,angle,angular_velocity\n0,1,0\n1e300,1,0\n",
    }
    for name, data in files.items():
        (folder / name).write_bytes(data)
    rows = pd.DataFrame({"time": np.zeros(30_000_000, dtype=np.int8)})
    rows.assign(angle=rows["time"], angular_velocity=rows["time"]).to_parquet(
        folder / "rows.parquet"
    )


def write_oddities(folder: Path) -> None:
    """What has the name of a recording and is no readable file."""
    os.mkfifo(folder / "pipe.csv")
    (folder / "folder.npz").mkdir()
    (folder / "dangling.json").symlink_to(folder / "nowhere.json")
    (folder / "loop.csv").symlink_to(folder / "loop.csv")
    (folder / "device.csv").symlink_to("/dev/zero")
    closed = folder / "closed.csv"
    closed.write_text("time,angle,angular_velocity\n")
    closed.chmod(0)
    (folder / NOT_UTF_8).write_bytes(b"time,angle\n0,1\n")
    (folder / ".hidden.csv").write_bytes(b"\x00")


def write_damaged(folder: Path) -> int:
    """Write all damaged files; returns how many files are not hidden."""
    random_, content = random.Random(SEED), originals(folder)
    write_claims(folder)
    write_oddities(folder)
    number = 0
    while len(list(folder.iterdir())) - 1 < COUNT:
        suffix = sorted(content)[number % len(content)]
        damage = DAMAGES[number // len(content) % len(DAMAGES)]
        path = folder / f"{damage.__name__}_{number:03d}.{suffix}"
        path.write_bytes(damage(content[suffix], random_))
        number += 1
    return len(list(folder.iterdir())) - 1


def check(found: bool, words: str, done: subprocess.CompletedProcess[bytes]) -> None:
    """Stop with what was printed, where something is not as it must be."""
    if not found:
        print(done.stdout.decode(errors="replace")[-3000:])
        print(done.stderr.decode(errors="replace")[-6000:])
        sys.exit(f"damaged recordings: {words}")


def main() -> None:
    """Write the folder, run the command, check how it ends."""
    with tempfile.TemporaryDirectory() as base:
        folder = Path(base, "recorded")
        folder.mkdir()
        files = write_damaged(folder)
        for number in range(GOOD):
            swing(0.1 + 0.4 * number).to_csv(folder / f"good_{number}.csv", index=False)
        infer = str(TESTS.parent / "experiments" / "infer.py")
        words = ["grid=100", "dt=0.5", "inference.calibrate=false", f"results={base}/results"]
        command = [sys.executable, infer, f"demonstrations={folder}", *words]
        done = subprocess.run(
            [sys.executable, "-c", MEASURE, f"{base}/used", *command], capture_output=True, cwd=base
        )
        errors = done.stderr.decode(errors="replace")
        check(done.returncode == 1, f"exit status {done.returncode}, not 1", done)
        check("Traceback" not in errors, "a traceback", done)
        (record,) = Path(base, "results", "inference").iterdir()
        ranked = set(pd.read_csv(record / "demonstrations.csv")["demonstration"].astype(str))
        check({f"good_{i}" for i in range(GOOD)} <= ranked, f"ranked are {sorted(ranked)}", done)
        refused = [line for line in errors.splitlines() if line.startswith("not used: ")]
        copies = re.findall(r"^note: .*?(?: and (\d+) more)?: is a copy of", errors, re.MULTILINE)
        named = len(refused) + len(ranked) + sum(1 + int(more or 0) for more in copies)
        check(named >= files + GOOD, f"only {named} of {files + GOOD} files are named", done)
        seconds, size = map(float, Path(base, "used").read_text().split())
        check(seconds < MOST_SECONDS, f"{seconds:.0f} s of processor time", done)
        check(size < MOST_BYTES, f"{size / 1e6:.0f} MB", done)
    kinds = Counter(line.rpartition("/")[2].partition(".")[2].partition(":")[0] for line in refused)
    print(f"{files} damaged files, {len(refused)} named: {dict(kinds.most_common())}")
    print(f"{len(ranked)} ranked, {GOOD} of them good; {seconds:.1f} s, {size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
