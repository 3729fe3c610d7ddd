"""What the nodes of ROS 2 and ROS 1 do alike, without ROS, on the Python package."""

from __future__ import annotations

import math
from typing import Any, Callable

import slalom

from .bridge import DriverBridge, Refused, Settings
from .simulated_robot import score

# Of the driver.
DRIVER_PARAMETERS: dict[str, Any] = {
    "agent": "",  # A policy's file, or dwa, teb, eband, mppi.
    "profile": [],  # Files with the robot and its guard.
    "guard": False,  # A guard whatever the profiles say.
    "goal_x": math.nan,  # Relative to the start, m.
    "goal_y": math.nan,
    "lidar_x": math.nan,  # For a policy that observes it, m.
    "lidar_y": math.nan,
}


def driver_bridge(parameters: dict[str, Any], settings: Settings) -> DriverBridge:
    """Returns the bridge of a driver with these parameters. Raises ValueError, of this package or of slalom."""
    if not parameters["agent"]:
        raise Refused("agent is '', expected a policy's file, or one of dwa, teb, eband, mppi")
    driver = slalom.Driver(parameters["agent"], profile=parameters["profile"], guard=True if parameters["guard"] else None)
    lidar = parameters["lidar_x"], parameters["lidar_y"]
    bridge = DriverBridge(driver, settings, None if math.isnan(sum(lidar)) else lidar)
    ahead = parameters["goal_x"], parameters["goal_y"]
    if not math.isnan(sum(ahead)):
        bridge.set_goal_from_start(*ahead)
    return bridge


def drive_episodes(make_robot: Callable[[], Any]) -> int:
    """Drives the episodes of a robot node and prints their scores, or what is wrong. Returns the exit code."""
    try:
        robot = make_robot()
        print(score(robot, on_ready=robot.ready, parameters=robot.parameters))
        print(", ".join(f"{key} {value}" for key, value in robot.commands.counts().items()), flush=True)
        return 0
    except KeyboardInterrupt:
        return 130
    except (slalom.Error, ValueError, TimeoutError) as error:
        print(f"slalom_ros: {error}", flush=True)
        return 1
