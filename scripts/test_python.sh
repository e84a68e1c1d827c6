#!/usr/bin/env bash
# Builds and tests the Python package in an environment of its own below target/. Not yet part of .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."
# Needs what not every machine has: Python 3.10 with venv, and a package index.
venv=target/ci-venv
if ! python3 -c 'import sys, venv; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
  echo "skipped: there is no Python 3.10 with venv"
elif ! { python3 -m venv "$venv" && "$venv/bin/pip" install --quiet "maturin>=1.9,<2" "numpy>=1.24" "pytest>=8" "mypy>=1.15"; }; then
  echo "skipped: pip could not install maturin, numpy, pytest and mypy"
else
  # Without isolation pip calls the `maturin` of the path.
  PATH="$PWD/$venv/bin:$PATH"
  pip install --quiet --no-build-isolation .
  python -m pytest -q crates/partpose-py/tests
  (cd "$venv" && python -m mypy.stubtest partpose._partpose)
fi
