"""The guard alone, in ROS 1: cmd_vel_raw of another stack, scan and odom in, cmd_vel out."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import Twist, TwistStamped

import slalom

from . import ros1
from .bridge import GuardBridge
from .messages import velocity_of


def make() -> ros1.Inputs:
    parameters = ros1.declare({"profile": [], "stamped": False})
    bridge = GuardBridge(slalom.Guard(profile=parameters["profile"]), ros1.settings_of())
    inputs = ros1.Inputs(bridge)

    def on_command(message):
        with inputs.lock:
            inputs.send(bridge.on_command(*velocity_of(message), ros1.now()))

    rospy.Subscriber("cmd_vel_raw", TwistStamped if parameters["stamped"] else Twist, on_command, queue_size=1, tcp_nodelay=True)
    return inputs


def main():
    ros1.run("slalom_guard", make)


if __name__ == "__main__":
    main()
