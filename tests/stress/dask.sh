#!/usr/bin/env bash
# A sweep through a Dask scheduler and two workers on this machine, one of which is killed, resumed,
# and compared byte for byte with a run without Dask; and one through a cluster in its own process.
set -euo pipefail
cd "$(dirname "$0")/../.."
PYTHON=$PWD/.venv/bin/python
"$PYTHON" -c 'import distributed' 2> /dev/null || {
    echo "dask.sh: NOT RUN: distributed is missing: pip install '.[dask]'"
    exit 0
}

work=$(mktemp -d)
pids=()
stop() {
    status=$?
    [ "$status" = 0 ] || tail -n 30 "$work"/*.log "$work"/results/.jobs/*/*.log 2> /dev/null || true
    # A worker that is asked to end waits for its scheduler.
    for pid in "${pids[@]}"; do kill -9 "$pid" 2> /dev/null || true; done
    rm -rf "$work"
    exit "$status"
}
trap stop EXIT

# --- the cluster: a job whose worker dies is lost at once, which is hardest to resume
address=tcp://127.0.0.1:18786
export DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES=0
. tests/stress/held_sweep.bash
"$PYTHON" -m distributed.cli.dask_scheduler --host 127.0.0.1 --port 18786 --no-dashboard \
    > "$work/scheduler.log" 2>&1 &
pids+=($!)
worker() {
    "$PYTHON" -m distributed.cli.dask_worker "$address" --nthreads 1 --no-nanny --no-dashboard \
        --local-directory "$work" > "$work/worker$1.log" 2>&1 &
    pids+=($!)
}
worker 1
worker 2

attempts() { find "$work/results/points" -name attempt.json 2> /dev/null | wc -l; }

sweep "$work/local" > "$work/local.log"
echo "local run: $(grep -c . "$work/local/s/tables/summary.csv") rows of summary"

dask=(hydra/launcher=dask hydra.launcher.jobs=4 hydra.launcher.scheduler=$address)
touch "$HOLD"
sweep "$work/results" "${dask[@]}" > "$work/first.log" 2>&1 &
first=$!
for _ in $(seq 480); do
    [ "$(attempts)" -ge 2 ] && break
    sleep 0.5
done
[ "$(attempts)" = 2 ] || { echo "dask.sh: $(attempts) points run, not 2"; exit 1; }
kill -9 "${pids[1]}"
echo "killed a worker with kill -9"
sleep 3
rm "$HOLD"
status=0
wait "$first" || status=$?
tail -n 8 "$work/first.log"
[ "$status" = 1 ] || { echo "dask.sh: exit status $status, not 1, after a worker was killed"; exit 1; }
done_first=$(find "$work/results/points" -name record.json | wc -l)
# What had been dealt to the killed worker is lost, be it one job or two.
case $done_first in 4 | 6) ;; *) echo "dask.sh: $done_first of 8 points done, not 4 or 6"; exit 1 ;; esac

sweep "$work/results" "${dask[@]}" > "$work/second.log" 2>&1
grep "points:" "$work/second.log"
diff -r "$work/local/s/tables" "$work/results/s/tables"

sweep "$work/inside" hydra/launcher=dask hydra.launcher.jobs=2 > "$work/inside.log" 2>&1
grep "2 Dask jobs" "$work/inside.log"
diff -r "$work/local/s/tables" "$work/inside/s/tables"

# --- stopped: the workers live on, and what they ran for it does not
touch "$HOLD"
setsid "$PYTHON" -c 'import signal, sys, os
signal.signal(signal.SIGINT, signal.SIG_DFL)
os.execv(sys.argv[1], sys.argv[1:])' "$PYTHON" experiments/run.py -m scale=smoke truth=wall \
    system._target_=held.Held grid.shape=[8,8] study=stopped results="$work/stopped" "${dask[@]}" \
    > "$work/stopped.log" 2>&1 &
stopped=$!
for _ in $(seq 480); do
    [ -n "$(find "$work/stopped/points" -name attempt.json 2> /dev/null)" ] && break
    sleep 0.5
done
kill -INT "$stopped"
status=0
wait "$stopped" || status=$?
[ "$status" = 130 ] || { echo "dask.sh: exit status $status, not 130, after Ctrl-C"; exit 1; }
sleep 2
if pgrep -P "${pids[2]}" > /dev/null; then
    echo "dask.sh: a job runs on after Ctrl-C"
    exit 1
fi
rm "$HOLD"
echo "dask.sh: tables after a killed worker and a resume equal those of the local run byte for byte"
