"""A robot outside the simulator, driven by Python, drives as inside it."""

import os
import unittest

import numpy as np

import slalom

COURSES = "static-train-5"
POLICY = os.environ.get("SLALOM_POLICY")
FIELDS = ("course", "outcome", "steps", "path_length_m", "interventions")


def one_by_one(answer):
    """An agent of one robot that is given what a real one would know: `answer(ranges, goal, pose, speeds, first)`."""
    def drive(observations, first):
        ranges = observations["ranges"][0] / 100
        x, y, yaw, linear, angular = observations["odometry"][0]
        return np.array([answer(ranges, observations["state"][0, :2], (x, y, yaw), (linear, angular), bool(first[0])).action])
    return drive


def score(agent, courses=COURSES, **settings):
    settings.setdefault("evaluation", {})["num_environments"] = 1
    return slalom.evaluate(agent, courses, episodes=1, **settings)


class DriverTest(unittest.TestCase):
    def same(self, found, expected, fields=FIELDS):
        self.assertEqual([[episode[field] for field in fields] for episode in found.episodes()],
                         [[episode[field] for field in fields] for episode in expected.episodes()])

    def drive(self, driver, **settings):
        guarded = []

        def answer(ranges, goal, pose, speeds, first):
            command = driver.act(ranges, goal, pose=pose, speeds=speeds, first=first)
            guarded.append(command.guarded)
            return command

        return score(one_by_one(answer), **settings), sum(guarded)

    @unittest.skipUnless(POLICY, "SLALOM_POLICY names no policy")
    def test_a_policy_drives_as_inside(self):
        found, guarded = self.drive(slalom.Driver(POLICY))
        self.same(found, score(slalom.Policy(POLICY)))
        self.assertEqual(guarded, 0)

    @unittest.skipUnless(POLICY, "SLALOM_POLICY names no policy")
    def test_a_guarded_policy_drives_as_inside(self):
        guard = {"shield": True, "waypoints": True, "margin": 0.3}
        found, guarded = self.drive(slalom.Driver(POLICY, guard=guard))
        expected = score(slalom.Policy(POLICY), guard=guard)
        self.same(found, expected, FIELDS[:-1])
        self.assertEqual(guarded, sum(episode["interventions"] for episode in expected.episodes()))
        self.assertGreater(guarded, 0)

    @unittest.skipUnless(POLICY, "SLALOM_POLICY names no policy")
    def test_a_policy_that_matches_scans_drives_as_inside(self):
        task = {"localisation": {"position_drift": 0.05, "heading_drift": 0.01}}
        driver, moved = slalom.Driver(POLICY, guard={"scan_matching": True}), []

        def answer(ranges, goal, pose, speeds, first):
            command = driver.act(ranges, goal, pose=pose, speeds=speeds, first=first)
            moved.append(np.hypot(*np.subtract(command.pose, pose)[:2]))
            return command

        self.same(score(one_by_one(answer), **task), score(slalom.Policy(POLICY), guard={"scan_matching": True}, **task))
        self.assertGreater(max(moved), 0.01)

    def test_a_planner_drives_as_inside(self):
        rules = {"courses": "generated:1:2", "evaluation": {"time_limit": 15.0}}
        task = {"episode": {"step": 0.05}, "robot": {"control_rate": 100.0}, "observation": {"range_clip": 30.0},
                "localisation": {"from_wheels": True}}
        found, _ = self.drive(slalom.Driver("dwa"), **rules, **task)
        self.same(found, score("dwa", **rules))

    def test_a_guard_alone_changes_what_it_would_change_inside(self):
        guard = slalom.Guard(profile=os.path.join(os.path.dirname(__file__), "../../../configs/guarded.toml"))
        guarded = []

        def answer(ranges, goal, pose, speeds, first):
            command = guard.check(ranges, (1.5, 0.0), pose=pose, speeds=speeds, first=first)
            guarded.append(command.guarded)
            return command

        rules = {"evaluation": {"time_limit": 10.0}}
        ahead = 2 * 2.5 / 3 - 1  # The action of 1.5 m/s.
        expected = score(lambda seen, first: np.tile([ahead, 0.0], (len(first), 1)), guard={"shield": True}, **rules)
        self.same(score(one_by_one(answer), **rules), expected, FIELDS[:-1])
        self.assertEqual(sum(guarded), sum(episode["interventions"] for episode in expected.episodes()))
        self.assertGreater(sum(guarded), 0)

    def test_says_what_the_robot_must_send(self):
        self.assertEqual(slalom.Guard().needs["keys"], ["command", "pose", "ranges", "speeds"])
        driver = slalom.Driver("dwa", lidar={"num_beams": 360})
        self.assertEqual(driver.needs["num_beams"], 360)
        self.assertEqual(driver.step, 0.05)

    def test_names_what_is_wrong(self):
        with self.assertRaisesRegex(slalom.Error, "nowhere.safetensors: there is no such file, expected a policy's or a planner"):
            slalom.Driver("nowhere.safetensors")
        with self.assertRaisesRegex(slalom.Error, "guard.shield: found false"):
            slalom.Guard(guard={"shield": False})
        with self.assertRaisesRegex(slalom.Error, "lidar.num_beam"):
            slalom.Guard(lidar={"num_beam": 3})
        guard = slalom.Guard(lidar={"num_beams": 3})
        with self.assertRaisesRegex(slalom.Error, "ranges: found 2 numbers, expected 3"):
            guard.check([1.0, 2.0], (0.5, 0.0), pose=(0, 0, 0), speeds=(0, 0))
        with self.assertRaisesRegex(slalom.Error, r"command\[1\]: found NaN, expected a number"):
            guard.check([1.0, 2.0, np.nan], (0.5, np.nan), pose=(0, 0, 0), speeds=(0, 0))
        with self.assertRaisesRegex(slalom.Error, "unknown key 'environment.robot.speed'"):
            slalom.Driver("dwa", robot={"speed": 3})


class ProgressTest(unittest.TestCase):
    def test_counts_the_episodes_that_ended(self):
        seen = []
        slalom.evaluate(lambda seen, first: np.tile([1.0, 0.0], (len(first), 1)), COURSES, episodes=1,
                        evaluation={"time_limit": 10.0}, progress=seen.append)
        self.assertEqual({count["episodes"] for count in seen}, {5})
        self.assertEqual(seen[-1]["ended"], 5)
        self.assertEqual([count["ended"] for count in seen], sorted(count["ended"] for count in seen))
        self.assertGreater(seen[-1]["collisions"], 0)

        def stop(count):
            raise KeyError("enough")

        with self.assertRaisesRegex(KeyError, "enough"):
            slalom.evaluate("oracle", "generated:1:2", episodes=1, progress=stop)


if __name__ == "__main__":
    unittest.main(verbosity=1)
