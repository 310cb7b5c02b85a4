"""Sweeps under fire: killed again and again, two at once, on a disk that fills up.

Run by `make stress`; ends with an error at the first thing that is not as it must be.
"""

from __future__ import annotations

import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from filelock import FileLock

# The checkout comes first: tests/ has a folder experiments/ too.
TESTS = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TESTS.parent), str(TESTS)]

from sweeps import faulty, gone, running, start, tables

KILLS = 12
SEED = 2026
# In each worker: whoever finishes a point says so, in a file that is only ever appended to.
COUNTING = """
from experiments.sweep import attempt as _attempt

def _counted(point, *arguments, _write=_attempt.write_result):
    _write(point, *arguments)
    with open("finished.txt", "a") as file:
        file.write(point.identity + "\\n")

_attempt.write_result = _counted
"""


def folder_for(base: Path, name: str) -> tuple[Path, list[str]]:
    """A new folder, and the sweep of 12 points of about a second in it."""
    folder = base / name
    folder.mkdir()
    sweep = ["-m", *faulty(folder), "+system.fault=slow", "study=s", "workers=2"]
    with open(folder / "faulty.py", "a") as file:
        file.write(COUNTING)
    return folder, [*sweep, "seed=0,1,2", "actions=2,3", "temperature=1,2"]


def check_whole(folder: Path, points: int, expected: dict[str, bytes]) -> None:
    """All points finished, each once; nothing is locked or half written; the tables are right."""
    finished = Counter((folder / "finished.txt").read_text().split())
    assert len(finished) == points, f"{len(finished)} of {points} points finished"
    assert set(finished.values()) == {1}, f"finished more than once: {finished.most_common(3)}"
    for path in (folder / "results").rglob("*.lock"):
        with FileLock(path).acquire(blocking=False):
            pass
    left = [path for path in (folder / "results" / "points").rglob("*.part")]
    assert not left, f"left behind: {left}"
    if expected:
        assert tables(folder, "s") == expected, "the tables differ from the undisturbed run's"


def finish(folder: Path, sweep: list[str]) -> None:
    """Run the sweep to its end."""
    process = start(folder, *sweep)
    out, err = process.communicate(timeout=600)
    assert process.returncode == 0, f"{out}\n{err}"
    assert gone(process.pid), "processes are left"


def undisturbed(base: Path) -> dict[str, bytes]:
    """The tables of a sweep that nobody disturbs, run once for all storms."""
    if not (base / "calm").exists():
        calm, sweep = folder_for(base, "calm")
        finish(calm, sweep)
        check_whole(calm, 12, {})
    return tables(base / "calm", "s")


