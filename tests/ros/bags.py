"""A drive as messages, to be written to a bag, and what a bridge makes of those that are read from one."""

from types import SimpleNamespace

from in_process import DirectPort
from slalom_ros.messages import fill_odometry, fill_pose, fill_scan, fill_velocity, goal_of, odometry_of, scan_of, seconds, velocity_of


class RecordingPort(DirectPort):
    """Keeps (stamp, topic, message) of a drive. types: the classes of one ROS, and its `stamp_of`."""

    def __init__(self, driver, types: SimpleNamespace):
        super().__init__(driver)
        self._types, self.messages = types, []

    def _keep(self, stamp, topic, message, frame=None):
        if frame is not None:
            message.header.stamp, message.header.frame_id = self._types.stamp_of(stamp), frame
        self.messages.append((stamp, topic, message))

    def begin(self, stamp, goal, status):
        message = self._types.PoseStamped()
        fill_pose(message.pose, *goal)
        self._keep(stamp, "/goal_pose", message, "odom")
        super().begin(stamp, goal, status)

    def ask(self, sensed, step):
        command = super().ask(sensed, step)
        lidar = self.robot.lidar
        scan = fill_scan(self._types.LaserScan(), sensed.ranges, lidar["field_of_view"], lidar["min_range"], self.robot.range_max)
        self._keep(sensed.stamp, "/odom", fill_odometry(self._types.Odometry(), sensed.odometry), "odom")
        self._keep(sensed.stamp, "/scan", scan, "laser")
        self._keep(sensed.stamp, "/cmd_vel", fill_velocity(self._types.Twist(), *command))
        return command


def driven_again(bridge, messages):
    """Returns the commands in a bag's (topic, message), and those that a bridge answers the other messages with."""
    recorded, found = [], []
    for topic, message in messages:
        if topic == "/cmd_vel":
            recorded.append(velocity_of(message))
            continue
        now = seconds(message.header.stamp)
        if topic == "/goal_pose":
            answer = bridge.on_goal(goal_of(message), now)
        elif topic == "/odom":
            answer = bridge.on_odometry(odometry_of(message), now)
        else:
            answer = bridge.on_scan(scan_of(message), now)
        if answer:
            found.append((answer.linear, answer.angular))
    return recorded, found
