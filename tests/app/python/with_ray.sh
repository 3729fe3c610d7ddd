#!/usr/bin/env bash
# with_ray.sh VENV: the test of slalom.ray in a virtual environment with Ray.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") venv=$1
. "$here/../../support/python_packages.sh"
make_venv "$venv" "$here/ray_requirements.txt"
RAY_USAGE_STATS_ENABLED=0 exec "$venv/bin/python3" -B "$here/ray_test.py"
