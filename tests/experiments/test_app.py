"""Commands as a shell starts them: stopped while their modules are imported."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from sweeps import gone

from experiments.app import FAILED, run_command
from experiments.config.paths import CHECKOUT

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
    out, err = process.communicate(timeout=20)
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
