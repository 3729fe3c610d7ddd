"""What the nodes do, without ROS: plain numbers in, commands out. Nothing here reads a clock.

Times are seconds of the clock that stamps the messages. Angles are radians, counter-clockwise, distances metres.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np


class Refused(ValueError):
    """What cannot be driven with. The message says what was found and what was expected."""


class Pose(NamedTuple):
    x: float
    y: float
    yaw: float

    def of(self, x: float, y: float) -> tuple[float, float]:
        """Returns a point of this pose's frame in the frame of the pose."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + cos * x - sin * y, self.y + sin * x + cos * y

    def inverse_of(self, x: float, y: float) -> tuple[float, float]:
        """Returns a point of the pose's frame in this pose's own."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return cos * (x - self.x) + sin * (y - self.y), cos * (y - self.y) - sin * (x - self.x)


def yaw_of(x: float, y: float, z: float, w: float) -> float:
    """Returns the yaw of a quaternion. Raises `Refused` if it is none, such as four zeros."""
    norm = x * x + y * y + z * z + w * w
    if not abs(norm - 1.0) < 0.01:  # NaN, too.
        raise Refused(f"an orientation is ({x:g}, {y:g}, {z:g}, {w:g}), expected a quaternion of length 1")
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


class Scan(NamedTuple):
    """A LaserScan."""

    stamp: float
    angle_min: float
    angle_increment: float
    ranges: Sequence[float]
    range_max: float = math.inf


class Odometry(NamedTuple):
    stamp: float
    pose: Pose  # Of the robot in `frame`.
    linear: float
    angular: float
    frame: str = "odom"
    robot_frame: str = "base_link"


class Goal(NamedTuple):
    x: float
    y: float
    frame: str = "odom"  # "" is the frame of the odometry.


class Output(NamedTuple):
    """What is to be sent to the robot."""

    linear: float
    angular: float
    guarded: bool = False  # Whether the guard changed it.


STOP = Output(0.0, 0.0)


def action_of(linear: float, angular: float, bounds: dict[str, float]) -> tuple[float, float]:
    """Returns a command as an action, in [-1, 1] within the bounds."""
    low, high = bounds["linear_min"], bounds["linear_max"]
    return 2.0 * (linear - low) / (high - low) - 1.0, angular / bounds["angular_max"]


@dataclass(frozen=True)
class Settings:
    """What is known of a robot, and when it must stop. The nodes have a parameter of each name."""

    no_echo: float = math.nan  # The range that stands for no echo, beside infinity; 0 for some LiDARs.
    max_invalid: float = 0.5  # A scan with a larger share of NaN, or without any number, is not driven by.
    unseen: str = "refuse"  # Beams that are expected where the LiDAR does not look: "refuse" them, or "clear".
    sensor_yaw: float = 0.0  # Where beam angle 0 points on the robot.
    upside_down: bool = False
    max_age: float = 0.5  # Of a scan, of odometry and of another stack's command, before the robot stops.
    max_ahead: float = 0.5  # How far a stamp may be ahead of the clock.
    goal_tolerance: float = 0.3
    max_speed: float = math.inf  # Slower than the agent would: turns keep their curvature.
    max_turn_rate: float = math.inf

    def __post_init__(self):
        if self.unseen not in ("refuse", "clear"):
            raise Refused(f"unseen is '{self.unseen}', expected 'refuse' or 'clear'")
        for name in ("max_age", "max_ahead", "goal_tolerance", "max_speed", "max_turn_rate"):
            if not getattr(self, name) > 0.0:
                raise Refused(f"{name} is {getattr(self, name)}, expected a number above 0")


def _degrees(radians):
    return f"{math.degrees(radians):.1f} degrees"


class ScanFitter:
    """Turns a robot's scans into those that an agent reads: `num_beams` over `field_of_view`, counter-clockwise, the
    middle one ahead. A beam has the nearest range of those that are nearer to it than to its neighbours, or, where
    the robot's LiDAR has fewer, the range of the nearest one.
    """

    def __init__(self, num_beams: int, field_of_view: float, settings: Settings = Settings()):
        self._settings = settings
        self._field_of_view = field_of_view
        self._wanted = np.linspace(-field_of_view / 2, field_of_view / 2, num_beams)
        self._geometry: Optional[tuple[float, float, int]] = None

    def __call__(self, scan: Scan) -> np.ndarray:
        """Returns the ranges, [num_beams], infinity for no echo. Raises `Refused`."""
        geometry = (scan.angle_min, scan.angle_increment, len(scan.ranges))
        if geometry != self._geometry:
            self._fit(*geometry)
            self._geometry = geometry
        given = np.array(scan.ranges, float)
        invalid = np.isnan(given)
        if invalid.mean() > self._settings.max_invalid or invalid.all():
            raise Refused(f"{invalid.sum()} of {len(given)} ranges are NaN, expected at most "
                          f"{100 * self._settings.max_invalid:g} %")
        given[given == -math.inf] = 0.0  # Too near to be measured.
        given[invalid | (given == self._settings.no_echo) | (given > scan.range_max)] = math.inf
        if (given < 0.0).any():
            raise Refused(f"a range is {given.min():g} m, expected 0 or more, or no_echo, which is {self._settings.no_echo:g}")
        ranges = given[self._nearest]
        np.minimum.at(ranges, self._place_of[self._is_seen], given[self._is_seen])
        ranges[self._unseen] = math.inf
        return ranges

    def _fit(self, angle_min, increment, count):
        if count < 2 or not math.isfinite(angle_min) or not math.isfinite(increment) or increment == 0.0:
            raise Refused(f"a scan has {count} ranges, angle_min {angle_min:g} and angle_increment {increment:g}, expected "
                          f"2 ranges or more and numbers, the increment not 0")
        angles = angle_min + increment * np.arange(count)
        angles = self._settings.sensor_yaw + (-angles if self._settings.upside_down else angles)
        angles = np.remainder(angles + math.pi, 2 * math.pi) - math.pi
        spacing = self._field_of_view / (len(self._wanted) - 1)
        away = np.abs(np.remainder(self._wanted[:, None] - angles[None, :] + math.pi, 2 * math.pi) - math.pi)
        self._nearest = away.argmin(1)
        place = np.rint((angles - self._wanted[0]) / spacing).astype(int)
        self._is_seen = (place >= 0) & (place < len(self._wanted))
        self._place_of = place
        self._unseen = away.min(1) > 1.01 * max(spacing, abs(increment))
        if self._unseen.any() and self._settings.unseen == "refuse":
            raise Refused(
                f"the scan has no beams for {self._unseen.sum()} of the {len(self._wanted)} that the agent reads, which are "
                f"from {_degrees(self._wanted[0])} to {_degrees(self._wanted[-1])}; found {count} beams from "
                f"{_degrees(angles[0])} in steps of {_degrees(increment)}. With unseen=clear nothing is taken to be "
                f"where it does not look")


class Frames:
    """Where frames are, in the plane: what tf tells."""

    def __init__(self):
        self._parents: dict[str, tuple[str, Pose]] = {}

    def set(self, parent: str, child: str, pose: Pose) -> None:
        self._parents[child.lstrip("/")] = (parent.lstrip("/"), pose)

    def _chain(self, frame):
        pose, chain = Pose(0.0, 0.0, 0.0), {}
        while frame not in chain:
            chain[frame] = pose
            if frame not in self._parents:
                break
            frame, step = self._parents[frame]
            pose = Pose(*step.of(pose.x, pose.y), step.yaw + pose.yaw)
        return chain

    def find(self, target: str, source: str) -> Optional[Pose]:
        """Returns the pose of the frame `source` in the frame `target`, or None if nothing connects them."""
        up, down = self._chain(source.lstrip("/")), self._chain(target.lstrip("/"))
        for frame, pose in up.items():
            if frame in down:
                of_target = down[frame]
                return Pose(*of_target.inverse_of(pose.x, pose.y), pose.yaw - of_target.yaw)
        return None


class _Stepper:
    """Pairs scans with odometry, and stops where one of them is missing, old or odd.

    `on_...` and `tick` return what is to be sent, or None if nothing is. `tick` is called some twenty times a second.
    `now` is the time of the clock that stamps the messages. `status` says in words what goes on, and `is_stopped`
    whether it is a fault.
    """

    def __init__(self, needs: dict[str, Any], settings: Settings):
        self._settings = settings
        self._period: float = needs["step"]
        self._fit = ScanFitter(needs["num_beams"], needs["field_of_view"], settings)
        self.status, self.is_stopped = "waits for a scan", False
        self._last_now = -math.inf
        self._forget()

    def _forget(self):
        self._odometries: deque[Odometry] = deque(maxlen=200)
        self._scan: Optional[tuple[float, np.ndarray]] = None  # Not answered yet.
        self._scan_stamp: Optional[float] = None  # Of the newest.
        self._scan_period = math.inf
        self._answered: Optional[float] = None  # The stamp of the scan whose answer is `_held`.
        self._acted_at: Optional[float] = None
        self._since = -math.inf  # What is stamped before is passed over.
        self._first = True  # An episode begins for the agent.
        self._held = STOP

    @property
    def scan_stamp(self) -> float:
        """Of the newest scan; 0 if there is none."""
        return self._scan_stamp or 0.0

    # What the two kinds do.
    def _is_wanted(self) -> bool:
        raise NotImplementedError

    def _command(self, ranges: np.ndarray, odometry: Odometry, first: bool) -> Output:
        raise NotImplementedError

    def on_scan(self, scan: Scan, now: float) -> Optional[Output]:
        stopped = self._look_at_clock(now)
        if stopped:
            return stopped
        if scan.stamp < self._since:
            return None
        age = now - scan.stamp
        if now > 0.0 and age < -self._settings.max_ahead:  # 0 is a simulated clock that has not come yet.
            return self._stop(f"a scan is stamped {-age:.2f} s ahead of the clock, expected at most {self._settings.max_ahead:g} s; "
                              f"do both computers have the same time?")
        if self._scan_stamp is not None and scan.stamp <= self._scan_stamp:
            # A scan that was overtaken, or that comes again, as its answer was lost.
            return self._held if self._is_wanted() and scan.stamp == self._answered else None
        if age > self._settings.max_age:
            return self._stop(f"a scan is {age:.2f} s old, expected at most {self._settings.max_age:g} s")
        try:
            ranges = self._fit(scan)
        except Refused as error:
            self._scan = None
            return self._stop(str(error))
        if self._scan_stamp is not None:
            self._scan_period = scan.stamp - self._scan_stamp
        self._scan_stamp = scan.stamp
        self._scan = scan.stamp, ranges
        return self._act(now)

    def on_odometry(self, odometry: Odometry, now: float) -> Optional[Output]:
        stopped = self._look_at_clock(now)
        if stopped:
            return stopped
        if odometry.stamp < self._since:
            return None
        if not all(map(math.isfinite, (*odometry.pose, odometry.linear, odometry.angular))):
            return self._stop("the odometry has NaN or infinity, expected numbers")
        if now > 0.0 and odometry.stamp - now > self._settings.max_ahead:
            return self._stop(f"the odometry is stamped {odometry.stamp - now:.2f} s ahead of the clock, expected at most "
                              f"{self._settings.max_ahead:g} s")
        if self._odometries:
            last = self._odometries[-1]
            if odometry.stamp <= last.stamp:
                return None
            far = math.hypot(odometry.pose.x - last.pose.x, odometry.pose.y - last.pose.y)
            if far > 0.5 + 10.0 * (odometry.stamp - last.stamp):
                self._odometries.clear()
                self._odometries.append(odometry)
                return self._on_leap(far)
        self._odometries.append(odometry)
        return self._act(now)

    def _on_leap(self, far: float) -> Optional[Output]:
        self._first = True
        return self._stop(f"the odometry leapt by {far:.2f} m")

    def tick(self, now: float) -> Optional[Output]:
        stopped = self._look_at_clock(now)
        if stopped:
            return stopped
        if not self._is_wanted():
            return None
        for what, stamp in (("scan", self._scan_stamp),
                            ("odometry", self._odometries[-1].stamp if self._odometries else None)):
            if stamp is None:
                self._set_status(f"waits for {what}", False)
                return None
            age = now - max(stamp, self._since)
            if age > self._settings.max_age:
                return self._stop(f"no {what} for {age:.2f} s, expected one every {self._settings.max_age:g} s")
        return None

    def _look_at_clock(self, now):
        back = self._last_now - now
        self._last_now = now
        if back < 0.1:
            return None
        was_first = self._first
        self._forget()
        stopped = self._stop(f"the clock went back by {back:.2f} s")
        return None if was_first else stopped  # A robot that was sent nothing since its goal is not stopped.

    def _act(self, now):
        if not self._is_wanted() or self._scan is None or not self._odometries:
            return None
        stamp, ranges = self._scan
        if self._odometries[-1].stamp < stamp:
            return None  # The odometry of that moment is still on its way.
        if now - stamp > self._settings.max_age:
            return None  # `tick` says so.
        odometry = min(self._odometries, key=lambda each: abs(each.stamp - stamp))
        if abs(odometry.stamp - stamp) > self._settings.max_age:
            return self._stop(f"the odometry is {abs(odometry.stamp - stamp):.2f} s from the scan, expected at most "
                              f"{self._settings.max_age:g} s")
        self._scan = None
        self._answered = stamp
        waited = math.inf if self._acted_at is None else stamp - self._acted_at
        if not self._first and waited < self._period - 0.5 * min(self._scan_period, self._period):
            return self._held
        first = self._first or waited > 2.5 * self._period  # What was seen before is not of the steps before.
        try:
            output = self._command(ranges, odometry, first)
        except ValueError as error:  # Of this module or of slalom: what cannot be driven with.
            return self._stop(str(error))
        self._first = False
        self._acted_at = stamp
        self._held = output
        return output

    def _set_status(self, status, is_stopped):
        self.status, self.is_stopped = status, is_stopped

    def _stop(self, status):
        """A bridge that does not drive stops nobody."""
        is_wanted = self._is_wanted()
        self._set_status(status, True)
        self._first = True
        self._held = STOP
        return STOP if is_wanted else None


class DriverBridge(_Stepper):
    """Drives to one goal after another. `driver`: a `slalom.Driver`, or anything with its `needs` and `act`."""

    def __init__(self, driver: Any, settings: Settings = Settings(), mounting: Optional[tuple[float, float]] = None):
        super().__init__(driver.needs, settings)
        if "mounting" in driver.needs["keys"] and mounting is None:
            raise Refused("the policy observes where the LiDAR is mounted, expected lidar_x and lidar_y")
        self._driver = driver
        self._mounting = mounting if "mounting" in driver.needs["keys"] else None
        self._reads_odometry = "pose" in driver.needs["keys"]
        self._reads_speeds = "speeds" in driver.needs["keys"]
        self._bounds = driver.needs["bounds"]
        self._frames = Frames()
        self._goal: Optional[Goal] = None
        self._ahead: Optional[tuple[float, float]] = None  # A goal relative to the start, until the start is known.
        self._limited: Optional[tuple[float, float]] = None  # What was done in place of the last action.
        self._map: Optional[Pose] = None  # The odometry's frame in that of scan matching.
        self.goal_R: Optional[tuple[float, float]] = None
        self.status = "waits for a goal"

    @property
    def goal(self) -> Optional[Goal]:
        return self._goal

    @property
    def frames(self) -> Frames:
        return self._frames

    def on_goal(self, goal: Goal, now: float, since: float = -math.inf) -> Optional[Output]:
        """Begins to drive to a goal; what was seen before is forgotten, and what is stamped before `since` passed over: a
        simulator that has put the robot elsewhere may have sent it before the goal."""
        if not (math.isfinite(goal.x) and math.isfinite(goal.y)):
            return self._stop(f"a goal is ({goal.x}, {goal.y}), expected numbers")
        last = self._odometries[-1] if self._odometries else None
        if last and goal.frame == last.robot_frame:
            goal = Goal(*last.pose.of(goal.x, goal.y), last.frame)
        self._ahead = None
        self._odometries.clear()  # A robot that was put elsewhere with its new goal has not leapt.
        self._scan = self._answered = None
        self._since = since - 1e-6
        self._begin(goal)
        return None

    def set_goal_from_start(self, x: float, y: float) -> None:
        """A goal x ahead and y to the left of where the robot is when its first odometry comes."""
        self._goal, self._ahead = None, (x, y)
        self._first = True

    def _begin(self, goal):
        self._goal = goal
        self._map = None
        self._first = True
        self._set_status(f"drives to ({goal.x:.2f}, {goal.y:.2f}) in {goal.frame or 'the odometry frame'}", False)

    def on_odometry(self, odometry: Odometry, now: float) -> Optional[Output]:
        if self._ahead is not None:
            x, y = odometry.pose.of(*self._ahead)
            self._ahead = None
            self._begin(Goal(x, y, odometry.frame))
        output = super().on_odometry(odometry, now)
        if output is None and self._goal is not None and not self._first:
            try:
                return self._arrive(self._locate(odometry, self._matched(odometry.pose)))
            except Refused:
                return None  # The next scan stops the robot.
        return output

    def _arrive(self, goal):
        """Returns a stop if the robot is there. Between two steps it may drive over the goal."""
        self.goal_R = goal
        if math.hypot(*goal) >= self._settings.goal_tolerance:
            return None
        self._goal = None
        self._set_status("has arrived", False)
        return STOP

    def _is_wanted(self):
        return self._goal is not None

    def _on_leap(self, far):
        if self._goal is not None and self._goal.frame in ("", self._odometries[-1].frame):
            stopped = self._stop(f"the odometry leapt by {far:.2f} m, and the goal with it; expected a new goal")
            self._goal = None
            return stopped
        return super()._on_leap(far)

    def _matched(self, pose):
        """Returns the pose as scan matching corrects it."""
        return Pose(*self._map.of(pose.x, pose.y), self._map.yaw + pose.yaw) if self._map else pose

    def _locate(self, odometry, pose):
        """Returns the goal as a robot at this pose sees it."""
        goal = self._goal
        x, y = goal.x, goal.y
        if goal.frame not in ("", odometry.frame):
            frame = self._frames.find(odometry.frame, goal.frame)
            if frame is None:
                raise Refused(f"the goal is in the frame '{goal.frame}', expected '{odometry.frame}', '{odometry.robot_frame}' "
                              f"or one that tf connects with them")
            x, y = frame.of(x, y)
        return pose.inverse_of(x, y)

    def _command(self, ranges, odometry, first):
        goal = self._locate(odometry, self._matched(odometry.pose))
        if self._arrive(goal):
            return STOP
        pose = {"pose": odometry.pose} if self._reads_odometry else {}
        speeds = {"speeds": (odometry.linear, odometry.angular)} if self._reads_speeds else {}
        command = self._driver.act(ranges, self._locate(odometry, odometry.pose), first=first, mounting=self._mounting,
                                   last_action=None if first else self._limited, **pose, **speeds)
        if command.pose is not None:
            x, y, yaw = command.pose
            turned = Pose(0.0, 0.0, yaw - odometry.pose.yaw)
            there = turned.of(odometry.pose.x, odometry.pose.y)
            self._map = Pose(x - there[0], y - there[1], turned.yaw)
        linear, angular = self._within_limits(command.linear, command.angular)
        changed = (linear, angular) != (command.linear, command.angular)
        self._limited = action_of(linear, angular, self._bounds) if changed else None
        self._set_status(f"drives, {math.hypot(*goal):.1f} m to go", False)
        return Output(linear, angular, command.guarded)

    def _within_limits(self, linear, angular):
        slower = min(1.0, self._settings.max_speed / max(abs(linear), 1e-9))
        linear, angular = linear * slower, angular * slower
        limit = self._settings.max_turn_rate
        return linear, min(max(angular, -limit), limit)


class GuardBridge(_Stepper):
    """Checks the commands of another stack. `guard`: a `slalom.Guard`, or anything with its `needs` and `check`.

    The newest command is checked against each scan that is a step after the last, so a step of the guard
    (`environment.episode.step`) is the LiDAR's period or a multiple of it.
    """

    def __init__(self, guard: Any, settings: Settings = Settings()):
        super().__init__(guard.needs, settings)
        self._guard = guard
        self._raw: Optional[tuple[float, float]] = None
        self._raw_at = -math.inf
        self.status = "waits for a command"

    def on_command(self, linear: float, angular: float, now: float) -> Optional[Output]:
        stopped = self._look_at_clock(now)
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return self._stop(f"a command is ({linear}, {angular}), expected numbers")
        self._raw, self._raw_at = (linear, angular), now
        return stopped

    def tick(self, now: float) -> Optional[Output]:
        stopped = super().tick(now)
        if self._raw is not None and now - self._raw_at > self._settings.max_age:
            stopped = self._stop(f"no command for {now - self._raw_at:.2f} s, expected one every {self._settings.max_age:g} s")
            self._raw = None
        return stopped

    def _is_wanted(self):
        return self._raw is not None

    def _command(self, ranges, odometry, first):
        command = self._guard.check(ranges, self._raw, pose=odometry.pose, speeds=(odometry.linear, odometry.angular),
                                    first=first)
        self._set_status("changes commands" if command.guarded else "lets commands pass", False)
        return Output(command.linear, command.angular, command.guarded)
