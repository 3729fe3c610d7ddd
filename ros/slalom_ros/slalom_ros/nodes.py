"""What the nodes of ROS 2 and ROS 1 do alike, without ROS, on the Python package."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
import time
import traceback
from typing import Any, Callable, NoReturn, Sequence

import slalom

from .bridge import DriverBridge, Refused, Settings
from .messages import seconds, velocity_of
from .simulated_robot import Commands, reset_of, score

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


def parameter_of(name: str, value: Any, default: Any) -> Any:
    """Returns the value of a parameter as one of its default's kind: 1 is a number with a fraction, too, and a text is a list of its
    words. Raises `Refused`."""
    if isinstance(default, list):
        return value.split() if isinstance(value, str) else [str(item) for item in value if item != ""]
    if isinstance(default, str):
        return str(value)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise Refused(f"{name} is {value!r}, expected true or false")
        return value
    try:
        number = type(default)(value)
        if not isinstance(value, bool) and (isinstance(value, str) or number == value or math.isnan(number)):
            return number
    except (TypeError, ValueError, OverflowError):
        pass
    raise Refused(f"{name} is {value!r}, expected {'an integer' if isinstance(default, int) else 'a number'}")


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


class Ending:
    """Whether SIGINT or SIGTERM has come since this was made. Their handler takes no lock, such as an Event's: the thread that it
    interrupts may hold it, and would wait for itself without end."""

    def __init__(self):
        self.is_told = False
        for number in signal.SIGINT, signal.SIGTERM:
            signal.signal(number, self._on_signal)

    def _on_signal(self, number, frame):
        self.is_told = True


def leave(code: int, shut_down: Callable[[], Any]) -> NoReturn:
    """Ends the process after `shut_down`, which gets five seconds: ROS may wait for its threads or a master without end."""
    thread = threading.Thread(target=shut_down, daemon=True)
    thread.start()
    thread.join(5.0)
    try:
        sys.stdout.flush()
    finally:
        os._exit(code)


class RobotInputs:
    """Gives the messages that a robot node receives to its commands. log_error: says what is wrong with one."""

    def __init__(self, parameters: dict[str, Any], log_error: Callable[[str], Any]):
        p, ending = parameters, Ending()
        self.commands = Commands(p["lockstep"], p["client_timeout"], p["command_timeout"], time.monotonic, lambda: ending.is_told)
        self.course_names: Sequence[str] = ()  # Known once the evaluation is about to begin.
        self._log_error = log_error

    def on_command(self, message: Any) -> None:
        """A Twist or a TwistStamped has come."""
        stamp = seconds(message.header.stamp) if hasattr(message, "header") else None
        self.commands.give(*velocity_of(message), stamp)

    def on_current_goal(self, message: Any) -> None:
        self.commands.on_current_goal(seconds(message.header.stamp), message.header.frame_id)

    def on_reset(self, message: Any) -> None:
        try:
            self.commands.reset(reset_of(message.data, self.course_names))
        except Refused as error:
            self._log_error(str(error))

    def status_text(self, status: dict[str, Any]) -> str:
        """Returns a status and what it says of the commands, as `~/status` has it."""
        return ", ".join(f"{key} {value}" for key, value in {**status, **self.commands.counts()}.items())


def drive_episodes(make_robot: Callable[[], Any]) -> int:
    """Drives the episodes of a robot node and prints their scores, or what is wrong. Returns the exit code, whatever happens:
    ROS's threads would keep the process."""
    try:
        robot = make_robot()
        print(score(robot, on_ready=robot.ready, parameters=robot.parameters))
        print(robot.inputs.status_text({}), flush=True)
        return 0
    except KeyboardInterrupt:
        return 130
    except (slalom.Error, ValueError, TimeoutError) as error:
        print(f"slalom_ros: {error}", flush=True)
        return 1
    except Exception:
        traceback.print_exc()
        return 1
