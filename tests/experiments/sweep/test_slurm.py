"""The SLURM launcher, with stand-ins for the commands of SLURM; the real ones: tests/stress.

There, a sweep whose jobs were killed is resumed, and its tables are compared with a local run's.
"""

import json
import os
import sys
from pathlib import Path

import pytest
from sweeps import faulty, run_here

from experiments.sweep import slurm

SBATCH = """
import os, re, subprocess, sys
script = open(sys.argv[-1]).read()
indices = re.search(r"--array=0-(\\d+)", script)
with open(os.environ["FAKE_QUEUE"], "w") as queue:
    for i in range(0 if "DEAD_NODES" in os.environ else int(indices[1]) + 1):
        own = {"SLURM_JOB_ID": f"{8 + i}", "SLURM_ARRAY_JOB_ID": "7", "SLURM_ARRAY_TASK_ID": f"{i}",
               "SLURM_PROCID": "0", "SLURM_LOCALID": "0", "SLURM_NODEID": "0", "SLURM_NTASKS": "1",
               "SLURM_JOB_NUM_NODES": "1", "SLURM_JOB_NODELIST": "here"}
        job = subprocess.Popen(["bash", "-c", script], env={**os.environ, **own},
                               start_new_session=True, stdin=subprocess.DEVNULL,
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        print(f"7_{i}", job.pid, file=queue)
print("Submitted batch job 7")
"""
SQUEUE = """
import os, pathlib
for line in open(os.environ["FAKE_QUEUE"]):
    name, pid = line.split()
    try:
        state = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()[0]
    except OSError:
        continue
    if state not in "ZX":
        print(name)
"""
SRUN = """
import os, sys
first = next(i for i, word in enumerate(sys.argv) if i and "python" in word and word[0] == "/")
os.execv(sys.argv[first], sys.argv[first:])
"""
DEADLY = """
import os, signal
from dataclasses import dataclass
from pathlib import Path
from mlci.systems import DoubleIntegrator

@dataclass(frozen=True, eq=False)
class Deadly(DoubleIntegrator):
    deadly: bool = False

    def dynamics(self, states, controls):
        if self.deadly and len(states) > 100 and not Path("healed").exists():
            os.killpg(os.getpgid(0), signal.SIGKILL)
        return super().dynamics(states, controls)
"""
SCANCEL = "import sys\nassert sys.argv[1:] == ['7']\n"


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Commands that run jobs at once, and the options that use them."""
    for name, code in {
        "sbatch": SBATCH,
        "squeue": SQUEUE,
        "srun": SRUN,
        "scancel": SCANCEL,
    }.items():
        path = tmp_path / "bin" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(f"#!{sys.executable}\n{code}")
        path.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    monkeypatch.setenv("FAKE_QUEUE", str(tmp_path / "queue"))
    return ["hydra/launcher=slurm", "hydra.launcher.jobs=2", "hydra.launcher.poll=0.2"]


@pytest.mark.long
def test_killed_job_fails_alone(cluster: list[str], tmp_path: Path) -> None:
    (tmp_path / "deadly.py").write_text(DEADLY)
    sweep = ["-m", "system._target_=deadly.Deadly", "+system.deadly=false,true", "study=s"]
    status, out, err = run_here(tmp_path, *sweep, *cluster)
    assert status == 1, out + err
    assert "2 SLURM jobs, 7_0 to 7_1" in out
    assert "1 of 2 points failed" in err
    assert err.count("no result; its log is in") == 1
    assert len(list((tmp_path / "results" / "points").glob("*/record.json"))) == 1
    assert not list((tmp_path / "results").rglob("*.pkl"))


@pytest.mark.long
def test_job_that_dies_before_its_points_start_passes_for_nothing_earlier(
    cluster: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep = ["-m", *faulty(tmp_path), "+system.fault=none,raise", "study=s"]
    status, _, err = run_here(tmp_path, *sweep)
    assert status == 1
    assert "ArithmeticError" in err
    done, failed = (
        next((tmp_path / "results" / "points").glob(f"*/{name}.json"))
        for name in ("record", "failure")
    )
    before = done.read_bytes()
    monkeypatch.setenv("DEAD_NODES", "")
    status, out, err = run_here(tmp_path, *sweep, *cluster, "sweep.force=true")
    assert status == 1, out + err
    assert "2 of 2 points failed" in err
    assert err.count("no result; its log is in") == 2
    assert "ArithmeticError" not in err
    failure = json.loads(failed.read_bytes())
    assert (failure["attempt"], failure["reason"], failure["started"]) == (2, "died", None)
    # The old result is whole, and is kept.
    assert done.read_bytes() == before
    assert not (done.parent / "failure.json").exists()


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("sweep.fail_fast=true", "sweep.fail_fast: a cluster starts jobs by itself"),
        ("dt=0.5", "hydra/launcher: slurm needs sbatch"),
    ],
)
def test_sweep_that_no_cluster_can_run_is_refused(
    option: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    status, _, err = run_here(tmp_path, "-m", "hydra/launcher=slurm", option)
    assert status == 2
    assert message in err
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


ANSWERS = {
    "import time\ntime.sleep(60)": None,
    "import sys\nsys.exit(1)": None,
    "import sys\nsys.exit('slurm_load_jobs error: Invalid job id specified')": set(),
    "import sys\nassert '--jobs=7,8' in sys.argv, sys.argv\nprint('7_0\\n8_1')": {"7_0", "8_1"},
}


@pytest.mark.parametrize("code", ANSWERS)
def test_jobs_are_asked_for_by_their_ids(
    code: str, cluster: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever the environment says that the user is; and a queue that hangs is no answer."""
    (tmp_path / "bin" / "squeue").write_text(f"#!{sys.executable}\n{code}\n")
    monkeypatch.setenv("USER", "somebody_else")
    monkeypatch.setattr(slurm, "_ANSWER", 1.0 if "sleep" in code else 60.0)
    assert slurm._queue(["7_0", "7_1", "8_1"]) == ANSWERS[code]


@pytest.mark.parametrize("code", ["import sys\nsys.exit(1)", "import time\ntime.sleep(60)"])
def test_a_queue_that_never_answers_is_given_up(
    code: str,
    cluster: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name in ("squeue", "scancel"):
        (tmp_path / "bin" / name).write_text(f"#!{sys.executable}\n{code}\n")
    monkeypatch.setattr(slurm, "_ANSWER", 1.0 if "sleep" in code else 60.0)
    monkeypatch.setattr(slurm, "_SILENCE", 0.3)
    slurm.SlurmLauncher(1, 0.05, False, cpus_per_task=1)._wait(["7_0"])
    slurm._cancel(["7_0", "7_1"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [
        "squeue does not answer; it is asked again",
        "squeue was silent for 0.3 s; the jobs are cancelled",
    ]
    late = ["scancel does not answer; cancel by hand: scancel 7"] * ("sleep" in code)
    assert lines[2:] == late


def test_a_job_that_is_absent_for_a_moment_has_not_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has where it is absent at three looks in a row; no answer is no look."""
    looks = iter([{"7_0"}, set(), set(), {"7_0"}, set(), set(), None, set()])
    monkeypatch.setattr(slurm, "_queue", lambda ids: next(looks))
    slurm.SlurmLauncher(1, 0.0, False, cpus_per_task=1)._wait(["7_0"])
    assert list(looks) == []
