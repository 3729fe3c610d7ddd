"""The simulator as a robot, without ROS: it is the agent of an evaluation, and asks a port for each command.

So the protocols, the files and the reports are those of `slalom.evaluate`, and so are the episodes.
"""

from __future__ import annotations

import math
import os
import threading
from typing import Any, Callable, NamedTuple, Optional, Protocol, Sequence

import numpy as np

from .bridge import Odometry, Pose, Refused, action_of


class Sensed(NamedTuple):
    """What the robot publishes in one step."""

    stamp: float
    ranges: np.ndarray  # [m], infinity for no echo.
    odometry: Odometry


class Reset(Exception):
    """Leaves an episode for another one."""

    def __init__(self, course: str, episode: int):
        self.course, self.episode = course, episode


def reset_of(text: str, course_names: Sequence[str]) -> Reset:
    """Returns what a message asks for: the name of a course or its number, and the number of an episode. Raises `Refused`."""
    course, _, episode = text.strip().partition(" ")
    if course.isdigit() and int(course) < len(course_names):
        course = course_names[int(course)]
    if course not in course_names or not (episode.strip() or "0").isdigit():
        raise Refused(f"reset is '{text}', expected a course, from 0 to {len(course_names) - 1} or by its name such as "
                      f"{course_names[0]}, and the number of an episode")
    return Reset(course, int(episode or 0))


class Port(Protocol):
    """The robot's side of the topics."""

    def begin(self, stamp: float, goal: tuple[float, float], status: dict[str, int]) -> None:
        """An episode begins, with its goal in the frame of the odometry. Returns when whoever drives knows of it."""

    def ask(self, sensed: Sensed, step: float) -> tuple[float, float]:
        """Publishes it, and returns the speed and the turn rate for the next `step` seconds."""

    def end(self, collided: bool, status: dict[str, int]) -> None:
        """An episode has ended."""


class SimulatedRobot:
    """Gives the frames of an evaluation, one episode at a time, to a port, and its commands to the evaluation."""

    def __init__(self, port: Port, task: dict[str, Any], course_names: Sequence[str] = (), start: float = 1.0):
        """task: [environment] of the evaluation. start: the first stamp."""
        self._port = port
        self.step: float = task["episode"]["step"]
        self.bounds: dict[str, float] = task["action"]
        self.lidar: dict[str, float] = task["lidar"]
        self.range_max = min(task["observation"]["range_clip"], self.lidar["max_range"])
        self.first_stamp = start
        self._stamp = start - self.step
        self.course_names = course_names
        self._num_commands = task["observation"]["commands"]
        self._status = {"episodes": 0, "ended": 0, "successes": 0, "collisions": 0}

    def act(self, observations: dict[str, np.ndarray], first: np.ndarray) -> np.ndarray:
        """What `slalom.evaluate` calls."""
        self._stamp = round(self._stamp + self.step, 9)
        x, y, yaw, linear, angular = map(float, observations["odometry"][0])
        if first[0]:
            goal_x, goal_y = map(float, observations["state"][0, :2])
            self._port.begin(self._stamp, Pose(x, y, yaw).of(goal_x, goal_y), self._status)
        ranges = observations["ranges"][0] / np.float32(100)
        ranges[ranges >= np.float32(self.range_max)] = math.inf
        sensed = Sensed(self._stamp, ranges, Odometry(self._stamp, Pose(x, y, yaw), linear, angular))
        return np.array([self.action(*self._port.ask(sensed, self.step))], np.float32)

    def drive_episode(self, environment: Any, course: str, seed: int) -> None:
        """Drives an episode of an environment that observes speeds."""
        self._status |= {"course": course, "seed": seed}
        observation, _ = environment.reset(options={"course": course, "episode_seed": seed})
        start, is_first, ended = Pose(*environment.pose()), True, False
        while not ended:
            x, y, yaw = environment.pose()
            linear, angular = observation["state"][2 + 2 * self._num_commands:][:2]
            low, high = self.bounds["linear_min"], self.bounds["linear_max"]
            odometry = (*start.inverse_of(x, y), yaw - start.yaw, low + (linear + 1) / 2 * (high - low), angular * self.bounds["angular_max"])
            seen = {name: array[None] for name, array in observation.items()}
            action = self.act({**seen, "odometry": np.array([odometry])}, np.array([is_first]))
            observation, _, terminated, truncated, info = environment.step(action[0])
            is_first, ended = False, terminated or truncated
        counted = {"success": "successes", "collision": "collisions"}.get(info["outcome"])
        counts = {"ended": self._status["ended"] + 1, **({counted: self._status[counted] + 1} if counted else {})}
        self.count({**self._status, **counts})

    def action(self, linear: float, angular: float) -> tuple[float, float]:
        """Returns the action of a command, within the robot's limits; of one that is not finite, standing still."""
        if not (math.isfinite(linear) and math.isfinite(angular)):
            linear = angular = 0.0
        action = action_of(linear, angular, self.bounds)
        return min(max(action[0], -1.0), 1.0), min(max(action[1], -1.0), 1.0)

    def count(self, status: dict[str, int]) -> None:
        """What `slalom.evaluate` tells of its progress."""
        before, self._status = self._status, dict(status)
        if status["ended"] > before["ended"]:
            self._port.end(status["collisions"] > before["collisions"], self._status)


