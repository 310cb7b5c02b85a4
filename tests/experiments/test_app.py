"""Commands as a shell starts them: stopped while their modules are imported."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from sweeps import gone
from tiny_point import TINY

from experiments.app import DONE, FAILED, run_command
from experiments.config.paths import CHECKOUT
from experiments.sweep.plugins import register_options, register_plugins

# A command, and a word in the name of the first module that takes time.
COMMANDS = {
    "run": (["experiments/run.py", "-m", "truth=c1,c2"], "hydra"),
    "infer": (["experiments/infer.py", "demonstrations=none"], "numpy"),
    "results": (["experiments/results.py", "status"], "argparse"),
    "figures": (["-m", "paper_figures"], "argparse"),
    "report": (["-m", "paper_figures.report"], "argparse"),
}


@pytest.mark.parametrize("delay", [0.0, pytest.param(0.03, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", COMMANDS)
def test_ctrl_c_while_modules_are_imported_ends_a_command_quietly(
    name: str, delay: float, tmp_path: Path
) -> None:
    (first, *words), imported = COMMANDS[name]
    first = first if first == "-m" else str(CHECKOUT / first)
    process = subprocess.Popen(
        [sys.executable, "-X", "importtime", first, *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stderr is not None
    while imported not in process.stderr.readline():
        assert process.poll() is None
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=600)
    told = [line for line in err.splitlines() if not line.startswith("import time:")]
    assert (process.returncode, out, told) == (130, "", [])
    assert gone(process.pid)
    assert not list(tmp_path.iterdir())


def test_a_reader_that_has_gone_and_a_full_disk_leave_no_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As with `| head -1`."""
    reader, writer = os.pipe()
    os.close(reader)
    monkeypatch.setattr(sys, "argv", ["infer.py", "demonstrations=a"])
    full = os.open("/dev/full", os.O_WRONLY)
    for where, told in ((writer, ""), (full, "No space left")):
        with os.fdopen(where, "w") as stream, monkeypatch.context() as patch:
            patch.setattr(sys, "stdout", stream)
            with pytest.raises(SystemExit) as end:
                run_command("infer", lambda _: print("an answer") or 0)
        err = capsys.readouterr().err
        assert end.value.code == FAILED
        assert "Traceback" not in err
        assert told in err
        assert len(err.splitlines()) == len(told[:1])


HEAVY = {
    *("numpy", "pandas", "scipy", "scipy.sparse", "scipy.special", "numba", "matplotlib"),
    *("hydra", "omegaconf", "pydantic", "tqdm"),
}
LOADED = """
import runpy, sys
sys.path.insert(0, {checkout!r})
sys.argv[1:] = {words!r}
sys.argv[0] = {script!r}
try:
    runpy.run_path(sys.argv[0], run_name="__main__")
except SystemExit as end:
    assert not end.code, end.code
print("loaded", *sorted(sys.modules.keys() & {heavy!r}))
"""


def loaded(script: str, *words: str) -> set[str]:
    """The packages that take time to load, of those that a command has loaded when it ends."""
    path = str(CHECKOUT / "experiments" / script)
    code = LOADED.format(checkout=str(CHECKOUT), script=path, words=list(words), heavy=HEAVY)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split()[1:])


@pytest.mark.parametrize(
    ("script", "words"),
    [
        *((script, ["--help"]) for script in ("run.py", "infer.py", "advise.py")),
        ("run.py", ["--version"]),
        ("results.py", ["status"]),
        ("results.py", ["list", "paper"]),
    ],
)
def test_what_answers_at_once_loads_nothing_that_takes_time(script: str, words: list[str]) -> None:
    assert loaded(script, *words) == set()


def test_a_point_that_is_done_loads_what_reads_a_config_and_nothing_that_computes(
    tmp_path: Path,
) -> None:
    words = [*TINY, f"results={tmp_path}"]
    assert {"pandas", "scipy.sparse", "scipy.special", "tqdm"} <= loaded("run.py", *words)
    late = {"pandas", "numba", "matplotlib", "scipy.sparse", "scipy.special", "tqdm"}
    assert not loaded("run.py", *words) & late


@pytest.mark.parametrize("words", [["dt=0.25"], ["dt=0.25", "hydra.mode=RUN"]])
def test_a_single_config_is_composed_once(
    words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    composed = []
    load = ConfigLoaderImpl.load_configuration
    monkeypatch.setattr(
        ConfigLoaderImpl,
        "load_configuration",
        lambda *args, **options: composed.append(args) or load(*args, **options),
    )
    monkeypatch.setattr(sys, "argv", ["run.py", *words])
    register_options()
    seen: list[float] = []
    status = run_command(
        "config", lambda tree: seen.append(tree["dt"]) or DONE, register_sweeper=register_plugins
    )
    assert (status, seen, len(composed)) == (DONE, [0.25], 1)
