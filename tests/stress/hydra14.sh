#!/usr/bin/env bash
# The sweep's tests and the smoke study with the newest pre-release of Hydra 1.4, warnings as errors;
# `make test` and `make smoke` are with the Hydra of requirements.lock.
set -euo pipefail
cd "$(dirname "$0")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
sed -E '/^(hydra-core|omegaconf|antlr4-python3-runtime)==/,/^    # via/d' requirements.lock \
    > "$work/others.txt"
.venv/bin/uv venv --quiet --python .venv/bin/python "$work/venv"
.venv/bin/uv pip install --quiet --python "$work/venv/bin/python" --require-hashes \
    --no-deps --requirement "$work/others.txt"
.venv/bin/uv pip install --quiet --python "$work/venv/bin/python" --prerelease=allow \
    'hydra-core>=1.4.0.dev0,<1.5'
export PYTHONPATH=$PWD
"$work/venv/bin/python" -c "
from importlib.metadata import version
print('hydra14.sh: hydra-core', version('hydra-core'), 'and omegaconf', version('omegaconf'))"
# What is asked of Hydra, composing and starting, is in these. Other tests ask it for the settings of a
# point at most, which are compared here.
# Hydra 1.4 lets no composed file set the mode: there a study is run with -m, or refused in words.
PYTHONWARNINGS=error "$work/venv/bin/python" -m pytest -p no:cacheprovider \
    --deselect tests/experiments/sweep/test_planner.py::test_study_without_m_says_first_how_many_points_will_run \
    tests/experiments/config tests/experiments/sweep tests/experiments/test_infer.py
"$work/venv/bin/python" -W error experiments/run.py -m experiment=paper scale=smoke \
    results="$work/results" | tail -n 1
