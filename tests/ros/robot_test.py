"""The simulator as a robot, without ROS."""

import math
import os
import signal
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import slalom
from in_process import DirectPort, score_in_process
from slalom_ros.bridge import Refused, Settings
from slalom_ros.nodes import Ending, parameter_of
from slalom_ros.simulated_robot import Commands, Reset, SimulatedRobot, reset_of, score

POLICY = os.environ["SLALOM_POLICY"]
SHORT = {"courses": "static-train-50", "time_limit": 20.0}


class ScoreTest(unittest.TestCase):
    def test_a_policy_drives_through_the_bridge_as_without_it(self):
        """The goal of the bridge is a float32 that is kept, so a drive may differ in its last bits, and one in fifty in its end."""
        found, port = score_in_process(POLICY, SHORT)
        expected = slalom.evaluate(slalom.Policy(POLICY), "static-train-50", episodes=1, evaluation={"time_limit": 20.0})
        pairs = list(zip(found.episodes(), expected.episodes()))
        self.assertEqual([a["seed"] for a, _ in pairs], [b["seed"] for _, b in pairs])
        self.assertGreaterEqual(sum(a["outcome"] == b["outcome"] for a, b in pairs), 47)
        self.assertGreater(found.success_rate, 0.2)
        self.assertEqual(len(port.ended), 50)
        self.assertEqual(sum(collided for collided, _ in port.ended), sum(a["collisions"] > 0 for a, _ in pairs))
        self.assertEqual(port.ended[-1][1]["successes"], round(50 * found.success_rate))

    def test_a_guarded_planner_with_a_profile(self):
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
            file.write("[environment.robot]\ncontrol_rate = 100.0\n[guard]\nshield = true\n")
            file.flush()
            parameters = {"courses": "generated:1:2", "step": 0.05, "range_clip": 30.0, "profile": [file.name], "time_limit": 15.0}
            found, _ = score_in_process("dwa", parameters, profile=file.name)
        self.assertEqual([each["outcome"] for each in found.episodes()].count("collision"), 0)
        self.assertGreater(min(each["path_length_m"] for each in found.episodes()), 2.0)

    def test_a_limit_is_kept(self):
        found, _ = score_in_process(POLICY, {**SHORT, "courses": "static-train-5"}, Settings(max_speed=0.4))
        for episode in found.episodes():
            self.assertLess(episode["path_length_m"], 0.45 * episode["time_s"])

    def test_writes_what_reports_read_and_replaces_nothing_unasked(self):
        with tempfile.TemporaryDirectory() as folder:
            parameters = {**SHORT, "courses": "static-train-5", "output": os.path.join(folder, "mine"), "name": "my stack"}
            score_in_process(POLICY, parameters)
            self.assertIn("| my stack |", slalom.report([parameters["output"]], os.path.join(folder, "report")))
            with self.assertRaisesRegex(slalom.Error, "mine: holds an evaluation already"):
                score_in_process(POLICY, parameters)
            score_in_process(POLICY, {**parameters, "force": True})


