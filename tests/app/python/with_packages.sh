#!/usr/bin/env bash
# with_packages.sh VENV: the tests of the Python package in a virtual environment with Gymnasium and ONNX Runtime, which are no Debian packages,
# and the comparisons of reports beside rliable.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") venv=$1
. "$here/../../support/python_packages.sh"
make_venv "$venv" "$here/requirements.txt"
for test in package page service gymnasium onnx; do
  "$venv/bin/python3" -B "$here/${test}_test.py"
done
"$venv/bin/python3" -B "$here/../../eval/comparison/rliable_test.py" "$SLALOM_PROGRAM" "$here/../../.."