# Of the robot nodes. Those that are empty or 0 are left to the task.
PARAMETERS: dict[str, Any] = {
    "courses": "static-test",
    "episodes": 1,  # On each course.
    "seed": 1,
    "protocol": "paper",
    "profile": [],
    "collection": "",
    "physics": "slalom",
    "step": 0.0,  # s, between two scans.
    "range_clip": 0.0,  # m, how far the LiDAR is published.
    "time_limit": 0.0,  # s
    "output": "",  # Where the evaluation is written.
    "force": False,
    "name": "ROS",  # What reports call whoever drives.
    "lockstep": True,  # The simulator waits for a command after each scan; else it runs in real time.
    "client_timeout": 30.0,  # s, in lockstep: without a command for so long the node ends with an error.
    "command_timeout": 0.5,  # s, in real time: the robot stops without a command for so long.
    "stamped": False,  # cmd_vel is a TwistStamped.
}


class Commands:
    """The commands that come from another thread. clock: seconds of a steady clock. has_to_end: whether the robot was told to
    end; whoever waits for a command, or will, raises KeyboardInterrupt then."""

    def __init__(self, lockstep: bool, client_timeout: float, command_timeout: float, clock: Callable[[], float],
                 has_to_end: Callable[[], bool] = lambda: False):
        self._lockstep, self._client_timeout, self._command_timeout = lockstep, client_timeout, command_timeout
        self._clock, self._has_to_end = clock, has_to_end
        self._changed = threading.Condition()
        self._newest: Optional[tuple[float, float]] = None
        self._stamp = self._accepted = -math.inf
        self._came_at = -math.inf
        self._due: Optional[float] = None
        self._reset: Optional[Reset] = None
        self._rests = False  # Whoever drives has arrived, as it believes, and sends no more commands.
        self.num_commands = self.num_late = 0  # Those that were waited for, and those that took more than a step.
        self.slowest = 0.0  # s, in lockstep.

    def give(self, linear: float, angular: float, stamp: Optional[float] = None) -> None:
        """A command has come. In lockstep one that is stamped before the scan is none for it."""
        with self._changed:
            if self._lockstep and stamp is not None and stamp < self._stamp - 1e-6:
                return
            self._newest, self._came_at = (linear, angular), self._clock()
            self._changed.notify_all()

    def on_current_goal(self, stamp: float, frame: str) -> None:
        """Whoever drives knows of the goal with this stamp, or, without a frame, has none any more. Then, in lockstep, the
        robot stands still without waiting until the next episode."""
        with self._changed:
            self._rests = not frame
            if frame:
                self._accepted = stamp
            self._changed.notify_all()

    def reset(self, reset: Reset) -> None:
        """Whoever waits for a command, or will, leaves the episode."""
        with self._changed:
            self._reset = reset
            self._changed.notify_all()

    def _leave_if_told(self):
        if self._has_to_end():
            raise KeyboardInterrupt
        if self._reset:
            told, self._reset = self._reset, None
            raise told

    def counts(self) -> dict[str, Any]:
        """What a status says of them."""
        slowest = {"slowest": f"{self.slowest:.3f} s"} if self._lockstep else {}
        return {"commands": self.num_commands, "late": self.num_late, **slowest}

    def wait_for(self, what: str, is_there: Callable[[], Any], again: Callable[[], None] = lambda: None) -> bool:
        """Returns when it is there. Calls `again` every ten seconds until then, and returns whether it has. Raises
        TimeoutError."""
        now, repeated = self._clock(), False
        end, next_time = now + self._client_timeout, now + 10.0
        with self._changed:
            while not is_there():
                self._leave_if_told()
                now = self._clock()
                if now > end:
                    raise TimeoutError(f"found no {what} within {self._client_timeout:g} s")
                if now > next_time:
                    again()
                    next_time, repeated = next_time + 10.0, True
                self._changed.wait(0.05)
        return repeated

    def begin(self, stamp: float, publish: Callable[[], None], knows_goal: bool) -> None:
        """Publishes a goal with this stamp, until it is accepted if whoever drives tells so."""
        self._rests = False
        publish()
        if knows_goal:
            self.wait_for(f"current_goal with stamp {stamp:g}", lambda: abs(self._accepted - stamp) < 1e-6, publish)

    def expect(self, stamp: float) -> None:
        """The scan of this stamp is about to be published."""
        with self._changed:
            self._stamp = stamp
            if self._lockstep:
                self._newest = None

    def take(self, stamp: float, step: float, publish: Callable[[], None]) -> tuple[float, float]:
        """Publishes what is sensed, in lockstep again if it is lost, and returns the command for the step after it."""
        if self._lockstep:
            return self._take_in_lockstep(stamp, step, publish)
        publish()
        with self._changed:
            now = self._clock()
            self._due = now if self._due is None or now > self._due + 1.0 else self._due
            self._due += step
            while now < self._due:
                self._changed.wait(self._due - now)
                self._leave_if_told()
                now = self._clock()
            self._leave_if_told()  # One that is always late does not wait.
            self.num_commands += 1
            self.num_late += now - self._came_at > step
            return self._newest if self._newest and now - self._came_at < self._command_timeout else (0.0, 0.0)

    def _take_in_lockstep(self, stamp, step, publish):
        begin = self._clock()
        publish()
        self._leave_if_told()
        repeated = self.wait_for(f"cmd_vel after the scan with stamp {stamp:g}", lambda: self._newest or self._rests, publish)
        with self._changed:
            if not self._newest:
                return 0.0, 0.0
            command, now = self._newest, self._clock()
            self.num_commands += 1
            self.num_late += now - begin > step
            self.slowest = max(self.slowest, now - begin)
            while repeated and self._clock() < now + 1.0:
                self._changed.wait(0.05)  # The answer to what was published again must not be taken for the next.
            return command


