"""The guard alone: cmd_vel_raw of another stack, scan and odom in, cmd_vel out."""

from __future__ import annotations

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node

import slalom

from . import ros2
from .bridge import GuardBridge
from .messages import velocity_of


class Guard(Node):
    def __init__(self):
        super().__init__("slalom_guard")
        parameters = ros2.declare(self, {"profile": [], "stamped": False})
        self._bridge = GuardBridge(slalom.Guard(profile=parameters["profile"]), ros2.settings_of(self))
        self._inputs = ros2.Inputs(self, self._bridge)
        self.create_subscription(TwistStamped if parameters["stamped"] else Twist, "cmd_vel_raw", self._on_command, ros2.RELIABLE)

    def _on_command(self, message):
        self._inputs.send(self._bridge.on_command(*velocity_of(message), ros2.now_of(self)))

    def stop(self):
        """The node ends."""
        self._inputs.stop()


def main():
    ros2.run(Guard)


if __name__ == "__main__":
    main()
