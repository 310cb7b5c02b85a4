#!/usr/bin/env bash
# The tests that take many seconds each: whole processes, clusters, and the slowest oracles.
set -euo pipefail
cd "$(dirname "$0")/../.."
.venv/bin/python -m pytest -m long
