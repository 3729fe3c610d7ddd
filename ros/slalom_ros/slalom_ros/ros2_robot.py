"""The simulator as a robot: cmd_vel in; scan, odom, tf, clock and collision out. Drives the episodes of an evaluation."""

from __future__ import annotations

import threading

import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String

from . import ros2
from .bridge import Pose
from .messages import fill_odometry, fill_pose, fill_scan, fill_transform
from .nodes import RobotInputs, drive_episodes, leave
from .simulated_robot import PARAMETERS


class Robot(Node):
    """The port of a `SimulatedRobot`: called from the thread of the evaluation, while another one spins."""

    def __init__(self):
        super().__init__("slalom_robot")
        self.parameters = ros2.declare(self, PARAMETERS)
        p = self.parameters
        self.inputs = RobotInputs(p, self.get_logger().error)
        self._commands = self.inputs.commands
        self._scans = self.create_publisher(LaserScan, "scan", ros2.SENSOR)
        self._odometries = self.create_publisher(OdometryMessage, "odom", ros2.RELIABLE)
        self._clock = self.create_publisher(Clock, "/clock", ros2.SENSOR)
        self._goals = self.create_publisher(PoseStamped, "goal_pose", ros2.RELIABLE)
        self._collisions = self.create_publisher(Bool, "collision", ros2.RELIABLE)
        self._statuses = self.create_publisher(String, "~/status", ros2.LATCHED)
        self._tf = self._tf_static = None
        if ros2.TFMessage:
            self._tf = self.create_publisher(ros2.TFMessage, "/tf", ros2.RELIABLE)
            self._tf_static = self.create_publisher(ros2.TFMessage, "/tf_static", ros2.LATCHED)
        self.create_subscription(TwistStamped if p["stamped"] else Twist, "cmd_vel", self.inputs.on_command, ros2.RELIABLE)
        self.create_subscription(PoseStamped, "current_goal", self.inputs.on_current_goal, ros2.LATCHED)

    def ready(self, robot):
        """The evaluation is about to begin."""
        self._robot, self.inputs.course_names = robot, robot.course_names
        self.create_subscription(String, "reset", self.inputs.on_reset, ros2.RELIABLE)
        self._clock.publish(Clock(clock=ros2.stamp_of(robot.first_stamp)))
        if self._tf_static:
            lidar = Pose(robot.lidar["offset_x"], robot.lidar["offset_y"], 0.0)
            self._tf_static.publish(ros2.TFMessage(transforms=[fill_transform(TransformStamped(), "base_link", "laser", lidar)]))
        self._commands.wait_for("node that reads scan and sends cmd_vel",
                                lambda: self._scans.get_subscription_count() and self.count_publishers("cmd_vel"))

    def _stamped(self, message, stamp, frame):
        message.header.stamp, message.header.frame_id = ros2.stamp_of(stamp), frame
        return message

    def _tell(self, status):
        self._statuses.publish(String(data=self.inputs.status_text(status)))

    def begin(self, stamp, goal, status):
        self._tell(status)
        self._clock.publish(Clock(clock=ros2.stamp_of(stamp)))
        self._goal = message = self._stamped(PoseStamped(), stamp, "odom")
        fill_pose(message.pose, *goal)
        self._commands.begin(stamp, lambda: self._goals.publish(message), self.count_publishers("current_goal") > 0)

    def ask(self, sensed, step):
        self._commands.expect(sensed.stamp)
        odometry = self._stamped(fill_odometry(OdometryMessage(), sensed.odometry), sensed.stamp, "odom")
        lidar = self._robot.lidar
        scan = fill_scan(LaserScan(), sensed.ranges, lidar["field_of_view"], lidar["min_range"], self._robot.range_max)
        self._stamped(scan, sensed.stamp, "laser")

        def publish():
            if self._goal:  # In the first step of an episode: who was not connected yet has missed it.
                self._goals.publish(self._goal)
            self._clock.publish(Clock(clock=ros2.stamp_of(sensed.stamp)))
            self._odometries.publish(odometry)
            if self._tf:
                transform = fill_transform(TransformStamped(), "odom", "base_link", sensed.odometry.pose)
                self._tf.publish(ros2.TFMessage(transforms=[self._stamped(transform, sensed.stamp, "odom")]))
            self._scans.publish(scan)

        command = self._commands.take(sensed.stamp, step, publish)
        self._goal = None
        return command

    def end(self, collided, status):
        self._collisions.publish(Bool(data=collided))
        self._tell(status)


def main():
    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    thread = threading.Thread(target=executor.spin, daemon=True)

    def make_robot():
        robot = Robot()
        executor.add_node(robot)
        thread.start()
        return robot

    def shut_down():
        nodes = list(executor.get_nodes())
        executor.shutdown()
        for node in nodes:
            thread.join()
            node.destroy_node()
        rclpy.try_shutdown()

    leave(drive_episodes(make_robot), shut_down)


if __name__ == "__main__":
    main()