class ResetTest(unittest.TestCase):
    def test_an_episode_is_the_same_whenever_it_is_driven(self):
        """The evaluation is left in its second step; the fourth reset ends the test in its first."""
        resets = [Reset("static-1-043", 3), Reset("static-1-020", 0), Reset("static-1-043", 3), KeyboardInterrupt()]
        driven = []

        class Port(DirectPort):
            def begin(self, stamp, goal, status):
                driven.append([goal])
                super().begin(stamp, goal, status)

            def ask(self, sensed, step):
                driven[-1].append((sensed.odometry.pose, sensed.odometry.linear, sensed.odometry.angular, sensed.ranges.tolist()))
                if len(driven[-1]) == (3 if len(driven) == 1 else 12):
                    raise resets.pop(0)
                return super().ask(sensed, step)

        port = Port(slalom.Driver(POLICY))
        with self.assertRaises(KeyboardInterrupt):
            score(port, {"courses": "static-train-5"}, port.ready)
        self.assertEqual([len(episode) for episode in driven], [3, 12, 12, 12])
        self.assertEqual(driven[1], driven[3])
        self.assertNotEqual(driven[1], driven[2])
        pose, linear, angular, _ = driven[1][-1]
        np.testing.assert_allclose((*driven[1][1][0], *driven[1][1][1:3]), np.zeros(5), atol=1e-6)
        self.assertGreater(math.hypot(pose.x, pose.y), 0.5)
        before = driven[1][-2][0]
        self.assertAlmostEqual(math.hypot(pose.x - before.x, pose.y - before.y), 0.2 * abs(linear), delta=0.1)

    def test_goes_on_with_the_next_episode(self):
        ended = []

        class Port(DirectPort):
            def ask(self, sensed, step):
                if sensed.stamp < 2.0:
                    raise Reset("static-1-043", 3)
                return super().ask(sensed, step)

            def end(self, collided, status):
                ended.append((collided, dict(status)))
                if len(ended) == 2:
                    raise KeyboardInterrupt

        port = Port(slalom.Driver(POLICY))
        with self.assertRaises(KeyboardInterrupt):
            score(port, {"courses": "static-train-5"}, port.ready)
        self.assertEqual([status["ended"] for _, status in ended], [1, 2])
        for collided, status in ended[:1]:
            self.assertEqual(collided, status["collisions"] == 1)

    def test_refuses_what_names_no_episode(self):
        self.assertEqual(vars(reset_of("1 7", ["a", "b"])), {"course": "b", "episode": 7})
        self.assertEqual(vars(reset_of(" a", ["a", "b"])), {"course": "a", "episode": 0})
        for text in "", "c", "2", "a x", "a -1":
            with self.assertRaisesRegex(Refused, f"reset is '{text}', expected a course, from 0 to 1 or by its name such as a"):
                reset_of(text, ["a", "b"])


class ProfilesTest(unittest.TestCase):
    def test_each_robot_is_one_that_a_guard_knows(self):
        for name in "husky", "jackal", "turtlebot3":
            guard = slalom.Guard(profile=os.path.join(os.path.dirname(__file__), f"../../configs/robots/{name}.toml"))
            far, near = (guard.check(np.full(720, ranges), (1.5, 0.0), pose=(0, 0, 0), speeds=(0, 0), first=True) for ranges in (5.0, 0.1))
            self.assertEqual((far.guarded, near.guarded), (False, True), name)


class SimulatedRobotTest(unittest.TestCase):
    def test_clips_commands_and_stands_still_for_others(self):
        task = {"episode": {"step": 0.2}, "action": {"linear_min": -1.0, "linear_max": 2.0, "angular_max": 3.14},
                "lidar": {"max_range": 30.0}, "observation": {"range_clip": 5.0, "commands": 1}}
        robot = SimulatedRobot(None, task)
        np.testing.assert_allclose(robot.action(0.5, 1.57), (0.0, 0.5))
        self.assertEqual(robot.action(9.0, -9.0), (1.0, -1.0))
        np.testing.assert_allclose(robot.action(math.nan, 1.0), (-1 / 3, 0.0))


