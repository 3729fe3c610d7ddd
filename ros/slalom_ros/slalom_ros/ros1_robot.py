"""The simulator as a robot of ROS 1: cmd_vel in; scan, odom, tf, clock and collision out. Drives the episodes of an evaluation.

The nodes around it need the parameter /use_sim_time, which it sets."""

from __future__ import annotations

import rospy
from geometry_msgs.msg import PoseStamped, TransformStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, String
from tf2_msgs.msg import TFMessage

from . import ros1
from .bridge import Pose
from .messages import fill_odometry, fill_pose, fill_scan, fill_transform
from .nodes import RobotInputs, drive_episodes, leave
from .simulated_robot import PARAMETERS


class Robot:
    """The port of a `SimulatedRobot`: called from the main thread, while rospy's threads receive."""

    def __init__(self):
        self.parameters = p = ros1.declare(PARAMETERS)
        self.inputs = RobotInputs(p, rospy.logerr)
        self._commands = self.inputs.commands

        def publisher(topic, kind, **more):
            return rospy.Publisher(topic, kind, queue_size=10, tcp_nodelay=True, **more)

        self._scans, self._odometries = publisher("scan", LaserScan), publisher("odom", OdometryMessage)
        self._clock, self._goals = publisher("/clock", Clock), publisher("goal_pose", PoseStamped)
        self._collisions, self._statuses = publisher("collision", Bool), publisher("~status", String, latch=True)
        self._tf, self._tf_static = publisher("/tf", TFMessage), publisher("/tf_static", TFMessage, latch=True)
        self._cmd_vel = rospy.Subscriber("cmd_vel", TwistStamped if p["stamped"] else Twist, self.inputs.on_command, tcp_nodelay=True)
        self._current_goal = rospy.Subscriber("current_goal", PoseStamped, self.inputs.on_current_goal, tcp_nodelay=True)

    def ready(self, robot):
        """The evaluation is about to begin."""
        self._robot, self.inputs.course_names = robot, robot.course_names
        rospy.Subscriber("reset", String, self.inputs.on_reset)
        lidar = Pose(robot.lidar["offset_x"], robot.lidar["offset_y"], 0.0)
        self._tf_static.publish(TFMessage([fill_transform(TransformStamped(), "base_link", "laser", lidar)]))
        def readers(publisher):
            return {connection.endpoint_id for connection in publisher.impl.connections}

        # The clock is read by this node, too, and must have reached those who read the scans before these do.
        self._commands.wait_for("node that reads scan and odom and sends cmd_vel", lambda: (
            self._cmd_vel.get_num_connections() and self._odometries.get_num_connections() and readers(self._scans)
            and readers(self._scans) <= readers(self._clock)))
        self._clock.publish(Clock(rospy.Time.from_sec(robot.first_stamp)))

    def _stamped(self, message, stamp, frame):
        message.header.stamp, message.header.frame_id = rospy.Time.from_sec(stamp), frame
        return message

    def _tell(self, status):
        self._statuses.publish(self.inputs.status_text(status))

    def begin(self, stamp, goal, status):
        self._tell(status)
        self._clock.publish(Clock(rospy.Time.from_sec(stamp)))
        self._goal = message = self._stamped(PoseStamped(), stamp, "odom")
        fill_pose(message.pose, *goal)
        self._commands.begin(stamp, lambda: self._goals.publish(message), self._current_goal.get_num_connections() > 0)

    def ask(self, sensed, step):
        self._commands.expect(sensed.stamp)
        odometry = self._stamped(fill_odometry(OdometryMessage(), sensed.odometry), sensed.stamp, "odom")
        transform = fill_transform(TransformStamped(), "odom", "base_link", sensed.odometry.pose)
        lidar = self._robot.lidar
        scan = fill_scan(LaserScan(), sensed.ranges, lidar["field_of_view"], lidar["min_range"], self._robot.range_max)
        self._stamped(scan, sensed.stamp, "laser")

        def publish():
            if self._goal:  # In the first step of an episode: who was not connected yet has missed it.
                self._goals.publish(self._goal)
            self._clock.publish(Clock(rospy.Time.from_sec(sensed.stamp)))
            self._odometries.publish(odometry)
            self._tf.publish(TFMessage([self._stamped(transform, sensed.stamp, "odom")]))
            self._scans.publish(scan)

        command = self._commands.take(sensed.stamp, step, publish)
        self._goal = None
        return command

    def end(self, collided, status):
        self._collisions.publish(collided)
        self._tell(status)


def main():
    rospy.set_param("/use_sim_time", True)
    rospy.init_node("slalom_robot", disable_signals=True)
    leave(drive_episodes(Robot), lambda: rospy.signal_shutdown("the end"))


if __name__ == "__main__":
    main()
