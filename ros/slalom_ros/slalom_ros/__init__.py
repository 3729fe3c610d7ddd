"""Slalom's policies, planners, guard and simulator as nodes of ROS 2 and ROS 1. docs/ros.md is the guide."""
