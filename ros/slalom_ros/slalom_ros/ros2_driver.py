"""The driver: scan, odom and goal_pose in, cmd_vel out. A lifecycle node, which starts itself unless autostart is false."""

from __future__ import annotations

import math

from geometry_msgs.msg import Point, PoseStamped
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from visualization_msgs.msg import Marker, MarkerArray

from . import ros2
from .bridge import Refused
from .messages import add_transforms, fill_pose, goal_of, seconds
from .nodes import DRIVER_PARAMETERS, driver_bridge

PARAMETERS = {**DRIVER_PARAMETERS, "autostart": True}


class Driver(LifecycleNode):
    def __init__(self):
        super().__init__("slalom_driver")
        self._inputs = self._bridge = None
        self._made, self._goal, self._fault = [], None, "the driver could not be configured"
        if ros2.declare(self, {"autostart": True})["autostart"]:
            if self.trigger_configure() != TransitionCallbackReturn.SUCCESS:
                raise Refused(self._fault)
            self.trigger_activate()

    def on_configure(self, state):
        try:
            self._configure()
        except ValueError as error:  # Bad input, of this package or of slalom.
            self._fault = str(error)
            self.get_logger().error(self._fault)
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def _configure(self):
        self._bridge = driver_bridge(ros2.declare(self, PARAMETERS), ros2.settings_of(self))
        # Who sees cmd_vel sees current_goal, which comes first.
        self._current_goal = self.create_publisher(PoseStamped, "current_goal", ros2.LATCHED)
        self._inputs = ros2.Inputs(self, self._bridge)
        self._inputs.is_active = False
        self._inputs.on_sent = self._on_sent
        self._markers = self.create_publisher(MarkerArray, "~/markers", ros2.RELIABLE)
        self._made = [self.create_subscription(PoseStamped, "goal_pose", self._on_goal, ros2.RELIABLE)]
        if ros2.TFMessage:
            frames = self._bridge.frames
            self._made += [self.create_subscription(ros2.TFMessage, topic, lambda message: add_transforms(message, frames), qos)
                           for topic, qos in (("/tf", ros2.RELIABLE), ("/tf_static", ros2.LATCHED))]

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
            since = {"since": seconds(message.header.stamp)} if self.get_parameter("use_sim_time").value else {}
            self._inputs.send(self._bridge.on_goal(goal_of(message), ros2.now_of(self), **since))
        self._current_goal.publish(message)

    def _on_sent(self, output):
        if self._bridge.goal is None:  # It has arrived, or given up: an empty goal says so.
            self._goal = None
            self._current_goal.publish(PoseStamped())
        self._show(output)

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
    ros2.run(Driver)


if __name__ == "__main__":
    main()