def score(port: Port, parameters: dict[str, Any], on_ready: Callable[[SimulatedRobot], None] = lambda robot: None) -> Any:
    """Drives courses by whoever answers at the port, and returns the `slalom.Evaluation`, which is written to `output`. A
    port that raises `Reset` ends the evaluation for the episodes that it asks for.

    parameters: some of `PARAMETERS`. on_ready: called with the robot before the first episode."""
    import slalom
    from slalom import _tomllib

    p = {**PARAMETERS, **parameters}
    output = p["output"]
    if output and not p["force"] and os.path.exists(os.path.join(output, "evaluation.json")):
        raise slalom.Error(f"{output}: holds an evaluation already; choose another directory for output, or set force")
    task: dict[str, Any] = {"profile": p["profile"], "collection": p["collection"], "physics": p["physics"]}
    if p["step"]:
        task["episode"] = {"step": p["step"]}
    if p["range_clip"]:
        task["observation"] = {"range_clip": p["range_clip"]}
    courses = slalom.make_vec(p["courses"], 1, **task)
    robot = SimulatedRobot(port, _tomllib.loads(courses.config)["environment"], courses.course_names)
    rules = {"num_environments": 1}
    if p["time_limit"]:
        rules["time_limit"] = p["time_limit"]
    try:
        on_ready(robot)
        scores = slalom.evaluate(robot.act, p["courses"], name=p["name"], episodes=p["episodes"], seed=p["seed"],
                                 protocol=p["protocol"], evaluation=rules, progress=robot.count, **task)
    except Reset as reset:
        task["observation"] = {**task.get("observation", {}), "speeds": True}
        drive_freely(robot, slalom.make(p["courses"], **task), reset, p["seed"])
    if output:
        scores.write(output, force=p["force"])
    return scores


def drive_freely(robot: SimulatedRobot, environment: Any, reset: Reset, seed: int) -> None:
    """Drives the episode that a reset asks for and, until the next one, those after it, each with the same start whenever it
    is driven. Nothing is scored, and nothing but an exception ends it."""
    while True:
        try:
            robot.drive_episode(environment, reset.course, seed + reset.episode)
            reset = Reset(reset.course, reset.episode + 1)
        except Reset as told:
            reset = told
