#!/usr/bin/env bash
# with_packages.sh VENV: the tests of the Python package in a virtual environment with Gymnasium and ONNX Runtime, which are no Debian packages,
# and the comparisons of reports beside rliable.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") venv=$1
[[ -x $venv/bin/python3 ]] || /usr/bin/python3 -m venv --system-site-packages "$venv"
if ! "$venv/bin/pip" install -q --no-deps --require-hashes -r "$here/requirements.txt"; then
  echo "SKIPPED: no index of Python packages is reached here"
  exit 0
fi
for test in package page service gymnasium onnx; do
  "$venv/bin/python3" -B "$here/${test}_test.py"
done
"$venv/bin/python3" -B "$here/../../eval/comparison/rliable_test.py" "$SLALOM_PROGRAM" "$here/../../.."
