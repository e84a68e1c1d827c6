#!/usr/bin/env bash
# Tests the Python package in an environment of its own below target/: pytest, and the stubs against the module.
#
#   scripts/test_python.sh          the library as the tests' profile makes it, which shares what .ci/run has compiled
#   scripts/test_python.sh --features LIST
#                                   the same where the tests had these features
#   scripts/test_python.sh --pip    installed by `pip install .`, which builds all of it once more; and the examples for
#                                   Rerun, Daft and Ray (0.6 GB of packages)
set -euo pipefail
cd "$(dirname "$0")/.."
root=$PWD
venv=$root/target/python-venv
packages=("numpy>=1.24" "pytest>=8" "mypy>=1.15")

if ! python3 -c 'import sys, venv; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
  echo "skipped: there is no Python 3.10 with venv"
  exit 0
fi
if ! { python3 -m venv "$venv" && "$venv/bin/python" -m pip install --quiet "${packages[@]}"; }; then
  echo "skipped: pip could not install ${packages[*]}"
  exit 0
fi
if [ "${1:-}" = --pip ]; then
  "$venv/bin/python" -m pip install --verbose ".[rerun,daft]"
else
  # With a test among the targets, features are those of the tests.
  cargo build --workspace --lib --test layers "$@"
  # The package's files beside the library, as the wheel has them.
  stage=$root/target/python
  rm -rf "$stage" && mkdir -p "$stage"
  cp -r crates/partpose-py/python/partpose "$stage/partpose"
  cp target/debug/lib_partpose.so "$stage/partpose/_partpose.abi3.so"
  export PYTHONPATH=$stage
fi
"$venv/bin/python" -m pytest -q crates/partpose-py/tests examples/daft
cd "$venv" && "$venv/bin/python" -m mypy.stubtest partpose._partpose
