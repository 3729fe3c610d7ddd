#!/usr/bin/env bash
# with_ros2.sh VENV: the tests of the nodes with ROS 2 Jazzy in a virtual environment, in a network of their own if the user may make one.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") venv=$1
. "$here/../support/python_packages.sh"
make_venv "$venv" "$here/requirements.txt"
# Shared memory is no part of a network: what a killed process left there would be in the way of others.
export FASTDDS_BUILTIN_TRANSPORTS=UDPv4 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$venv/log PYTHONWARNINGS=ignore::DeprecationWarning
run=("$venv/bin/python3" -B "$here/ros2_test.py")
if unshare --net true 2>/dev/null; then
  exec unshare --net bash -c 'ip link set lo up && exec "$@"' bash "${run[@]}"
elif unshare --user --map-root-user --net true 2>/dev/null; then
  exec unshare --user --map-root-user --net bash -c 'ip link set lo up && exec "$@"' bash "${run[@]}"
fi
exec "${run[@]}"
