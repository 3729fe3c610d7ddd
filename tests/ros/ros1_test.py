"""The nodes of ROS 1, as processes, with a master and real topics between them."""

import faulthandler
import os
import tempfile
import time
import unittest
from pathlib import Path
from types import SimpleNamespace

import rosgraph
import rospy
import slalom
from bags import RecordingPort, driven_again
from geometry_msgs.msg import PoseStamped, Twist
from in_process import score_in_process
from nav_msgs.msg import Odometry
from node_process import NodeProcess, node_command
from rosbag import Bag
from rospy import Time
from sensor_msgs.msg import LaserScan
from slalom_ros.bridge import DriverBridge
from slalom_ros.simulated_robot import score
from std_msgs.msg import String

POLICY = os.environ["SLALOM_POLICY"]


def setUpModule():
    """Starts a master, whose nodes have a simulated clock."""
    port = os.environ["ROS_MASTER_URI"].rpartition(":")[2]
    master = NodeProcess(["rosmaster", "--core", "-p", port], unittest.addModuleCleanup)
    for _ in range(300):
        try:
            rosgraph.Master("/test").setParam("/use_sim_time", True)
            break
        except ConnectionRefusedError:
            time.sleep(0.1)
        if not master.is_alive:
            break
    else:
        raise AssertionError("no master")
    unittest.addModuleCleanup(rospy.signal_shutdown, "the end")


class Ros1Test(unittest.TestCase):
    def setUp(self):
        self.forget_parameters()

    def forget_parameters(self):
        """They stay with the master, whoever set them."""
        master = rosgraph.Master("/test")
        for name in "/slalom_robot", "/slalom_driver", "/slalom_guard":
            if master.hasParam(name):
                master.deleteParam(name)

    def start(self, node, remapped={}, **parameters):
        arguments = [f"_{name}:={value}" for name, value in parameters.items()] + [f"{name}:={topic}" for name, topic in remapped.items()]
        return NodeProcess(node_command(f"ros1_{node}", arguments), self.addCleanup)

    def score(self, parameters, evaluations=1, **driver):
        """The robot drives the same episodes through topics, to the last bit, as without them, in the last of some evaluations
        that one driver drives."""
        with tempfile.TemporaryDirectory() as folder:
            through, direct = os.path.join(folder, "through"), os.path.join(folder, "direct")
            driving = self.start("driver", agent=POLICY, stamped=parameters.get("stamped", False), **driver)
            for _ in range(evaluations):
                code, said = self.start("robot", output=through, force=True, **parameters).finish(120)
                self.assertEqual(code, 0, said)
            self.assertEqual(driving.interrupt(), 0)
            score_in_process(POLICY, {**parameters, "output": direct}, **driver)
            for name in "episodes.csv", "tracks.jsonl":
                found, expected = (Path(path, f"evaluation-{name}").read_text(encoding="utf8") for path in (through, direct))
                self.assertEqual(found, expected)

    def test_a_policy_drives_through_topics_as_in_process(self):
        """The second time, too: the last episode of the first time is not ended for the driver, and the clock goes back."""
        self.score({"courses": "static-train-5", "time_limit": 4.0}, evaluations=2)

    def test_a_guarded_policy_with_stamped_commands(self):
        self.score({"courses": "static-train-5", "time_limit": 10.0, "stamped": True}, guard=True)

    def test_a_bag_gives_the_commands_again(self):
        types = SimpleNamespace(LaserScan=LaserScan, Odometry=Odometry, PoseStamped=PoseStamped, Twist=Twist, stamp_of=Time.from_sec)
        port = RecordingPort(slalom.Driver(POLICY), types)
        score(port, {"courses": "static-train-5", "time_limit": 5.0}, port.ready)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "drive.bag")
            with Bag(path, "w") as bag:
                for stamp, topic, message in port.messages:
                    bag.write(topic, message, Time.from_sec(stamp))
            with Bag(path) as bag:
                messages = [(topic, message) for topic, message, _ in bag.read_messages()]
        recorded, found = driven_again(DriverBridge(slalom.Driver(POLICY)), messages)
        self.assertGreater(len(recorded), 50)
        self.assertEqual(found, recorded)

    def test_the_robot_is_reset_to_an_episode(self):
        rospy.init_node("operator", disable_signals=True)
        statuses, resets = [], rospy.Publisher("reset", String, queue_size=1)
        rospy.Subscriber("/slalom_robot/status", String, lambda message: statuses.append(message.data))
        self.start("driver", agent=POLICY)
        robot = self.start("robot", courses="static-train-5", episodes=20, client_timeout=60.0)
        for reset, expected in (("nowhere", "episodes 100, ended"), ("static-1-043 3", "course static-1-043, seed 4,"),
                                ("2 0", "course static-1-020, seed 1,")):
            for _ in range(300):
                if statuses and expected in statuses[-1]:
                    break
                resets.publish(reset)
                time.sleep(0.1)
            self.assertIn(expected, statuses[-1])
        self.assertEqual(robot.interrupt(), 130)

    def launch(self, file, **arguments):
        ros = os.path.join(os.path.dirname(__file__), "../../ros")
        environment = {**os.environ, "ROS_PACKAGE_PATH": ros, "PATH": f"/usr/bin:{os.environ['PATH']}"}  # Debian's Python.
        command = ["roslaunch", "slalom_ros", file, *(f"{name}:={value}" for name, value in arguments.items())]
        return NodeProcess(command, self.addCleanup, environment)

    def test_launch_files_drive(self):
        """The Challenge's is told a goal relative to the start, and not the robot's: it is about 10 m ahead. Not every policy gets
        there."""
        challenge = {"scan": "/front/scan", "odom": "/odometry/filtered", "goal_pose": "/untold", "current_goal": "/untold_either"}
        for file, arguments, topics in (("drive.launch", {"guard": "false", "scan": "/front/scan"}, {"scan": "/front/scan"}),
                                        ("barn.launch", {"goal_x": 10, "goal_y": 0}, challenge)):
            with self.subTest(file=file):
                driving = self.launch(file, agent=POLICY, **arguments)
                code, said = self.start("robot", remapped=topics, courses="generated:1:1").finish(120)
                self.assertEqual(code, 0, said)
                driving.interrupt()
                self.assertRegex(driving.said(), r"drives, (9\.[5-9]|10\.[0-5]) m to go")

    def test_a_launch_file_scores(self):
        with tempfile.TemporaryDirectory() as output:
            self.start("driver", agent=POLICY)
            self.launch("score.launch", courses="generated:1:1", output=output).finish(120)
            self.assertEqual(len(Path(output, "evaluation-episodes.csv").read_text(encoding="utf8").splitlines()), 2)

    def test_says_what_is_wrong(self):
        for node, parameters, expected in (
                ("driver", {}, "agent is '', expected a policy's file, or one of dwa"),
                ("guard", {"profile": "nowhere.toml", "max_age": 1}, "nowhere.toml"),
                ("robot", {"lockstep": "maybe"}, "lockstep is 'maybe', expected true or false"),
                ("robot", {"client_timeout": 1.0}, "found no node that reads scan")):
            with self.subTest(node=node):
                self.forget_parameters()
                code, said = self.start(node, **parameters).finish(60)
                self.assertEqual(code, 1)
                self.assertIn(expected, said)


if __name__ == "__main__":
    faulthandler.dump_traceback_later(480, exit=True)
    unittest.main(verbosity=1)
