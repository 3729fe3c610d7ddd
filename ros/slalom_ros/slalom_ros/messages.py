"""Messages of either ROS as what the bridge knows. Both versions give the fields the same names, except in stamps."""

from __future__ import annotations

import math
from typing import Any

from .bridge import Frames, Goal, Odometry, Pose, Scan, yaw_of


def seconds(stamp: Any) -> float:
    """Returns a stamp of ROS 2 or ROS 1 in seconds."""
    if hasattr(stamp, "sec"):
        return stamp.sec + 1e-9 * stamp.nanosec
    return stamp.secs + 1e-9 * stamp.nsecs


def _pose(pose):
    q = pose.orientation
    return Pose(pose.position.x, pose.position.y, yaw_of(q.x, q.y, q.z, q.w))


def scan_of(message: Any) -> Scan:
    return Scan(seconds(message.header.stamp), message.angle_min, message.angle_increment, message.ranges,
                message.range_max or math.inf)


def odometry_of(message: Any) -> Odometry:
    """Raises `Refused` if its orientation is none."""
    twist = message.twist.twist
    return Odometry(seconds(message.header.stamp), _pose(message.pose.pose), twist.linear.x, twist.angular.z,
                    message.header.frame_id.lstrip("/"), message.child_frame_id.lstrip("/") or "base_link")


def goal_of(message: Any) -> Goal:
    return Goal(message.pose.position.x, message.pose.position.y, message.header.frame_id.lstrip("/"))


def add_transforms(message: Any, frames: Frames) -> None:
    """Takes what a TFMessage tells."""
    for each in message.transforms:
        q, p = each.transform.rotation, each.transform.translation
        frames.set(each.header.frame_id, each.child_frame_id, Pose(p.x, p.y, yaw_of(q.x, q.y, q.z, q.w)))


def velocity_of(message: Any) -> tuple[float, float]:
    """Returns the speed and the turn rate of a Twist or a TwistStamped."""
    twist = getattr(message, "twist", message)
    return twist.linear.x, twist.angular.z


def fill_velocity(message: Any, linear: float, angular: float) -> Any:
    """Returns a Twist or a TwistStamped with a speed and a turn rate."""
    twist = getattr(message, "twist", message)
    twist.linear.x, twist.angular.z = float(linear), float(angular)
    return message


def fill_pose(pose: Any, x: float, y: float, yaw: float = 0.0) -> None:
    pose.position.x, pose.position.y = float(x), float(y)
    pose.orientation.z, pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def fill_scan(message: Any, ranges: Any, field_of_view: float, range_min: float, range_max: float) -> Any:
    """Returns a LaserScan with ranges from right to left."""
    message.angle_min, message.angle_max = -field_of_view / 2, field_of_view / 2
    message.angle_increment = field_of_view / (len(ranges) - 1)
    message.range_min, message.range_max = float(range_min), float(range_max)
    message.ranges = ranges.tolist()
    return message


def fill_odometry(message: Any, odometry: Odometry) -> Any:
    """Returns an Odometry."""
    message.header.frame_id, message.child_frame_id = odometry.frame, odometry.robot_frame
    fill_pose(message.pose.pose, *odometry.pose)
    message.twist.twist.linear.x, message.twist.twist.angular.z = odometry.linear, odometry.angular
    return message


def fill_transform(message: Any, parent: str, child: str, pose: Pose) -> Any:
    """Returns a TransformStamped."""
    message.header.frame_id, message.child_frame_id = parent, child
    message.transform.translation.x, message.transform.translation.y = float(pose.x), float(pose.y)
    message.transform.rotation.z, message.transform.rotation.w = math.sin(pose.yaw / 2), math.cos(pose.yaw / 2)
    return message