class CommandsTest(unittest.TestCase):
    def setUp(self):
        self.now = 0.0

    def clock(self):
        self.now += 0.25
        return self.now

    def test_in_lockstep_an_older_command_is_no_answer(self):
        published = []
        commands = Commands(True, 1.0, 0.5, self.clock)
        commands.give(1.0, 0.0)
        commands.expect(7.0)
        commands.give(2.0, 0.0, stamp=6.8)
        with self.assertRaisesRegex(TimeoutError, "found no cmd_vel after the scan with stamp 7 within 1 s"):
            commands.take(7.0, 0.2, lambda: published.append(7.0))
        commands.give(3.0, 0.5, stamp=7.0)
        self.assertEqual(commands.take(7.0, 0.2, lambda: published.append(7.0)), (3.0, 0.5))
        with self.assertRaisesRegex(TimeoutError, "current_goal with stamp 8"):
            commands.begin(8.0, lambda: published.append(8.0), knows_goal=True)
        self.assertEqual(published, [7.0, 7.0, 8.0])
        commands.on_current_goal(8.0, "odom")
        commands.begin(8.0, lambda: published.append(8.0), knows_goal=True)

    def test_who_has_arrived_is_not_waited_for(self):
        commands = Commands(True, 1.0, 0.5, self.clock)
        commands.expect(7.0)
        commands.on_current_goal(0.0, "")
        for _ in range(3):
            self.assertEqual(commands.take(7.0, 0.2, lambda: None), (0.0, 0.0))
        commands.give(1.0, 0.0)
        self.assertEqual(commands.take(7.0, 0.2, lambda: None), (1.0, 0.0))
        commands.begin(8.0, lambda: None, knows_goal=False)
        commands.expect(8.0)
        with self.assertRaisesRegex(TimeoutError, "stamp 8"):
            commands.take(8.0, 0.2, lambda: None)

    def test_a_second_answer_to_a_scan_that_was_sent_twice_is_dropped(self):
        """A slow client answers both, 10.5 and 11 s after the first."""
        answers = [10.5, 11.0, 13.0]

        def clock():
            now = self.clock()
            if answers and now > answers[0]:
                commands.give(answers.pop(0), 0.0)
            return now

        commands, published = Commands(True, 30.0, 0.5, clock), []
        for stamp, expected in (7.0, 10.5), (7.2, 13.0):
            commands.expect(stamp)
            self.assertEqual(commands.take(stamp, 0.2, lambda: published.append(stamp)), (expected, 0.0))
        self.assertEqual(published, [7.0, 7.0, 7.2])
        self.assertEqual((commands.num_commands, commands.num_late), (2, 2))

    def test_a_reset_is_raised_where_a_command_is_waited_for(self):
        for lockstep in True, False:
            commands = Commands(lockstep, 1.0, 0.5, self.clock)
            commands.reset(Reset("a", 1))
            commands.expect(7.0)
            with self.assertRaises(Reset):
                commands.take(7.0, 0.2, lambda: None)
            commands.give(1.0, 0.0)
            self.assertEqual(commands.take(7.0, 0.2, lambda: None), (1.0, 0.0))

    def test_in_real_time_the_robot_stops_without_commands(self):
        commands = Commands(False, 1.0, 0.5, self.clock)
        self.assertEqual(commands.take(1.0, 0.001, lambda: None), (0.0, 0.0))
        commands.give(1.5, 0.2)
        self.assertEqual(commands.take(1.2, 0.001, lambda: None), (1.5, 0.2))
        self.assertEqual(commands.take(1.4, 0.001, lambda: None), (0.0, 0.0))
        self.assertEqual(commands.counts(), {"commands": 3, "late": 3})

    def test_a_signal_may_come_in_every_line_of_a_wait(self):
        for number in signal.SIGINT, signal.SIGTERM:
            self.addCleanup(signal.signal, number, signal.getsignal(number))
        for lockstep in True, False:
            for line in range(1, 100):
                ending = Ending()
                commands = Commands(lockstep, 1.0, 0.5, self.clock, lambda: ending.is_told)
                left = line

                def trace(frame, event, argument):
                    nonlocal left
                    left -= 1
                    if left == 0:
                        signal.raise_signal(signal.SIGTERM)
                        signal.raise_signal(signal.SIGINT)
                    return trace

                sys.settrace(trace)
                try:
                    with self.assertRaises(KeyboardInterrupt):
                        for _ in range(100):
                            commands.take(7.0, 0.001, lambda: commands.give(1.0, 0.0))
                finally:
                    sys.settrace(None)


class ParameterTest(unittest.TestCase):
    def test_has_the_kind_of_its_default(self):
        for value, default, expected in ((1, 0.5, 1.0), ("inf", 0.5, math.inf), ("0.25", 0.5, 0.25), (2.0, 1, 2), (7, "ROS", "7"), (True, False, True),
                                         ("a.toml b.toml", [], ["a.toml", "b.toml"]), (["a.toml", ""], [], ["a.toml"]), ("", [], [])):
            found = parameter_of("it", value, default)
            self.assertEqual((found, type(found)), (expected, type(expected)))
        self.assertTrue(math.isnan(parameter_of("it", math.nan, 0.5)))
        for value, default, expected in (("fast", 0.5, "it is 'fast', expected a number"), (True, 0.5, "it is True, expected a number"),
                                         (1.5, 1, "it is 1.5, expected an integer"), (math.inf, 1, "expected an integer"),
                                         ("yes", False, "it is 'yes', expected true or false"), ([], 0.5, "expected a number")):
            with self.assertRaisesRegex(Refused, expected):
                parameter_of("it", value, default)


class LeaveTest(unittest.TestCase):
    def test_a_process_ends_whatever_waits_without_end(self):
        program = "import threading; from slalom_ros.nodes import leave; print('said'); leave(3, threading.Event().wait)"
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
        self.assertEqual((done.returncode, done.stdout), (3, "said\n"))


if __name__ == "__main__":
    unittest.main(verbosity=1)
