#!/usr/bin/env bash
# soak.sh FOLDER: what `./slalom test --soak` tries of the Python package with an index of packages: a task of MuJoCo over the service, a
# wheel that is built as `pip install .` builds it and used beside the newest NumPy, and the forge's files against their published schemas.
# FOLDER is for virtual environments. Needs the environment of `./slalom test --part python`, which it is started with.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") folder=$1
root=$here/../../..
mkdir -p "$folder"
. "$here/../../support/python_packages.sh"
make_venv "$folder/mujoco" "$here/soak_requirements.txt"
"$folder/mujoco/bin/python3" -B "$here/mujoco_test.py"

"$folder/mujoco/bin/check-jsonschema" --builtin-schema vendor.github-workflows "$root"/.github/workflows/*.yml
"$folder/mujoco/bin/check-jsonschema" --builtin-schema vendor.github-issue-forms "$root"/.github/ISSUE_TEMPLATE/*.yml
"$folder/mujoco/bin/check-jsonschema" --builtin-schema vendor.citation-file-format "$root/CITATION.cff"

rm -rf "$folder/wheel" "$folder/wheels"
/usr/bin/python3 -m venv "$folder/wheel"
"$folder/wheel/bin/pip" wheel -q --no-deps --wheel-dir "$folder/wheels" "$root"
"$folder/wheel/bin/pip" install -q "$folder"/wheels/slalom-*.whl gymnasium pandas
cd "$folder"  # Not a checkout, and without the build of part python on the path.
env -u PYTHONPATH "$folder/wheel/bin/python3" -B "$here/package_test.py"
env -u PYTHONPATH "$folder/wheel/bin/python3" -B "$here/gymnasium_test.py"
