"""Hundreds of malformed configs and command lines, each of which must be refused in plain words.

Refused is: exit status 2, at most a screen of text that names the key or the file, no traceback and
nothing written. Run by `make stress`; the seed is fixed, and `fuzz.py SEED` tries another.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from experiments import app, infer, run
from experiments.config.paths import CONF
from experiments.sweep.plugins import register_plugins

SCREEN = 24  # lines
SUBPROCESSES = 16  # cases that are also run as commands of their own

NOT_NUMBERS = ("fast", "true", "[1,2]", "{a:1}", "nan", "-inf", "inf", "''", "1e400", "-1", "1:30")
NOT_SHAPES = (
    *("5", "[]", "[0,5]", "[-1,5]", "[1.5,5]", "[a,b]", "[5]", "[5,5,5]", "{a:1}", "true"),
    *("[[5],5]", "[nan,5]", "[9999999999999999999999,5]", "[1000000,1000000]", "fast"),
)
NOT_REGIONS = (
    *("3", "[1]", "{lower:[0,0]}", "{lower:[0,0],upper:[1]}", "{lower:[1,0],upper:[0,1]}"),
    *("{lower:[nan,0],upper:[1,1]}", "{lower:[0,-99],upper:[1,99]}", "{lower:a,upper:b}"),
    *("{lower:[0,0],upper:[1,1],top:[2,2]}", "{lower:[null,0],upper:[1,1]}", "true"),
)
NOT_TARGETS = (
    *("os.system", "builtins.eval", "mlci.systems.System", "mlci.systems", "mlci", "''", "3", "."),
    *("..", "a..b", "[1]", "null", "mlci.systems.Pendulum.space", "experiments.run.main", "true"),
    *("mlci.systems.Nothing", "numpy.zeros", ".mlci.systems.Pendulum", "fast()"),
)
MODEL_NUMBERS = ("dt", "temperature", "actions", "transition.samples", "inference.prior")
STUDY_NUMBERS = (
    *("horizon", "seed", "rollouts", "safety.margin", "safety.width", "ranks.demonstrations"),
    *("ranks.subsets", "ranks.top", "demonstrations.pairs", "demonstrations.keep"),
    *("demonstrations.dt", "demonstrations.goal_tolerance", "demonstrations.restarts"),
    *("demonstrations.iterations", "demonstrations.goal_weight", "demonstrations.hold"),
    *("system.gravity", "system.speed_limit", "workers"),
)
BROKEN_LINES = (
    *("dt", "=3", "dt=[1", "dt={a", "dt='x", 'dt="', "dt=)", "dt=[1,,2]", "~", "+", "++", "~nope"),
    *("dt=${", "dt=${nothing}", "dt=${dt}", "dt=${horizon.x}", "dt=${oc.env:NOT_SET_ANYWHERE}"),
    *("dt=${nope:1}", "horizon=${dt} dt=${horizon}", "truth=${truth}", "dt=${hydra:nope}"),
    *("+nope=1", "++a.b.c=1", "+dt=1", "grid=300", "grid=../truth/c1", "truth=/etc/passwd"),
    *("truth=c1/", "grid@x=100", "system=null", "grid={a:1}", "+truth=c2"),
    *(
        "experiment=nope",
        "+experiment@x=paper",
        "scale=tiny",
        "dt.x=1",
        "+dt.x=1",
        "truth.boxes.x=1",
    ),
    *("truth.boxes[0]=1", "dt@a:b=1", "study=../x", "study=store", "study=''"),
    *("hydra.mode=NEVER", "hydra/launcher=nope", "hydra/sweeper=nope", "hydra.run.dirr=1"),
    *("hydra.job.nope=1", "hydra=3", "dt=\x00", "dt=\ud83d", "\ud83d=1", "dt=1 2", "dt=cast(x)"),
    *("dt=int(fast)", "dt=float([a])", "dt=choice(", "dt=range(1,2,0)", "dt=" + "9" * 5000),
    *(
        "dt=" + "[" * 300 + "]" * 300,
        "x" * 3000 + "=1",
        "truth.boxes=" + "{a:" * 80 + "1" + "}" * 80,
    ),
    *("truth.name=3", "truth.name=null", "truth.name=[a]", "~truth", "~system", "~dt", "system=3"),
)
BROKEN_SWEEPS = (
    *("dt=0.25,fast", "dt=0.25,0.3,0.7", "dt=interval(0,1)", "dt=range(0,1,0)", "dt=glob(*)"),
    *("experiment=paper,other", "study=a,b", "workers=1,2", "grid=100,300", "truth=c1,wall,nope"),
    *("dt=choice()", "dt=tag(a)", "dt=0.25,", "actions=1,[2,3]", "dt=0.25,${nothing}", "scale=a,b"),
    *("system._target_=mlci.systems.Pendulum,os.system", "seed=1,-1", "dt=nan,inf", "+nope=1,2"),
    *("dt=shuffle(3)", "dt=sort(fast,1)", "results=a,b", "~dt=1,2", "hydra.mode=RUN,MULTIRUN"),
)
BROKEN_FILES = {
    "truncated": b"name: mine\nboxes:\n  - lower: [1, 2\n",
    "cut word": b"name: mine\nboxes:\n  - lower: [1, 2]\n    upp",
    "not utf-8": b"name: \xff\xfe\n",
    "utf-16": "name: mine\n".encode("utf-16"),
    "latin": "name: caf\u00e9\n".encode("latin-1"),
    "nul": b"name: a\x00b\n",
    "tab": b"name:\n\t- a\n",
    "twice": b"name: a\nname: b\n",
    "list": b"- a\n- b\n",
    "scalar": b"just words\n",
    "number": b"3\n",
    "empty": b"",
    "blank": b"\n\n# nothing\n",
    "binary": bytes(range(256)),
    "python": b"name: !!python/object/apply:os.system ['touch harm']\n",
    "tag": b"name: !nope 3\n",
    "alias": b"name: *nothing\n",
    "laughs": b"a: &a [1,1]\n"
    + b"".join(b"%c: &%c [*%c,*%c]\n" % (c + 1, c + 1, c, c) for c in range(97, 103)),
    "deep": b"name: " + b"[" * 5000 + b"]" * 5000,
    "documents": b"name: a\n---\nname: b\n",
    "defaults": b"defaults: 3\n",
    "lost default": b"defaults:\n  - nothing\n",
    "cycle": b"defaults:\n  - mine\n",
    "bad default": b"defaults:\n  - a: b: c\n",
    "override": b"defaults:\n  - override /nothing: x\n",
    "header": b"# @package nowhere.at.all\nname: mine\n",
    "interpolation": b"name: ${nothing}\nshape: ${nothing}\n",
    "wrong types": b"name: [1]\nboxes: 3\nshape: fast\nsystem: 3\n",
    "unknown": b"nane: mine\nshap: [3]\nsystm: 4\n",
    "null": b"null\n",
    "dates": b"name: 2026-01-01\nshape: 2026-01-01\n",
    "keys": b"1: 2\ntrue: 3\nnull: 4\n",
    "long": b"name: " + b"x" * 100_000 + b"\nshape: [" + b"9" * 4000 + b"]\n",
}
BROKEN_EXPERIMENTS = (
    *(
        b"params: 3",
        b"params: [a]",
        b"params: {dt: [1]}",
        b"params: {dt: {a: 1}}",
        b"param: {dt: 1}",
    ),
    *(
        b"params: {nope: '1,2'}",
        b"params: {dt: ''}",
        b"params: {dt: '0.1,'}",
        b"params: {dt: null}",
    ),
    *(b"params: {experiment: 'a,b'}", b"params: {'dt ': '1,2'}", b"params: {dt: 'x('}"),
)


@dataclass(frozen=True)
class Case:
    """One thing that is wrong: a command, its arguments, files to lay, and a word of the answer."""

    command: str
    arguments: tuple[str, ...]
    named: tuple[str, ...]  # the answer holds one of these
    files: dict[str, bytes | None] = field(default_factory=dict)  # None is a folder

    def __str__(self) -> str:
        shown = " ".join(word if len(word) < 60 else word[:57] + "..." for word in self.arguments)
        contents = [f"{name}: {data!r:.80}" for name, data in self.files.items()]
        return " | ".join([f"{self.command} {shown!a}", *contents])


def cases(random_: random.Random) -> Iterator[Case]:
    """All of the fixed ones, and random mutations of keys and files."""
    values = [
        *((key, value) for key in MODEL_NUMBERS + STUDY_NUMBERS for value in NOT_NUMBERS),
        *(
            (f"{key}.shape", value)
            for key in ("grid", "safety", "hypotheses")
            for value in NOT_SHAPES
        ),
        *((key, value) for key in ("tasks", "truth.boxes.0") for value in NOT_REGIONS),
        *(("system._target_", value) for value in NOT_TARGETS),
    ]
    fitting = {("actions", "[1,2]"), ("workers", "null")}
    for key, value in random_.sample(values, 200):
        group = key.split(".")[0]
        study = group != "system" and (
            key in STUDY_NUMBERS or group in ("safety", "truth", "tasks")
        )
        commands = ["run", "sweep"] if study else ["run", "sweep", "infer"]
        if key == "truth.boxes.0":
            key, value = "truth.boxes", f"[{value}]"
        command = random_.choice(commands)
        words = [f"{key}={value}", *(["demonstrations=x.csv"] if command == "infer" else [])]
        if (key, value) not in fitting:
            yield Case(command, tuple(words), (key, group))
    for line in BROKEN_LINES:
        words = tuple(line.split(" ")) if line.startswith("horizon") else (line,)
        yield Case(random_.choice(["run", "sweep"]), words, _words(line))
    for line in BROKEN_SWEEPS:
        yield Case("sweep", (line,), _words(line))
    for key in random_.sample(MODEL_NUMBERS + STUDY_NUMBERS, 15):
        place = random_.randrange(len(key))
        typo = key[:place] + random_.choice("jqx") + key[place + 1 :]
        sign = random_.choice(["", "+", "++"])
        names = (typo.split(".")[0],)
        yield Case(random_.choice(["run", "sweep"]), (f"{sign}{typo}=1",), names)
    for data in BROKEN_FILES.values():
        group = random_.choice(["truth", "grid", "system", "experiment"])
        yield _file_case(group, data, random_)
        yield _file_case(random_.choice(["truth", "system"]), data, random_)
    for own in BROKEN_EXPERIMENTS:
        text = b"# @package _global_\nhydra:\n  mode: MULTIRUN\n  sweeper:\n    " + own + b"\n"
        names = ("param", "mine", "sweeper", "nope", "dt", "experiment")
        files = {"experiment/mine.yaml": text}
        yield Case("sweep", ("--config-dir", "{folder}", "experiment=mine"), names, files)
    for path in [*CONF.glob("truth/*.yaml"), *CONF.glob("system/*.yaml")] * 4:
        data = bytearray(path.read_bytes())
        for _ in range(3):
            data[random_.randrange(len(data))] = random_.choice(b"\xff\xfe\x80")
        yield _file_case(path.parent.name, bytes(data), random_)
    yield Case(
        "run", ("--config-dir", "{folder}", "grid=mine"), ("grid",), {"grid/mine.yaml": None}
    )
    yield Case("run", ("--config-dir", "{folder}/nothing", "dt=0.5"), ("nothing",))
    yield Case("run", ("--config-dir", "{folder}/file", "dt=0.5"), ("file",), {"file": b"a: 1\n"})
    yield Case("run", ("--config-name", "nothing"), ("nothing",))
    yield Case("run", ("--config-path", "/nothing"), ("nothing",))
    yield Case("run", ("--nothing",), ("--nothing",))
    yield Case("run", ("--cfg", "nothing"), ("nothing",))
    yield Case("infer", (), ("demonstrations",))
    for value in (
        "nothing.csv",
        "{folder}/nothing",
        "'*.nothing'",
        "3",
        "[]",
        "{a:1}",
        "[1,2]",
        "null",
    ):
        named = ("demonstrations", "no such file")
        yield Case("infer", (f"demonstrations={value}",), named)
    for key in (
        "recorded_dt",
        "top",
        "start",
        "goal",
        "columns",
        "time_unit",
        "demonstration",
        "truth",
    ):
        for value in ("fast", "[a]", "-1"):
            yield Case("infer", ("demonstrations=x.csv", f"{key}={value}"), (key, "x.csv"))


def _file_case(group: str, data: bytes, random_: random.Random) -> Case:
    """A file of a config group that is wrong in itself."""
    multirun = random_.choice(["run", "sweep"])
    names = ("mine", "name", "boxes", "shape", "system", "truth", "grid", "nane", "nothing", "key")
    files: dict[str, bytes | None] = {f"{group}/mine.yaml": data}
    if group == "experiment":
        files["experiment/mine.yaml"] = b"# @package _global_\n" + data + b"\nnane: 3\n"
    return Case(multirun, ("--config-dir", "{folder}", f"{group}=mine"), names, files)


def _words(line: str) -> tuple[str, ...]:
    """What an answer about a command line may name: its keys, or the start of it."""
    keys = [part.partition("=")[0].strip("+~ ") for part in line.split(" ")]
    return (*(key.split(".")[0].split("@")[-1][:40] for key in keys if key), line[:10])


def attempt(case: Case, folder: Path, separate: bool) -> str | None:
    """Run a case; returns what is wrong with the answer, or None."""
    for name, data in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if data is None:
            path.mkdir()
        else:
            path.write_bytes(data)
    before = sorted(folder.rglob("*"))
    words = [word.replace("{folder}", str(folder)) for word in case.arguments]
    if not any(word.startswith("results=") for word in words):
        words.append(f"results={folder / 'results'}")
    words = ["-m"] * (case.command == "sweep") + words
    script = CONF.parent / "experiments" / f"{'infer' if case.command == 'infer' else 'run'}.py"
    status, out, err = (_as_command if separate else _in_process)(script, words, folder)
    if sorted(folder.rglob("*")) != before:
        return f"wrote {sorted(set(folder.rglob('*')) - set(before))}"
    # A path that stands for no recording is told like a recording that cannot be used.
    if status not in ({app.REFUSED, app.FAILED} if case.command == "infer" else {app.REFUSED}):
        return f"exit status {status}: {err[-300:]!r}"
    if "Traceback" in err + out:
        return f"traceback: {err[-600:]}"
    if len(err.splitlines()) > SCREEN or max(map(len, err.splitlines()), default=0) > 1000:
        return f"more than a screen: {len(err.splitlines())} lines, {len(err)} characters"
    escaped = [name.encode("ascii", "backslashreplace").decode() for name in case.named]
    if not any(name in err for name in (*case.named, *escaped)):
        return f"names none of {case.named}: {err!r:.400}"
    return None


def _attempt(case: Case, separate: bool) -> str | None:
    """`attempt`, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return attempt(case, Path(folder), separate)


