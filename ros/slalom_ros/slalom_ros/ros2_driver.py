"""The driver: scan, odom and goal_pose in, cmd_vel out. A lifecycle node, which starts itself unless autostart is false."""

from __future__ import annotations

import math
import sys

from geometry_msgs.msg import Point, PoseStamped
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from visualization_msgs.msg import Marker, MarkerArray

import slalom

from . import ros2
from .bridge import DriverBridge, Refused
from .messages import add_transforms, fill_pose, goal_of

PARAMETERS = {
    "agent": "",  # A policy's file, or dwa, teb, eband, mppi.
    "profile": [],  # Files with the robot and its guard.
    "guard": False,  # A guard whatever the profiles say.
    "goal_x": math.nan,  # Relative to the start, m.
    "goal_y": math.nan,
    "lidar_x": math.nan,  # For a policy that observes it, m.
    "lidar_y": math.nan,
    "autostart": True,
}


class Driver(LifecycleNode):
    def __init__(self):
        super().__init__("slalom_driver")
        self._inputs = self._bridge = None
        self._made, self._goal = [], None
        if ros2.declare(self, {"autostart": True})["autostart"]:
            if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                raise Refused(self._fault)
            self.trigger_activate()

    def on_configure(self, state):
        parameters = ros2.declare(self, PARAMETERS)
        try:
            if not parameters["agent"]:
                raise Refused("agent is '', expected a policy's file, or one of dwa, teb, eband, mppi")
            driver = slalom.Driver(parameters["agent"], profile=parameters["profile"], guard=True if parameters["guard"] else None)
            lidar = parameters["lidar_x"], parameters["lidar_y"]
            self._bridge = DriverBridge(driver, ros2.settings_of(self), None if math.isnan(sum(lidar)) else lidar)
        except ValueError as error:
            self._fault = str(error)
            self.get_logger().error(self._fault)
            return TransitionCallbackReturn.FAILURE
        ahead = parameters["goal_x"], parameters["goal_y"]
        if not math.isnan(sum(ahead)):
            self._bridge.set_goal_from_start(*ahead)
        # Who sees cmd_vel sees current_goal, which comes first.
        self._current_goal = self.create_publisher(PoseStamped, "current_goal", ros2.LATCHED)
        self._inputs = ros2.Inputs(self, self._bridge)
        self._inputs.is_active = False
        self._inputs.on_sent = self._show
        self._markers = self.create_publisher(MarkerArray, "~/markers", ros2.RELIABLE)
        self._made = [self.create_subscription(PoseStamped, "goal_pose", self._on_goal, ros2.RELIABLE)]
        if ros2.TFMessage:
            frames = self._bridge.frames
            self._made += [self.create_subscription(ros2.TFMessage, topic, lambda message: add_transforms(message, frames), qos)
                           for topic, qos in (("/tf", ros2.RELIABLE), ("/tf_static", ros2.LATCHED))]
        return super().on_configure(state)

    def on_activate(self, state):
        self._inputs.is_active = True
        return super().on_activate(state)

    def on_deactivate(self, state):
        self._inputs.stop()
        self._inputs.is_active = False
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        self._inputs.destroy()
        for each in self._made:
            self.destroy_subscription(each)
        for each in self._current_goal, self._markers:
            self.destroy_publisher(each)
        self._inputs = self._bridge = self._goal = None
        return super().on_cleanup(state)

    def stop(self):
        """The node ends."""
        if self._inputs:
            self._inputs.stop()

    def _on_goal(self, message):
        if not self._inputs.is_active:
            return
        if message != self._goal:  # A robot that waits for current_goal sends its goal again.
            self._goal = message
            self._inputs.send(self._bridge.on_goal(goal_of(message), ros2.now_of(self)))
        self._current_goal.publish(message)

    def _show(self, output):
        if not self._markers.get_subscription_count() or self._bridge.goal_R is None:
            return
        line, command = Marker(type=Marker.LINE_STRIP, id=0), Marker(type=Marker.ARROW, id=1)
        for marker in line, command:
            marker.header.frame_id = self.get_parameter("robot_frame").value
            marker.header.stamp = self.get_clock().now().to_msg()
            marker.ns = "slalom"
            marker.color.a, marker.color.g = 1.0, 1.0
            marker.lifetime.sec = 1
            fill_pose(marker.pose, 0.0, 0.0)
        line.scale.x = 0.03
        goal_x, goal_y = self._bridge.goal_R
        line.points = [Point(), Point(x=goal_x, y=goal_y)]
        command.scale.x, command.scale.y = 0.05, 0.1
        command.points = [Point(), Point(x=output.linear * math.cos(output.angular / 2), y=output.linear * math.sin(output.angular / 2))]
        if output.guarded:
            command.color.r, command.color.g = 1.0, 0.0
        self._markers.publish(MarkerArray(markers=[line, command]))


def main():
    sys.exit(ros2.run(Driver))


if __name__ == "__main__":
    main()
