"""Driving a robot outside the simulator. docs/robot.md is the guide."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any, NamedTuple, Optional

import numpy as np
from numpy.typing import ArrayLike

from . import _slalom
from ._copies import NotCopied
from .environment import NameOrPath, _flat, _settings
from .policy import Policy


class Command(NamedTuple):
    """What the robot shall do until the next one."""

    linear: float  # Speed, m/s.
    angular: float  # Turn rate to the left, rad/s.
    action: tuple[float, float]  # The same in [-1, 1].
    guarded: bool  # Whether it is the guard's and not the agent's.
    pose: Optional[tuple[float, float, float]] = None  # Where the robot is by guard.scan_matching, m, m, rad.


def _numbers(values):
    return np.asarray(values, float).tolist()


class _Lines(NotCopied):
    """What `slalom act` is, without a pipe."""

    _instead = "make another one"

    def __init__(self, policy, planner, profile, settings):
        profiles = [profile] if isinstance(profile, (str, os.PathLike)) else profile
        self._core = _slalom.Driver(policy, planner, [os.fspath(p) for p in profiles],
                                    [f"{key}={value}" for key, value in settings])
        self.needs: dict[str, Any] = json.loads(self._core.needs())

    def _answer(self, ranges, given):
        line = {"ranges": _numbers(ranges)}
        line |= {key: value if isinstance(value, (bool, int, float)) else _numbers(value)
                 for key, value in given.items() if value is not None}
        answer = json.loads(self._core.answer(json.dumps(line)))
        pose = answer.get("pose")
        return Command(answer["linear"], answer["angular"], tuple(answer["action"]), answer.get("guarded", False),
                       tuple(pose) if pose else None)

    @property
    def step(self) -> float:
        """The time between two calls, in seconds."""
        return self.needs["step"]


class Driver(_Lines):
    """Drives one robot by a policy or a classical planner, under a guard or without one, as `slalom
    act` does. An object may be used by one thread at a time.

    `needs` says what the robot must send: "keys", the arguments of `act`; "num_beams",
    "field_of_view" [rad] and "range_clip" [m] of its scans; "step" [s]; the "bounds" of commands.
    """

    def __init__(self, agent: Policy | NameOrPath, *, profile: NameOrPath | Sequence[NameOrPath] = (),
                 guard: bool | dict[str, Any] | None = None, **sections: dict[str, Any] | float):
        """agent: a policy or its file, or a planner: "dwa", "teb", "eband" or "mppi".
        profile: files with [guard] and [environment], the robot, such as "configs/guarded.toml".
        guard: True for a guard with shield and waypoints, a dictionary of keys of [guard], False for none
        whatever the profile and the policy's training say.
        sections: keys of [environment], such as robot={"length": 0.5}. Without a guard a policy
        reads none of them, and they are refused."""
        if isinstance(guard, dict):
            settings = _flat("guard", guard)
        else:
            settings = [] if guard is None else _flat("guard", {"shield": bool(guard), "waypoints": bool(guard)})
        name = agent.path if isinstance(agent, Policy) else os.fspath(agent)
        is_planner = name in _slalom.planners()
        if not is_planner and not os.path.isfile(name):
            raise _slalom.Error(f"{name}: there is no such file, expected a policy's or a planner: "
                                f"{', '.join(_slalom.planners())}")
        super().__init__("" if is_planner else name, name if is_planner else "", profile,
                         settings + _settings(sections))

    def act(self, ranges: ArrayLike, goal: ArrayLike, *, pose: Optional[ArrayLike] = None,
            speeds: Optional[ArrayLike] = None, first: bool = False, last_action: Optional[ArrayLike] = None,
            mounting: Optional[ArrayLike] = None, no_echo: Optional[float] = None) -> Command:
        """Returns the command for the next `step` seconds. Raises `slalom.Error` that names what is not as expected.

        ranges: the scan in metres, counter-clockwise, as a LaserScan has it: NaN and infinity are no echo.
        goal: x ahead and y to the left of the robot, in metres.
        first: whether an episode begins, such as with another goal: what was seen before is forgotten.
        docs/robot.md has the others."""
        return self._answer(ranges, {
            "goal": goal, "pose": pose, "speeds": speeds, "first": first, "last_action": last_action,
            "mounting": mounting, "no_echo": no_echo})


class Guard(_Lines):
    """The shield alone (docs/safety.md), between any controller and the robot. An object may be used by one
    thread at a time."""

    def __init__(self, *, profile: NameOrPath | Sequence[NameOrPath] = (), guard: Optional[dict[str, Any]] = None,
                 **sections: dict[str, Any] | float):
        """The arguments are those of `Driver`. Waypoints are not used, as a guard alone knows no goal."""
        super().__init__("", "", profile, _flat("guard", guard or {}) + _settings(sections))

    def check(self, ranges: ArrayLike, command: ArrayLike, *, pose: ArrayLike, speeds: ArrayLike, first: bool = False,
              no_echo: Optional[float] = None) -> Command:
        """Returns the command (speed in m/s, turn rate in rad/s) if the robot can take it and stop in
        time, and else the nearest one that it can take. It is clipped to [environment.action]."""
        return self._answer(ranges, {"command": command, "pose": pose, "speeds": speeds, "first": first,
                                     "no_echo": no_echo})