def _in_process(script: Path, words: list[str], folder: Path) -> tuple[object, str, str]:
    """The command as a function: most cases, because it is quick."""
    out, err, status = io.StringIO(), io.StringIO(), None
    arguments, sys.argv = sys.argv, [str(script), *words]
    where = Path.cwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = (infer if script.stem == "infer" else run).main()
    except SystemExit as stop:
        status = stop.code
    except BaseException as error:
        status = f"{type(error).__name__}: {error}"
    finally:
        sys.argv = arguments
        os.chdir(where)
    return status, out.getvalue(), err.getvalue()


def _as_command(script: Path, words: list[str], folder: Path) -> tuple[int, str, str]:
    """The command as a user gives it."""
    command = [sys.executable, str(script), *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)
    return done.returncode, done.stdout, done.stderr


def main(seed: int = 0) -> int:
    """Try all cases; returns 1 if the answer to any is not as it should be."""
    random_ = random.Random(seed)
    every = list(cases(random_))
    start, wrong = time.perf_counter(), 0
    spawnable = [i for i, case in enumerate(every) if "\x00" not in "".join(case.arguments)]
    separate = set(random_.sample(spawnable, SUBPROCESSES))
    # A process a core: a case takes a fifth of a second of one, most of it Hydra's.
    half = max(1, (os.cpu_count() or 1) // 2)  # `make stress` runs two files at a time
    with ProcessPoolExecutor(half, initializer=register_plugins) as pool:
        problems = pool.map(_attempt, every, [i in separate for i in range(len(every))])
        for case, problem in zip(every, problems, strict=True):
            if problem:
                wrong += 1
                print(f"NOT REFUSED AS IT SHOULD BE: {case}\n    {problem}", flush=True)
    print(
        f"{len(every)} malformed configs and command lines, {SUBPROCESSES} of them as processes: "
        f"{wrong} not refused as they should be, {time.perf_counter() - start:.0f} s"
    )
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2])))
