"""The driver of ROS 1: scan, odom and goal_pose in, cmd_vel out."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import PoseStamped
from tf2_msgs.msg import TFMessage

from . import ros1
from .messages import add_transforms, goal_of
from .nodes import DRIVER_PARAMETERS, driver_bridge


def make() -> ros1.Inputs:
    bridge = driver_bridge(ros1.declare(DRIVER_PARAMETERS), ros1.settings_of())
    current_goal = rospy.Publisher("current_goal", PoseStamped, queue_size=1, latch=True)
    inputs = ros1.Inputs(bridge)
    newest = []

    def on_goal(message):
        since = ros1.wait_for_clock(message.header.stamp.to_sec())
        with inputs.lock:
            goal = message.header.stamp, message.header.frame_id, message.pose
            if newest != [goal]:  # A robot that waits for current_goal sends its goal again, with another `seq`.
                newest[:] = [goal]
                inputs.send(bridge.on_goal(goal_of(message), ros1.now(), since))
        current_goal.publish(message)

    def on_sent():
        if bridge.goal is None:  # It has arrived, or given up: an empty goal says so.
            newest.clear()
            current_goal.publish(PoseStamped())

    inputs.on_sent = on_sent

    def on_transforms(message):
        with inputs.lock:
            add_transforms(message, bridge.frames)

    rospy.Subscriber("goal_pose", PoseStamped, on_goal, queue_size=10, tcp_nodelay=True)
    for topic in "/tf", "/tf_static":
        rospy.Subscriber(topic, TFMessage, on_transforms, queue_size=100)
    return inputs


def main():
    ros1.run("slalom_driver", make)


if __name__ == "__main__":
    main()
