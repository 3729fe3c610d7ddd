"""The bridge between a robot's topics and what drives it: no ROS, and a clock that the test moves."""

import math
import unittest
from types import SimpleNamespace

import numpy as np
from slalom_ros.bridge import (STOP, DriverBridge, Frames, Goal, GuardBridge, Odometry, Output, Pose, Refused, Scan, ScanFitter,
                               Settings, yaw_of)

FOV = math.radians(270)
BEAMS = 91
NEEDS = {"keys": ["goal", "ranges"], "num_beams": BEAMS, "field_of_view": FOV, "step": 0.2,
         "bounds": {"linear_min": -1.0, "linear_max": 2.0, "angular_max": 3.14}}


def room(angles):
    """What a LiDAR in a square room of 8 x 8 m sees, nearer to the wall on its left: no two sides are alike."""
    angles = np.asarray(angles)
    x, y = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        return np.minimum(np.where(x > 0, 5, 3) / abs(x), np.where(y > 0, 1, 7) / abs(y))


def scan(stamp=0.0, count=BEAMS, low=-FOV / 2, high=FOV / 2, ranges=None):
    angles = np.linspace(low, high, count)
    return Scan(stamp, low, (high - low) / (count - 1), room(angles) if ranges is None else ranges)


WANTED = room(np.linspace(-FOV / 2, FOV / 2, BEAMS))


class FakeDriver:
    """Answers what it is told, and keeps what it is asked."""

    def __init__(self, **needs):
        self.needs = {**NEEDS, **needs}
        self.answer = SimpleNamespace(linear=1.0, angular=0.5, guarded=False, pose=None)
        self.asked = []

    def act(self, ranges, goal, **others):
        self.asked.append(SimpleNamespace(ranges=ranges, goal=goal, **others))
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer

    def check(self, ranges, command, **others):
        self.asked.append(SimpleNamespace(ranges=ranges, command=command, **others))
        return self.answer


