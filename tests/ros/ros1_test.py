"""The nodes of ROS 1, as processes, with a master and real topics between them."""

import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rosgraph
from in_process import score_in_process

POLICY = os.environ["SLALOM_POLICY"]


class Ros1Test(unittest.TestCase):
    def setUp(self):
        """Parameters stay with the master, whoever set them."""
        master = rosgraph.Master("/test")
        for name in "/slalom_robot", "/slalom_driver", "/slalom_guard":
            if master.hasParam(name):
                master.deleteParam(name)

    def start(self, node, **parameters):
        arguments = [f"_{name}:={value}" for name, value in parameters.items()]
        process = subprocess.Popen([sys.executable, "-m", f"slalom_ros.ros1_{node}", *arguments], stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL, text=True)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.send_signal, signal.SIGINT)
        return process

    def score(self, parameters, **driver):
        """The robot drives the same episodes through topics, to the last bit, as without them."""
        with tempfile.TemporaryDirectory() as folder:
            through, direct = os.path.join(folder, "through"), os.path.join(folder, "direct")
            robot = self.start("robot", output=through, **parameters)
            driving = self.start("driver", agent=POLICY, stamped=parameters.get("stamped", False), **driver)
            said, _ = robot.communicate(timeout=400)
            self.assertEqual(robot.returncode, 0, said)
            driving.send_signal(signal.SIGINT)
            self.assertEqual(driving.wait(30), 0)
            score_in_process(POLICY, {**parameters, "output": direct}, **driver)
            for name in "episodes.csv", "tracks.jsonl":
                found, expected = (Path(path, f"evaluation-{name}").read_text(encoding="utf8") for path in (through, direct))
                self.assertEqual(found, expected)

    def test_a_policy_drives_through_topics_as_in_process(self):
        self.score({"courses": "static-train-50", "time_limit": 20.0})

    def test_a_guarded_policy_with_stamped_commands(self):
        self.score({"courses": "static-train-5", "time_limit": 20.0, "stamped": True}, guard=True)

    def test_says_what_is_wrong(self):
        for node, parameters, expected in (
                ("driver", {}, "agent is '', expected a policy's file, or one of dwa"),
                ("guard", {"profile": "nowhere.toml"}, "nowhere.toml"),
                ("robot", {"client_timeout": 1.0}, "found no node that reads scan")):
            with self.subTest(node=node):
                process = self.start(node, **parameters)
                said, _ = process.communicate(timeout=60)
                self.assertEqual(process.returncode, 1)
                self.assertIn(expected, said)


if __name__ == "__main__":
    unittest.main(verbosity=1)
