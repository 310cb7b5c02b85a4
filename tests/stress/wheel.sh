#!/usr/bin/env bash
# A wheel, installed in an environment of its own, runs and draws the smoke study in an empty folder.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
python=${PYTHON:-$root/.venv/bin/python}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Built from a copy: an old build folder in the checkout would lend the wheel its files.
mkdir "$work/source" "$work/empty"
cd "$root"
cp -r mlci experiments paper_figures conf pyproject.toml README.md LICENSE "$work/source"
"$python" -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$work" "$work/source"

"$python" -m venv "$work/venv"
sed -nE 's/^([a-zA-Z0-9_.-]+==[^\\]*).*/\1/p' requirements.lock > "$work/constraints.txt"
"$work/venv/bin/pip" install --quiet --constraint "$work/constraints.txt" "$work"/mlci-*.whl
for extra in excel parquet; do # as README.md says, from a folder with the source
    (cd "$work/source" && "$work/venv/bin/pip" install --quiet --constraint "$work/constraints.txt" ".[$extra]")
done

cd "$work/empty"
export PATH="$work/venv/bin:$PATH"
unset PYTHONPATH
git init --quiet . # its commits are not those of the code
mlci-run --help > "$work/help"
grep -q mlci-run "$work/help"
[[ $(mlci-infer --version) == "mlci "* ]]
mlci-run -m experiment=paper scale=smoke
mlci-figures smoke
mlci-report
mlci-results status smoke | tee "$work/status"
mlci-results clean

if grep 'not up to date' "$work/status"; then exit 1; fi
[ "$(ls)" = results ]
for table in trials ranks summary; do [ -s "results/smoke/tables/$table.csv" ]; done
[ -s results/smoke/figures/rank_curve.pdf ]
[ -s results/paper/REPORT.html ]
point=$(basename "$(find results/points -mindepth 1 -maxdepth 1 | head -n 1)")
mlci-results page "$point" --out "$work/point.html"
mlci-results demonstrations "$point" --out "$work/recorded"
mlci-infer demonstrations="$work/recorded" inference.calibrate=false
for page in "$work/point.html" results/inference/*/page.html; do grep -q '<svg viewBox' "$page"; done
python - results/points/*/record.json <<'EOF'
import json, sys
import experiments

assert "site-packages" in experiments.__file__, experiments.__file__
records = [json.load(open(path)) for path in sys.argv[1:]]
assert records and all(record["git"]["commit"] is None for record in records)
assert all(record["blas_threads"] == "1" for record in records)
EOF
echo "the wheel works: $(ls results/points | wc -l) points"
