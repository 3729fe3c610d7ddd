"""Scores whatever drives by scan, odom and goal_pose. ros2 launch slalom_ros score.launch.py courses:=static-test output:=out/mine"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {"courses": "static-test", "episodes": "1", "protocol": "paper", "output": "", "name": "ROS", "lockstep": "true",
             "step": "0.0", "range_clip": "0.0", "stamped": "false"}


def generate_launch_description():
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in ARGUMENTS.items()]
    return LaunchDescription(declared + [Node(
        package="slalom_ros", executable="robot", output="screen",
        parameters=[{name: LaunchConfiguration(name) for name in ARGUMENTS}])])
