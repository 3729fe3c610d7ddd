"""The driver of ROS 1: scan, odom and goal_pose in, cmd_vel out."""

from __future__ import annotations

import math
import sys

import rospy
from geometry_msgs.msg import PoseStamped
from tf2_msgs.msg import TFMessage

import slalom

from . import ros1
from .bridge import DriverBridge, Refused
from .messages import add_transforms, goal_of

PARAMETERS = {
    "agent": "",  # A policy's file, or dwa, teb, eband, mppi.
    "profile": [],  # Files with the robot and its guard.
    "guard": False,  # A guard whatever the profiles say.
    "goal_x": math.nan,  # Relative to the start, m.
    "goal_y": math.nan,
    "lidar_x": math.nan,  # For a policy that observes it, m.
    "lidar_y": math.nan,
}


def make() -> ros1.Inputs:
    parameters = ros1.declare(PARAMETERS)
    if not parameters["agent"]:
        raise Refused("agent is '', expected a policy's file, or one of dwa, teb, eband, mppi")
    driver = slalom.Driver(parameters["agent"], profile=parameters["profile"], guard=True if parameters["guard"] else None)
    lidar = parameters["lidar_x"], parameters["lidar_y"]
    bridge = DriverBridge(driver, ros1.settings_of(), None if math.isnan(sum(lidar)) else lidar)
    ahead = parameters["goal_x"], parameters["goal_y"]
    if not math.isnan(sum(ahead)):
        bridge.set_goal_from_start(*ahead)
    current_goal = rospy.Publisher("current_goal", PoseStamped, queue_size=1, latch=True)
    inputs = ros1.Inputs(bridge)
    newest = []

    def on_goal(message):
        with inputs.lock:
            goal = message.header.stamp, message.header.frame_id, message.pose
            if newest != [goal]:  # A robot that waits for current_goal sends its goal again, with another `seq`.
                newest[:] = [goal]
                inputs.send(bridge.on_goal(goal_of(message), ros1.now()))
        current_goal.publish(message)

    def on_transforms(message):
        with inputs.lock:
            add_transforms(message, bridge.frames)

    rospy.Subscriber("goal_pose", PoseStamped, on_goal, queue_size=10, tcp_nodelay=True)
    for topic in "/tf", "/tf_static":
        rospy.Subscriber(topic, TFMessage, on_transforms, queue_size=100)
    return inputs


def main():
    sys.exit(ros1.run("slalom_driver", make))


if __name__ == "__main__":
    main()
