"""What `make` shows of work that takes long."""

import os
import signal
import subprocess
from pathlib import Path
from threading import Timer

ROOT = Path(__file__).parents[1]

# A study that says something, and goes on once somebody opens the pipe.
STUDY = """
include {root}/Makefile
try-%:
\t@bash -o pipefail -c '(echo "[1/2]  a\\b"; cat {gate}; printf "[2/2]"; exit 3) 2>&1 | $(SAY)'
"""


def test_lines_of_a_study_come_at_once_with_its_name_and_its_status_at_the_end(
    tmp_path: Path,
) -> None:
    gate, makefile = tmp_path / "gate", tmp_path / "Makefile"
    os.mkfifo(gate)
    makefile.write_text(STUDY.format(root=ROOT, gate=gate))
    command = ["make", "--silent", "--no-print-directory", f"--file={makefile}", "try-paper"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        late = Timer(60, os.killpg, (process.pid, signal.SIGKILL))
        late.start()
        assert process.stdout.readline() == b"paper: [1/2]  a\\b\n"
        gate.write_text("")
        rest, complaint = process.stdout.read(), process.stderr.read()
        late.cancel()
    assert rest == b"paper: [2/2]\n"
    assert process.returncode != 0
    assert b"Error 3" in complaint