class Robot:
    """Sends scans at 10 Hz and odometry at 50 Hz for a while, and ticks at 20 Hz. Keeps what comes back, by its time."""

    def __init__(self, bridge, now=100.0, speed=0.0):
        self.bridge, self.now, self.speed, self.x, self.ticks = bridge, now, speed, 0.0, 0
        self.sent = []

    def keep(self, output):
        if output is not None:
            self.sent.append((round(self.now, 3), output))

    def drive(self, seconds, scan_of=scan, odometry=True, delay=0.0, drops=lambda k: False):
        """Returns what was sent in this time. `delay`: of the scans; `drops`: whether scan k does not come."""
        begin = len(self.sent)
        for _ in range(round(seconds / 0.01)):
            self.now, self.ticks = self.now + 0.01, self.ticks + 1
            self.x += 0.01 * self.speed
            if odometry and self.ticks % 2 == 0:
                self.keep(self.bridge.on_odometry(Odometry(self.now, Pose(self.x, 0.0, 0.0), self.speed, 0.0), self.now))
            if scan_of and self.ticks % 10 == 0 and not drops(self.ticks // 10):
                self.keep(self.bridge.on_scan(scan_of(self.now - delay), self.now))
            if self.ticks % 5 == 0:
                self.keep(self.bridge.tick(self.now))
        return [output for _, output in self.sent[begin:]]


def driving(settings=Settings(), driver=None, goal=Goal(5.0, 0.0), **robot):
    """Returns a robot that has driven for a second."""
    driver = driver or FakeDriver()
    bridge = DriverBridge(driver, settings)
    robot = Robot(bridge, **robot)
    bridge.on_goal(goal, robot.now)
    robot.drive(1.0)
    return robot, bridge, driver


class ScanFitterTest(unittest.TestCase):
    def fit(self, given, **settings):
        return ScanFitter(BEAMS, FOV, Settings(**settings))(given)

    def test_keeps_what_is_as_it_should_be(self):
        np.testing.assert_array_equal(self.fit(scan()), WANTED)
        self.assertNotEqual(WANTED[0], WANTED[-1])

    def test_stamps_of_single_precision_move_no_beam(self):
        given = scan()._replace(angle_min=float(np.float32(-FOV / 2)), angle_increment=float(np.float32(FOV / (BEAMS - 1))))
        np.testing.assert_array_equal(self.fit(given), WANTED)

    def test_turns_a_scan_that_is_turned_around(self):
        np.testing.assert_allclose(self.fit(scan(low=FOV / 2, high=-FOV / 2)), WANTED)
        np.testing.assert_allclose(self.fit(scan(ranges=WANTED[::-1]), upside_down=True), WANTED)

    def test_crops_a_wider_view(self):
        wide = scan(count=121, low=-math.pi, high=math.pi)
        np.testing.assert_allclose(self.fit(wide), WANTED)
        around = scan(count=121, low=0.0, high=2 * math.pi)
        np.testing.assert_allclose(self.fit(around), WANTED)

    def test_turns_with_the_sensor(self):
        backwards = scan(count=121, low=0.0, high=2 * math.pi, ranges=room(np.linspace(0, 2 * math.pi, 121) + math.pi))
        np.testing.assert_allclose(self.fit(backwards, sensor_yaw=math.pi), WANTED)

    def test_takes_the_nearest_of_more_beams(self):
        ranges = np.full(901, 5.0)
        ranges[453] = 1.0  # 0.9 degrees to the left: the nearest of the beams is the middle one, at 0.
        found = self.fit(scan(count=901, ranges=ranges))
        self.assertEqual(found[45], 1.0)
        self.assertEqual(np.count_nonzero(found == 1.0), 1)

    def test_repeats_half_the_beams(self):
        found = self.fit(scan(count=46))
        np.testing.assert_allclose(found[::2], WANTED[::2])
        self.assertTrue(all(value in found[::2] for value in found))

    def test_refuses_a_narrower_view_with_numbers(self):
        narrow = scan(low=-math.pi / 2, high=math.pi / 2)
        with self.assertRaisesRegex(Refused, "no beams for 28 of the 91 .* from -135.0 degrees to 135.0 degrees; found 91 beams from "
                                             "-90.0 degrees in steps of 2.0 degrees"):
            self.fit(narrow)
        found = self.fit(narrow, unseen="clear")
        self.assertEqual(np.isinf(found).sum(), 28)
        self.assertTrue(np.isfinite(found[14:77]).all())

    def test_reads_what_means_no_echo(self):
        ranges = WANTED.copy()
        ranges[:6] = [0.0, math.nan, math.inf, -math.inf, 40.0, -1.0]
        found = self.fit(scan(ranges=ranges)._replace(range_max=30.0), no_echo=-1.0)
        self.assertEqual(list(found[:6]), [0.0, math.inf, math.inf, 0.0, math.inf, math.inf])
        ranges[5] = 1.0
        self.assertEqual(self.fit(scan(ranges=ranges), no_echo=0.0)[0], math.inf)
        with self.assertRaisesRegex(Refused, "a range is -1 m, expected 0 or more"):
            self.fit(scan(ranges=[-1.0] + [2.0] * 90))

    def test_refuses_a_blind_scan(self):
        with self.assertRaisesRegex(Refused, "46 of 91 ranges are NaN, expected at most 50 %"):
            self.fit(scan(ranges=[math.nan] * 46 + [1.0] * 45))
        with self.assertRaisesRegex(Refused, "91 of 91 ranges are NaN"):
            self.fit(scan(ranges=[math.nan] * 91), max_invalid=1.0)

    def test_refuses_what_is_no_scan(self):
        for broken in (Scan(0.0, 0.0, 0.1, []), Scan(0.0, 0.0, 0.0, [1.0, 2.0]), Scan(0.0, math.nan, 0.1, [1.0, 2.0])):
            with self.assertRaisesRegex(Refused, "a scan has . ranges, angle_min"):
                self.fit(broken)


class FramesTest(unittest.TestCase):
    def test_finds_through_a_chain_in_both_directions(self):
        frames = Frames()
        frames.set("map", "odom", Pose(1.0, 2.0, math.pi / 2))
        frames.set("/odom", "/base_link", Pose(3.0, 0.0, 0.0))
        np.testing.assert_allclose(frames.find("map", "base_link"), (1.0, 5.0, math.pi / 2))
        np.testing.assert_allclose(frames.find("base_link", "map"), (-5.0, 1.0, -math.pi / 2), atol=1e-12)
        self.assertIsNone(frames.find("map", "elsewhere"))

    def test_ends_in_a_circle(self):
        frames = Frames()
        frames.set("a", "b", Pose(1.0, 0.0, 0.0))
        frames.set("b", "a", Pose(1.0, 0.0, 0.0))
        self.assertIsNone(frames.find("c", "a"))

    def test_refuses_what_is_no_orientation(self):
        self.assertAlmostEqual(yaw_of(0.0, 0.0, math.sin(0.4), math.cos(0.4)), 0.8)
        for broken in ((0.0, 0.0, 0.0, 0.0), (0.0, 0.0, math.nan, 1.0)):
            with self.assertRaisesRegex(Refused, "expected a quaternion"):
                yaw_of(*broken)


class DriverBridgeTest(unittest.TestCase):
    def drives(self, outputs):
        self.assertTrue(outputs)
        self.assertEqual(set(outputs), {Output(1.0, 0.5)})

    def stops(self, outputs):
        self.assertTrue(outputs)
        self.assertEqual(outputs[-1], STOP)

    def test_answers_each_scan_and_asks_at_the_policys_rate(self):
        robot, bridge, driver = driving()
        self.drives(robot.drive(1.0))
        self.assertEqual(len(robot.sent), 20)  # As many as scans.
        self.assertEqual(len(driver.asked), 10)
        self.assertEqual([asked.first for asked in driver.asked], [True] + [False] * 9)
        np.testing.assert_array_equal(driver.asked[0].ranges, WANTED)
        self.assertFalse(bridge.is_stopped)

    def test_answers_a_scan_that_comes_again_as_before(self):
        robot, bridge, driver = driving()
        stamp = bridge.scan_stamp
        self.assertEqual(bridge.on_scan(scan(stamp), robot.now), Output(1.0, 0.5))
        self.assertIsNone(bridge.on_scan(scan(stamp - 0.1), robot.now))
        self.assertEqual(len(driver.asked), 5)

    def test_passes_over_what_is_of_before_its_goal(self):
        """A simulator has put the robot elsewhere: scans and odometry of before come with the goal, or again."""
        for is_late in True, False:
            robot, bridge, driver = driving(goal=Goal(1.5, 0.0))
            asked, now = len(driver.asked), robot.now + 0.02
            self.assertEqual(bridge.on_odometry(Odometry(now, Pose(1.4, 0.0, 0.0), 0.0, 0.0), now), STOP)
            bridge.on_goal(Goal(5.0, 0.0), now, since=now + 0.2)
            self.assertIsNone(bridge.on_scan(scan(now if is_late else bridge.scan_stamp), now))
            self.assertIsNone(bridge.on_odometry(Odometry(now + 0.1, Pose(1.4, 0.0, 0.0), 0.0, 0.0), now + 0.1))
            self.assertIsNone(bridge.on_scan(scan(now + 0.1), now + 0.1))
            self.assertIsNone(bridge.on_odometry(Odometry(now + 0.2, Pose(-5.0, 0.0, 0.0), 0.0, 0.0), now + 0.2))
            self.assertEqual(len(driver.asked), asked)
            self.assertEqual(bridge.on_scan(scan(now + 0.2), now + 0.2), Output(1.0, 0.5))

    def test_is_not_blind_for_what_it_was_not_sent_before_its_goal(self):
        """While a simulator stood still it did not wait, and scans were lost."""
        robot, bridge, driver = driving(goal=Goal(0.1, 0.0))
        now = robot.now + 5.0
        bridge.on_goal(Goal(5.0, 0.0), now, since=now)
        self.assertIsNone(bridge.tick(now + 0.2))
        self.assertIsNone(bridge.on_odometry(Odometry(now, Pose(0.0, 0.0, 0.0), 0.0, 0.0), now + 0.2))
        self.assertIsNone(bridge.tick(now + 0.2))
        self.assertEqual(bridge.tick(now + 0.6), STOP)

    def test_sends_nothing_without_a_goal(self):
        bridge = DriverBridge(FakeDriver())
        robot = Robot(bridge)
        blind = lambda stamp: scan(stamp, ranges=[math.nan] * BEAMS)  # noqa: E731
        self.assertEqual(robot.drive(1.0) + robot.drive(0.5, scan_of=blind) + robot.drive(1.0, scan_of=None), [])

    def test_a_goal_stays_where_it_is(self):
        robot, _, driver = driving(speed=1.0)
        robot.drive(1.0)
        self.assertAlmostEqual(driver.asked[-1].goal[0], 5.0 - robot.x, delta=0.2)
        self.assertLess(driver.asked[-1].goal[0], 3.3)

    def test_takes_the_odometry_of_the_scan(self):
        """A scan waits for the odometry of its moment, and a late scan is given that of its moment and no newer one."""
        driver = FakeDriver(keys=["goal", "ranges", "pose", "speeds"])
        bridge = DriverBridge(driver)
        bridge.on_goal(Goal(5.0, 0.0), 1.0)
        self.assertIsNone(bridge.on_odometry(Odometry(1.0, Pose(1.0, 0.0, 0.0), 0.5, 0.1), 1.0))
        self.assertIsNone(bridge.on_scan(scan(1.02), 1.02))
        self.assertEqual(bridge.on_odometry(Odometry(1.02, Pose(1.02, 0.0, 0.0), 0.6, 0.2), 1.03), Output(1.0, 0.5))
        self.assertEqual((driver.asked[0].pose.x, driver.asked[0].speeds), (1.02, (0.6, 0.2)))
        for k in range(3, 15):
            self.assertIsNone(bridge.on_odometry(Odometry(1.0 + 0.02 * k, Pose(1.0 + 0.02 * k, 0.0, 0.0), 0.6, 0.2), 1.0 + 0.02 * k))
        bridge.on_scan(scan(1.22), 1.28)
        self.assertAlmostEqual(driver.asked[1].pose.x, 1.22)

    def test_a_goal_of_another_frame(self):
        bridge = DriverBridge(FakeDriver())
        robot = Robot(bridge)
        bridge.on_goal(Goal(1.0, 0.0, "map"), robot.now)
        self.stops(robot.drive(0.5))
        self.assertIn("the goal is in the frame 'map', expected 'odom', 'base_link'", bridge.status)
        bridge.frames.set("map", "odom", Pose(0.0, 2.0, math.pi / 2))
        self.drives(robot.drive(0.3)[1:])
        np.testing.assert_allclose(bridge.goal_R, (-2.0, -1.0), atol=1e-12)

    def test_a_goal_in_the_robots_frame(self):
        robot, bridge, driver = driving(speed=1.0)
        bridge.on_goal(Goal(2.0, 1.0, "base_link"), robot.now)
        x = robot.x
        robot.drive(0.2)
        np.testing.assert_allclose(driver.asked[-1].goal, (x + 2.0 - robot.x, 1.0), atol=0.1)

    def test_a_goal_from_the_start(self):
        bridge = DriverBridge(FakeDriver())
        bridge.set_goal_from_start(0.0, 10.0)
        self.assertIsNone(bridge.on_scan(scan(5.0), 5.0))
        yaw = math.pi / 2
        bridge.on_odometry(Odometry(5.0, Pose(3.0, 4.0, yaw), 0.0, 0.0, "odom_frame"), 5.0)
        self.assertEqual(bridge.goal.frame, "odom_frame")
        np.testing.assert_allclose((bridge.goal.x, bridge.goal.y), (-7.0, 4.0))
        np.testing.assert_allclose(bridge.goal_R, (0.0, 10.0), atol=1e-12)

    def test_stops_at_the_goal_and_stays_silent(self):
        robot, bridge, driver = driving(goal=Goal(1.5, 0.0), speed=1.0)
        self.stops(robot.drive(0.5))
        self.assertEqual(bridge.status, "has arrived")
        self.assertLess(1.5 - robot.x, 0.3)
        self.assertEqual(robot.drive(1.0), [])

    def test_stops_where_scan_matching_says_that_the_goal_is(self):
        """Odometry says half a metre too much. The driver is told of the goal as odometry has it."""
        robot, bridge, driver = driving(goal=Goal(2.0, 0.0), speed=1.0)
        start = robot.x
        answer = driver.answer

        def act(ranges, goal, **others):
            driver.asked.append(goal)
            np.testing.assert_allclose(goal, (2.0 - robot.x, 0.0), atol=0.05)
            return SimpleNamespace(**{**vars(answer), "pose": (robot.x - 0.5, 0.0, 0.0)})

        driver.act = act
        robot.drive(2.0 - start)
        self.assertIn("to go", bridge.status)
        self.stops(robot.drive(0.5))
        self.assertEqual(bridge.status, "has arrived")
        self.assertGreater(robot.x, 2.15)
        bridge.on_goal(Goal(robot.x + 0.35, 0.0), robot.now)  # What was matched to the last goal's map is forgotten.
        driver.act = lambda *_, **__: SimpleNamespace(**{**vars(answer), "pose": None})
        self.stops(robot.drive(0.4))
        self.assertEqual(bridge.status, "has arrived")

    def test_scan_matching_turns_the_frame(self):
        robot, bridge, driver = driving(goal=Goal(2.0, 0.0))
        x, y = robot.x - 1.0, 0.5
        driver.answer.pose = (x, y, 0.25)
        robot.drive(0.5)
        np.testing.assert_allclose(bridge.goal_R, Pose(x, y, 0.25).inverse_of(2.0, 0.0), atol=1e-9)

    def test_stops_at_a_goal_that_it_drives_over_between_two_steps(self):
        """At 3 m/s it is 0.6 m from step to step, and never as near as 0.1 m in one."""
        robot, bridge, driver = driving(Settings(goal_tolerance=0.1), goal=Goal(3.95, 0.0), speed=3.0)
        robot.drive(1.0)
        self.assertEqual(bridge.status, "has arrived")
        self.assertGreater(min(math.hypot(*asked.goal) for asked in driver.asked), 0.1)

    def test_two_goals_in_turn_and_one_behind(self):
        robot, bridge, driver = driving()
        bridge.on_goal(Goal(-5.0, 0.0), robot.now)
        self.drives(robot.drive(0.5))
        self.assertEqual(driver.asked[-1].goal, (-5.0, 0.0))
        self.assertEqual([k for k, asked in enumerate(driver.asked) if asked.first], [0, 5])

    def test_drives_on_if_scans_are_late_or_lost(self):
        robot, bridge, driver = driving()
        self.drives(robot.drive(2.0, delay=0.1))
        self.drives(robot.drive(4.0, drops=lambda k: k % 5 == 0))
        self.assertEqual(sum(asked.first for asked in driver.asked), 1)

    def test_stops_without_scans_and_drives_on_with_them(self):
        robot, bridge, driver = driving()
        outputs = robot.drive(1.0, scan_of=None)
        self.stops(outputs)
        self.assertRegex(bridge.status, "no scan for .* s, expected one every 0.5 s")
        at = next(time for time, output in robot.sent if output == STOP)
        self.assertAlmostEqual(at, 101.0 + 0.5, delta=0.06)
        asked = len(driver.asked)
        self.drives(robot.drive(0.5)[3:])
        self.assertTrue(driver.asked[asked].first)

    def test_stops_without_odometry(self):
        robot, bridge, driver = driving()
        self.stops(robot.drive(1.0, odometry=False))
        self.assertRegex(bridge.status, "no odometry for")
        self.drives(robot.drive(0.5)[3:])

    def test_stops_if_scans_are_old_when_they_come(self):
        robot, bridge, driver = driving()
        self.stops(robot.drive(1.2, delay=0.6))
        self.assertRegex(bridge.status, "a scan is 0.60 s old, expected at most 0.5 s|no scan for")

    def test_stops_if_the_clocks_differ(self):
        robot, bridge, driver = driving()
        self.stops(robot.drive(0.3, delay=-5.0))
        self.assertRegex(bridge.status, "5.00 s ahead of the clock, expected at most 0.5 s; do both computers")

    def test_stops_if_the_clock_goes_back_and_drives_on(self):
        robot, bridge, driver = driving()
        robot.now -= 5.0
        self.assertEqual(robot.drive(0.02), [STOP])
        self.assertEqual(bridge.status, "the clock went back by 4.98 s")
        asked = len(driver.asked)
        self.drives(robot.drive(1.0))
        self.assertTrue(driver.asked[asked].first)

    def test_a_clock_that_goes_back_with_a_new_goal_stops_nobody(self):
        """A simulator that begins anew sends both, in any order, and counts the answers to its scans."""
        robot, bridge, driver = driving()
        bridge.on_goal(Goal(4.0, 0.0), robot.now)
        robot.now -= 50.0
        self.assertIsNone(bridge.on_odometry(Odometry(robot.now, Pose(0.0, 0.0, 0.0), 0.0, 0.0), robot.now))
        self.assertEqual(bridge.on_scan(scan(robot.now), robot.now), Output(1.0, 0.5))
        self.assertEqual(driver.asked[-1].goal, (4.0, 0.0))

    def test_stops_before_a_blind_or_narrow_scan(self):
        robot, bridge, driver = driving()
        self.stops(robot.drive(0.2, scan_of=lambda stamp: scan(stamp, ranges=[math.nan] * BEAMS)))
        self.drives(robot.drive(0.3)[1:])
        self.stops(robot.drive(0.2, scan_of=lambda stamp: scan(stamp, low=-1.0, high=1.0)))
        self.assertIn("no beams for", bridge.status)

    def test_drives_on_with_other_beams(self):
        for changed in ({"count": 46}, {"count": 721, "low": -math.pi, "high": math.pi}, {"low": FOV / 2, "high": -FOV / 2}):
            robot, bridge, driver = driving()
            self.drives(robot.drive(0.5, scan_of=lambda stamp: scan(stamp, **changed)))

    def test_forgets_its_goal_if_the_odometry_leaps(self):
        robot, bridge, driver = driving()
        robot.x += 3.0
        self.stops(robot.drive(0.5))
        self.assertIn("the odometry leapt by 3.00 m, and the goal with it", bridge.status)
        self.assertIsNone(bridge.goal)
        robot.x -= 3.0  # Put back, with a new goal: that is none.
        bridge.on_goal(Goal(4.0, 0.0), robot.now)
        self.drives(robot.drive(0.5))

    def test_stops_if_the_odometry_has_no_numbers(self):
        robot, bridge, driver = driving()
        self.assertEqual(bridge.on_odometry(Odometry(robot.now + 0.01, Pose(math.nan, 0.0, 0.0), 0.0, 0.0), robot.now + 0.01), STOP)

    def test_stops_if_the_agent_refuses(self):
        robot, bridge, driver = driving()
        driver.answer = ValueError("goal: found 120 m, expected at most 100 m")
        self.stops(robot.drive(0.3))
        self.assertIn("goal: found 120 m", bridge.status)

    def test_keeps_limits_and_tells_the_agent_what_was_done(self):
        robot, bridge, driver = driving(Settings(max_speed=0.5))
        self.assertEqual(robot.sent[-1][1], Output(0.5, 0.25))  # The same curve.
        np.testing.assert_allclose(driver.asked[-1].last_action, (0.0, 0.25 / 3.14))
        self.assertIsNone(driver.asked[0].last_action)
        robot, bridge, driver = driving(Settings(max_turn_rate=0.1))
        self.assertEqual(robot.sent[-1][1], Output(1.0, 0.1))
        driver.answer = SimpleNamespace(linear=-1.0, angular=-0.05, guarded=True, pose=None)
        self.assertEqual(robot.drive(0.5)[-1], Output(-1.0, -0.05, True))
        self.assertIsNone(driver.asked[-1].last_action)

    def test_needs_the_mounting_if_the_policy_does(self):
        with self.assertRaisesRegex(Refused, "expected lidar_x and lidar_y"):
            DriverBridge(FakeDriver(keys=["goal", "mounting", "ranges"]))
        driver = FakeDriver(keys=["goal", "mounting", "ranges"])
        bridge = DriverBridge(driver, mounting=(0.1, 0.0))
        bridge.on_goal(Goal(1.0, 0.0), 1.0)
        bridge.on_odometry(Odometry(1.0, Pose(0.0, 0.0, 0.0), 0.0, 0.0), 1.0)
        bridge.on_scan(scan(1.0), 1.0)
        self.assertEqual(driver.asked[0].mounting, (0.1, 0.0))

    def test_refuses_settings(self):
        with self.assertRaisesRegex(Refused, "unseen is 'guess', expected 'refuse' or 'clear'"):
            Settings(unseen="guess")
        with self.assertRaisesRegex(Refused, "max_age is 0, expected a number above 0"):
            Settings(max_age=0)


class GuardBridgeTest(unittest.TestCase):
    def test_checks_commands_and_stops_without_them(self):
        guard = FakeDriver(step=0.1)
        bridge = GuardBridge(guard)
        robot = Robot(bridge)
        self.assertEqual(robot.drive(0.5), [])
        bridge.on_command(1.5, 0.2, robot.now)
        guard.answer = SimpleNamespace(linear=0.4, angular=0.0, guarded=True)
        outputs = robot.drive(0.4)
        self.assertEqual(set(outputs), {Output(0.4, 0.0, True)})
        self.assertEqual((guard.asked[-1].command, guard.asked[-1].first), ((1.5, 0.2), False))
        self.assertEqual(bridge.status, "changes commands")
        outputs = robot.drive(0.4)
        self.assertEqual(outputs[-1], STOP)
        self.assertIn("no command for", bridge.status)
        self.assertEqual(robot.drive(1.0), [])

    def test_does_not_check_against_a_scan_of_long_ago(self):
        guard = FakeDriver(step=0.1)
        bridge = GuardBridge(guard)
        robot = Robot(bridge)
        robot.drive(0.2)
        robot.drive(1.0, scan_of=None)
        bridge.on_command(1.5, 0.2, robot.now)
        self.assertEqual(set(robot.drive(0.5, scan_of=None)), {STOP})
        self.assertEqual(guard.asked, [])

    def test_stops_another_stack_that_sees_nothing(self):
        bridge = GuardBridge(FakeDriver(step=0.1), Settings(max_age=0.3))
        robot = Robot(bridge)
        for _ in range(10):
            bridge.on_command(1.0, 0.0, robot.now)
            outputs = robot.drive(0.1, scan_of=None if len(robot.sent) > 2 else scan)
        self.assertEqual(outputs[-1], STOP)
        self.assertIn("no scan for", bridge.status)
        self.assertEqual(bridge.on_command(math.nan, 0.0, robot.now), STOP)


if __name__ == "__main__":
    unittest.main(verbosity=1)
