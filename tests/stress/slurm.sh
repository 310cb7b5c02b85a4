#!/usr/bin/env bash
# A sweep through SLURM: a one-node cluster on this machine, of which two jobs are killed, resumed,
# and compared byte for byte with a run without SLURM. Needs root and Debian's packages.
set -euo pipefail
cd "$(dirname "$0")/../.."
PYTHON=$PWD/.venv/bin/python

skip() { echo "slurm.sh: NOT RUN: $1"; exit 0; }
if ! command -v slurmctld munged > /dev/null; then
    [ "$(id -u)" = 0 ] || skip "installing slurm-wlm and munge needs root"
    command -v apt-get > /dev/null || skip "no apt-get to install slurm-wlm and munge with"
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y \
        --no-install-recommends slurm-wlm munge; } > /dev/null 2>&1 || skip "apt-get failed"
fi
[ "$(id -u)" = 0 ] || skip "the daemons need root"
"$PYTHON" -c 'import submitit' 2> /dev/null || skip "submitit is missing: pip install '.[slurm]'"

work=$(mktemp -d)
stop() {
    status=$?
    [ "$status" = 0 ] || tail -n 30 "$work"/*.log "$work"/results/.jobs/*/*.err 2> /dev/null || true
    scancel --user="$(id -un)" 2> /dev/null || true
    for daemon in slurmd slurmctld munged; do
        [ -s "$work/$daemon.pid" ] && kill "$(cat "$work/$daemon.pid")" 2> /dev/null
    done
    sleep 1
    rm -rf "$work"
    exit "$status"
}
trap stop EXIT

# --- the cluster: no accounting, as on the machine where a killed job is hardest to notice
chmod 755 "$work"
dd if=/dev/urandom of="$work/key" bs=1024 count=1 status=none
chmod 600 "$work/key"
munged --force --key-file="$work/key" --socket="$work/munge.socket" --pid-file="$work/munged.pid" \
    --log-file="$work/munged.log" --seed-file="$work/munge.seed" 2> /dev/null
export SLURM_CONF=$work/slurm.conf
cat > "$SLURM_CONF" << END
ClusterName=local
SlurmctldHost=$(hostname -s)(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket
CredType=cred/munge
SlurmctldPort=16817
SlurmdPort=16818
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
KillWait=1
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$(nproc) State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
END
mkdir "$work/state" "$work/spool"
slurmctld
slurmd
for _ in $(seq 60); do sinfo --noheader 2> /dev/null | grep -q idle && break; sleep 0.5; done
sinfo --noheader | grep -q idle || { echo "slurm.sh: the cluster does not start"; exit 1; }
sbatch --version

. tests/stress/held_sweep.bash
jobs_in() { squeue --noheader --array --states="$1" --format=%i; }

sweep "$work/local" > "$work/local.log"
echo "local run: $(grep -c . "$work/local/s/tables/summary.csv") rows of summary"

slurm=(hydra/launcher=slurm hydra.launcher.jobs=4 hydra.launcher.array_parallelism=2
    hydra.launcher.poll=1 hydra.launcher.timeout_min=10)
touch "$HOLD"
sweep "$work/results" "${slurm[@]}" > "$work/first.log" 2>&1 &
first=$!
for _ in $(seq 480); do
    [ "$(find "$work/results/points" -name attempt.json 2> /dev/null | wc -l)" -ge 2 ] && break
    sleep 0.5
done
mapfile -t running < <(jobs_in RUNNING)
[ "${#running[@]}" = 2 ] || { echo "slurm.sh: ${#running[@]} jobs run, not 2"; exit 1; }
scancel "${running[0]}"
id=$(scontrol show job "${running[1]}" | sed -n 's/^JobId=\([0-9]*\).*/\1/p')
# shellcheck disable=SC2046
kill -9 $(scontrol listpids "$id" | awk 'NR > 1 && $1 > 1 { print $1 }')
echo "killed ${running[0]} with scancel and ${running[1]} with kill -9"
for _ in $(seq 60); do
    jobs_in RUNNING,COMPLETING | grep -qxF -e "${running[0]}" -e "${running[1]}" || break
    sleep 0.5
done
rm "$HOLD"
status=0
wait "$first" || status=$?
tail -n 12 "$work/first.log"
[ "$status" = 1 ] || { echo "slurm.sh: exit status $status, not 1, after two jobs were killed"; exit 1; }
done_first=$(find "$work/results/points" -name record.json | wc -l)
[ "$done_first" = 4 ] || { echo "slurm.sh: $done_first points done, not the 4 of the others"; exit 1; }

sweep "$work/results" "${slurm[@]}" > "$work/second.log" 2>&1
grep "points:" "$work/second.log"
diff -r "$work/local/s/tables" "$work/results/s/tables"
[ -z "$(find "$work/results" -name '*.pkl')" ]
echo "slurm.sh: tables after two killed jobs and a resume equal those of the local run byte for byte"
