#!/usr/bin/env bash
# with_ros1.sh SCRATCH: the tests of the nodes with Debian's ROS 1.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") scratch=$1
if ! /usr/bin/python3 -c 'import rospy, rosmaster, tf2_msgs' 2>/dev/null; then
  echo "SKIPPED: ROS 1 is not installed (python3-rospy and others)"
  exit 0
fi
. "$here/../support/own_network.sh"
export ROS_MASTER_URI=http://127.0.0.1:11399 ROS_IP=127.0.0.1 ROS_HOME=$scratch ROS_LOG_DIR=$scratch/log
mkdir -p "$scratch/log"
in_own_network /usr/bin/python3 -B "$here/ros1_test.py"
