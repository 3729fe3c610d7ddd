#!/usr/bin/env bash
# with_ros1.sh SCRATCH: the tests of the nodes with Debian's ROS 1 and a master of their own, in a network of their own if the user may make one.
set -euo pipefail
here=$(dirname "$(readlink -f "$0")") scratch=$1
if ! /usr/bin/python3 -c 'import rospy, rosmaster, tf2_msgs' 2>/dev/null; then
  echo "SKIPPED: ROS 1 is not installed (python3-rospy and others)"
  exit 0
fi
export ROS_MASTER_URI=http://127.0.0.1:11399 ROS_IP=127.0.0.1 ROS_HOME=$scratch ROS_LOG_DIR=$scratch/log
mkdir -p "$scratch/log"
run='rosmaster --core -p 11399 >"$ROS_HOME/master.log" 2>&1 & trap "kill $!" EXIT
until /usr/bin/python3 -c "import rosgraph; rosgraph.Master(\"/test\").setParam(\"/use_sim_time\", True)" 2>/dev/null; do kill -0 $!; done
/usr/bin/python3 -B "$1/ros1_test.py"'
if unshare --net true 2>/dev/null; then
  unshare --net bash -c "ip link set lo up; $run" bash "$here"
elif unshare --user --map-root-user --net true 2>/dev/null; then
  unshare --user --map-root-user --net bash -c "ip link set lo up; $run" bash "$here"
else
  bash -c "$run" bash "$here"
fi
