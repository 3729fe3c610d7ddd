#!/usr/bin/env bash
# with_ros2.sh VENV: the tests of the nodes with ROS 2 Jazzy in a virtual environment.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") venv=$1
. "$here/../support/python_packages.sh"
. "$here/../support/own_network.sh"
make_venv "$venv" "$here/requirements.txt"
# Shared memory is no part of a network: what a killed process left there would be in the way of others.
export FASTDDS_BUILTIN_TRANSPORTS=UDPv4 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_LOG_DIR=$venv/log PYTHONWARNINGS=ignore::DeprecationWarning
in_own_network "$venv/bin/python3" -B "$here/ros2_test.py"
