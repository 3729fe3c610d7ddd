"""Drives a robot. ros2 launch slalom_ros drive.launch.py agent:=policy.safetensors scan:=/front/scan odom:=/odometry/filtered"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {"agent": "", "profile": "", "guard": "true", "stamped": "false", "no_echo": ".nan", "max_speed": ".inf",
             "goal_x": ".nan", "goal_y": ".nan", "use_sim_time": "false"}
TOPICS = {"scan": "/scan", "odom": "/odom", "cmd_vel": "/cmd_vel", "goal_pose": "/goal_pose"}


def generate_launch_description():
    declared = [DeclareLaunchArgument(name, default_value=value) for name, value in {**ARGUMENTS, **TOPICS}.items()]
    parameters = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    parameters["profile"] = [[parameters["profile"]]]
    return LaunchDescription(declared + [Node(
        package="slalom_ros", executable="driver", parameters=[parameters], output="screen",
        remappings=[(name, LaunchConfiguration(name)) for name in TOPICS])])