class Crowd:
    """What others do to results meanwhile: `clean --yes` and figures, again and again."""

    def __init__(self, folder: Path) -> None:
        python, results = shlex.quote(sys.executable), shlex.quote(str(folder / "results"))
        clean = f"{python} {TESTS.parent}/experiments/results.py clean --yes --results {results}"
        draw = f"{python} -m paper_figures s --jobs 1 --results {results}"
        loop = f"while :; do {clean}; echo clean: $?; {draw}; echo figures: $?; done"
        self.log = folder / "crowd.txt"
        with open(self.log, "wb") as log:
            self.process = subprocess.Popen(
                ["bash", "-c", loop],
                cwd=TESTS.parent,
                env={**os.environ, "PYTHONPATH": str(TESTS.parent)},
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def stop(self) -> Counter[str]:
        """End it, and check that nothing was wrong; returns how its commands ended."""
        kill([self.process.pid])
        self.process.wait(timeout=600)
        kill(pids(self.process.pid))
        text = self.log.read_text()
        assert "Traceback" not in text, text
        assert "\nmoved: " not in text, f"something was taken that is used: {text}"
        ends = Counter(re.findall(r"^(?:clean|figures): \d+$", text, re.M))
        assert set(ends) <= {"clean: 0", "clean: 2", "figures: 0", "figures: 1"}, ends
        return ends


def kill_storm(base: Path) -> None:
    """Kill sweeps at random moments, resume, and compare with an undisturbed run.

    Meanwhile there are `clean --yes`, figures, and a second sweep of the same study, which is
    killed now and then, and otherwise goes on.
    """
    chance = random.Random(SEED)
    expected = undisturbed(base)
    kills: Counter[str] = Counter()
    ends: Counter[str] = Counter()
    slowest, storms = 0.0, 0
    while kills.total() < KILLS:
        storms += 1
        folder, sweep = folder_for(base, f"storm{storms}")
        crowd, second = Crowd(folder), start(folder, *sweep)
        while kills.total() < KILLS:
            process = start(folder, *sweep)
            time.sleep(chance.uniform(0.5, 8.0))
            victims = chance.choice(["parent", "worker", "workers", "all"])
            if not strike(process, victims, chance):
                process.communicate(timeout=600)
                break
            began = time.monotonic()
            process.communicate(timeout=600)
            assert gone(process.pid, patience=60), f"orphans: {running(process.pid)}"
            slowest = max(slowest, time.monotonic() - began)
            kills[victims] += 1
            if chance.random() < 0.5:
                kill(pids(second.pid))
                second.communicate(timeout=600)
                second = start(folder, *sweep)
        finish(folder, sweep)
        out, err = second.communicate(timeout=600)
        # A point whose worker was killed has failed, for whoever waited for it.
        is_told = second.returncode == 1 and "points failed" in err
        assert second.returncode == 0 or is_told, f"{out}\n{err}"
        ends += crowd.stop()
        check_whole(folder, 12, expected)
        assert not (folder / "results" / "trash").exists()
    print(
        f"kill storm: {kills.total()} kills ({dict(kills)}) over {storms} sweeps of 12 points, "
        f"each beside a second one and a crowd ({dict(ends)}); tables equal; the last process "
        f"was gone {slowest:.2f} s after its parent"
    )


def strike(process: subprocess.Popen[str], victims: str, chance: random.Random) -> bool:
    """Kill a sweep's parent, and some or all of its workers before; False if it has ended."""
    if process.poll() is not None:
        return False
    others = [pid for pid in pids(process.pid) if pid != process.pid]
    if victims == "worker":
        others = chance.sample(others, min(1, len(others)))
    if victims != "parent":
        kill(others)
        time.sleep(chance.uniform(0.0, 3.0))
    if process.poll() is not None:
        return False
    if victims == "all":
        kill(pids(process.pid))
    kill([process.pid])
    return True


def pids(group: int) -> list[int]:
    """The live processes of a group."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(path.name)) == group:
                found.append(int(path.name))
        except ProcessLookupError:
            continue
    return found


def kill(victims: list[int]) -> None:
    """SIGKILL, each by its id."""
    for pid in victims:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue


def terminated(base: Path) -> None:
    """SIGTERM to the parent alone: it ends its workers, says so, and the same command resumes."""
    folder, sweep = folder_for(base, "terminated")
    process = start(folder, *sweep)
    while not (folder / "finished.txt").exists():
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=600)
    assert process.returncode == 130, err
    assert "stopped; what has finished is kept" in err, err
    assert "Traceback" not in err, err
    assert gone(process.pid), "processes are left"
    finish(folder, sweep)
    check_whole(folder, 12, undisturbed(base))
    print("terminated: stopped, resumed, each point once, tables equal")


def two_at_once(base: Path) -> None:
    """Two sweeps over the same points, started together."""
    expected = undisturbed(base)
    folder, sweep = folder_for(base, "two")
    both = [start(folder, *sweep) for _ in range(2)]
    outputs = [process.communicate(timeout=600) for process in both]
    assert [process.returncode for process in both] == [0, 0], outputs
    check_whole(folder, 12, expected)
    shared = [len([line for line in out.splitlines() if line[:1] == "["]) for out, _ in outputs]
    waited = sum("waiting for" in out for out, _ in outputs)
    print(f"two sweeps at once: 12 points, each once; {shared} looked at, {waited} waited")


def full_disk(base: Path) -> None:
    """A disk that fills up while points are run, where this user may mount a small one."""
    expected = undisturbed(base)
    folder, sweep = folder_for(base, "full")
    (folder / "results").mkdir()
    if os.system(f"mount -t tmpfs -o size=500k tmpfs {folder / 'results'} 2>/dev/null"):
        print("full disk: not tried, as this user may not mount")
        return
    try:
        process = start(folder, *sweep)
        _, err = process.communicate(timeout=600)
        assert process.returncode == 1, err
        assert "No space left on device" in err, err
        assert not list((folder / "results").rglob("*.part"))
        failed = err.partition(" points failed")[0].split("\n")[-1]
        assert failed in [f"{count} of 12" for count in range(1, 12)], failed
        assert not os.system(f"mount -o remount,size=100m {folder / 'results'}")
        finish(folder, sweep)
        check_whole(folder, 12, expected)
        print(f"full disk: {failed} points failed, and finished once there was room")
    finally:
        os.system(f"umount {folder / 'results'}")


def main() -> None:
    """Run all storms, or those that are named."""
    sys.stdout.reconfigure(line_buffering=True)
    base = Path(tempfile.mkdtemp(prefix="storm-"))
    for storm in (kill_storm, terminated, two_at_once, full_disk):
        if sys.argv[1:] and storm.__name__ not in sys.argv[1:]:
            continue
        began = time.monotonic()
        storm(base)
        print(f"{storm.__name__}: {time.monotonic() - began:.0f} s")
    shutil.rmtree(base)


if __name__ == "__main__":
    main()
