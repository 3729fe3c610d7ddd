"""The nodes of ROS 2, as processes, with real topics between them. The clock is simulated: a test moves it."""

import faulthandler
import math
import os
import signal
import tempfile
import unittest
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import rclpy
from bags import RecordingPort, driven_again
from geometry_msgs.msg import PoseStamped, Twist, TwistStamped
from in_process import score_in_process
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import Odometry
from node_process import NodeProcess, node_command
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import serialize_message
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from slalom_ros import ros2
from slalom_ros.bridge import Odometry as PlainOdometry
from slalom_ros.bridge import DriverBridge, Pose, Settings
from slalom_ros.messages import fill_odometry, fill_pose, fill_scan, seconds, velocity_of
from slalom_ros.simulated_robot import score
from std_msgs.msg import String

import slalom

POLICY = os.environ["SLALOM_POLICY"]
FIELD_OF_VIEW = 4.71238
FILES = ("episodes.csv", "tracks.jsonl")
TRIES = 300  # Of 0.1 s: no wait for another process is longer.


def text_of(value):
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


class Peer:
    """The other side of a node's topics: a robot without a simulator."""

    def __init__(self, test, stamped=False):
        self.node = rclpy.create_node("peer")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.commands, self.accepted, self.stamp = [], [], 100.0
        self.x = 0.0
        make = self.node.create_publisher
        self.clock = make(Clock, "/clock", ros2.SENSOR)
        self.scans = make(LaserScan, "scan", ros2.SENSOR)
        self.odometry = make(Odometry, "odom", ros2.RELIABLE)
        self.goals = make(PoseStamped, "goal_pose", ros2.RELIABLE)
        self.raw = make(Twist, "cmd_vel_raw", ros2.RELIABLE)
        subscribe = self.node.create_subscription
        subscribe(TwistStamped if stamped else Twist, "cmd_vel", lambda message: self.commands.append(velocity_of(message)), ros2.RELIABLE)
        subscribe(PoseStamped, "current_goal", lambda message: self.accepted.append(seconds(message.header.stamp)), ros2.LATCHED)
        test.addCleanup(self.node.destroy_node)
        test.addCleanup(self.executor.shutdown)

    def until(self, happened, what):
        for _ in range(TRIES):
            if happened():
                return
            self.executor.spin_once(timeout_sec=0.1)
        raise AssertionError(f"{what} did not happen")

    def connect(self, publisher):
        self.until(lambda: publisher.get_subscription_count() and self.node.count_publishers("cmd_vel"), "discovery")

    def step(self, scan=True, odometry=True, by=0.1, ranges=None):
        """A tenth of a second of the simulated clock."""
        self.stamp = round(self.stamp + by, 3)
        stamp = ros2.stamp_of(self.stamp)
        self.clock.publish(Clock(clock=stamp))
        if odometry:
            message = fill_odometry(Odometry(), PlainOdometry(self.stamp, Pose(self.x, 0.0, 0.0), 0.0, 0.0))
            message.header.stamp = stamp
            self.odometry.publish(message)
        if scan:
            message = fill_scan(LaserScan(), np.full(720, 4.0) if ranges is None else ranges, FIELD_OF_VIEW, 0.1, 30.0)
            message.header.stamp = stamp
            self.scans.publish(message)

    def steps_until(self, is_it, **step):
        """Steps on until a command is as expected: those of earlier steps may come in between. Returns it."""
        for _ in range(50):
            count = len(self.commands)
            self.step(**step)
            for _ in range(5):
                self.executor.spin_once(timeout_sec=0.05)
            for command in self.commands[count:]:
                if is_it(command):
                    return command
        raise AssertionError(f"no such command, with {step}; the last were {self.commands[-5:]}")

    def stops(self, **step):
        self.steps_until(lambda command: command == (0.0, 0.0), **step)

    def drives(self, **step):
        self.steps_until(lambda command: command != (0.0, 0.0), **step)

    def send_goal(self, x=5.0, y=0.0, frame="odom"):
        message = PoseStamped()
        self.stamp = round(self.stamp + 0.001, 3)
        message.header.stamp, message.header.frame_id = ros2.stamp_of(self.stamp), frame
        fill_pose(message.pose, x, y)
        for attempt in range(TRIES // 10):  # A node that was killed counts as there for a while.
            self.goals.publish(message)
            for _ in range(10):
                self.executor.spin_once(timeout_sec=0.1)
                if self.stamp in [round(stamp, 3) for stamp in self.accepted]:
                    return
        raise AssertionError("the goal was not accepted")


class Ros2Test(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rclpy.init()

    @classmethod
    def tearDownClass(cls):
        rclpy.shutdown()

    def start(self, node, **parameters):
        arguments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={text_of(value)}")]
        return NodeProcess(node_command(f"ros2_{node}", ["--ros-args", *arguments]), self.addCleanup)

    def start_driver(self, peer, **parameters):
        driver = self.start("driver", **{"agent": POLICY, "use_sim_time": True, **parameters})
        peer.connect(peer.goals)
        peer.connect(peer.scans)
        peer.step()
        return driver

    def score(self, parameters, evaluations=1, **driver):
        """Returns the episodes and the tracks of the last of some evaluations through topics, which one driver drives."""
        driving = self.start("driver", **{"agent": POLICY, "use_sim_time": True, "stamped": parameters.get("stamped", False), **driver})
        for _ in range(evaluations):
            with tempfile.TemporaryDirectory() as output:
                code, said = self.start("robot", **parameters, output=output).finish(120)
                self.assertEqual(code, 0, said)
                files = [Path(output, f"evaluation-{name}").read_text(encoding="utf8") for name in FILES]
        self.assertEqual(driving.interrupt(), 0)
        return files

    def same_as_in_process(self, files, agent, parameters, settings=Settings(), **driver):
        with tempfile.TemporaryDirectory() as output:
            score_in_process(agent, {**parameters, "output": output}, settings, **driver)
            for found, name in zip(files, FILES):
                self.assertEqual(found, Path(output, f"evaluation-{name}").read_text(encoding="utf8"))

    def test_a_policy_drives_through_topics_as_in_process(self):
        """Every pose, the second time, too: the last episode of the first time is not ended for the driver, and the clock goes
        back."""
        parameters = {"courses": "static-train-5", "time_limit": 4.0}
        self.same_as_in_process(self.score(parameters, evaluations=2), POLICY, parameters)

    def test_a_guarded_policy_with_stamped_commands(self):
        parameters = {"courses": "static-train-5", "time_limit": 10.0, "stamped": True}
        self.same_as_in_process(self.score(parameters, guard=True), POLICY, parameters, guard=True)

    def test_one_that_stops_before_the_goal_is_not_waited_for(self):
        parameters = {"courses": "static-train-5", "time_limit": 20.0}
        self.same_as_in_process(self.score(parameters, goal_tolerance=2.0), POLICY, parameters, Settings(goal_tolerance=2.0))

    def test_the_robot_is_reset_to_an_episode(self):
        statuses, node = [], rclpy.create_node("operator")
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        self.addCleanup(node.destroy_node)
        self.addCleanup(executor.shutdown)
        resets = node.create_publisher(String, "reset", ros2.RELIABLE)
        node.create_subscription(String, "/slalom_robot/status", lambda message: statuses.append(message.data), ros2.LATCHED)
        self.start("driver", agent=POLICY, use_sim_time=True)
        robot = self.start("robot", courses="static-train-5", episodes=20, client_timeout=60.0)
        for reset, expected in (("nowhere", "episodes 100, ended"), ("static-1-043 3", "course static-1-043, seed 4,"), ("2 0", "static-1-020, seed 1,")):
            for _ in range(TRIES):
                if statuses and expected in statuses[-1]:
                    break
                resets.publish(String(data=reset))
                executor.spin_once(timeout_sec=0.1)
            self.assertIn(expected, statuses[-1])
        self.assertEqual(robot.interrupt(), 130)

    def test_a_bag_gives_the_commands_again(self):
        types = SimpleNamespace(LaserScan=LaserScan, Odometry=Odometry, PoseStamped=PoseStamped, Twist=Twist, stamp_of=ros2.stamp_of)
        port = RecordingPort(slalom.Driver(POLICY), types)
        score(port, {"courses": "static-train-5", "time_limit": 5.0}, port.ready)
        store = get_typestore(Stores.ROS2_JAZZY)
        for storage in StoragePlugin:
            with self.subTest(storage=storage), tempfile.TemporaryDirectory() as folder:
                with Writer(Path(folder, "bag"), version=9, storage_plugin=storage) as bag:
                    connections = {}
                    for stamp, topic, message in port.messages:
                        if topic not in connections:
                            kind = type(message)
                            name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
                            connections[topic] = bag.add_connection(topic, name, typestore=store)
                        bag.write(connections[topic], round(stamp * 1e9), serialize_message(message))
                with Reader(Path(folder, "bag")) as bag:
                    messages = [(connection.topic, store.deserialize_cdr(data, connection.msgtype)) for connection, _, data in bag.messages()]
                recorded, found = driven_again(DriverBridge(slalom.Driver(POLICY)), messages)
                self.assertGreater(len(recorded), 50)
                self.assertEqual(found, recorded)

    def test_a_planner(self):
        parameters = {"courses": "generated:1:1", "step": 0.05, "range_clip": 30.0, "time_limit": 5.0,
                      "profile": f"[{os.path.join(os.path.dirname(__file__), 'planner_task.toml')}]"}
        files = self.score(parameters, agent="dwa", profile=parameters["profile"])
        parameters["profile"] = [parameters["profile"][1:-1]]
        self.same_as_in_process(files, "dwa", parameters, profile=parameters["profile"])

    def test_in_real_time_every_episode_ends(self):
        """Commands come when they come, so nothing is said of where the robot gets."""
        episodes, _ = self.score({"courses": "generated:1:2", "time_limit": 1.0, "lockstep": False})
        self.assertEqual(len(episodes.splitlines()), 3)

    def test_stops_and_drives_on(self):
        peer = Peer(self)
        self.start_driver(peer)
        peer.step()
        self.assertEqual(peer.commands, [], "there is no goal")
        peer.send_goal()
        peer.drives()
        for missing in ({"scan": False}, {"odometry": False}, {"ranges": np.full(720, math.nan)}):
            peer.stops(**missing)
            peer.drives()
        peer.stamp -= 5.0
        peer.stops()
        peer.drives()
        peer.send_goal(-5.0, 0.0)
        peer.drives()
        peer.send_goal(5.0, 0.0, "map")
        peer.stops()

    def test_drives_on_after_it_was_killed_and_stops_on_sigint(self):
        peer = Peer(self)
        driver = self.start_driver(peer)
        peer.send_goal()
        peer.drives()
        driver.kill()
        driver = self.start_driver(peer)
        count = len(peer.commands)
        peer.step()
        peer.executor.spin_once(timeout_sec=0.5)
        self.assertEqual(len(peer.commands), count, "it has no goal")
        peer.send_goal()
        peer.drives()
        driver.tell(signal.SIGINT)
        peer.until(lambda: peer.commands[-1] == (0.0, 0.0), "a stop")
        self.assertEqual(driver.finish(60)[0], 0)

    def test_is_a_lifecycle_node(self):
        peer = Peer(self)
        self.start_driver(peer)
        client = peer.node.create_client(ChangeState, "/slalom_driver/change_state")
        peer.until(client.service_is_ready, "the service")

        def change(transition):
            future = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
            peer.until(future.done, "the transition")
            self.assertTrue(future.result().success)

        peer.send_goal()
        peer.drives()
        change(Transition.TRANSITION_DEACTIVATE)
        peer.until(lambda: peer.commands[-1] == (0.0, 0.0), "a stop")
        change(Transition.TRANSITION_CLEANUP)
        change(Transition.TRANSITION_CONFIGURE)
        change(Transition.TRANSITION_ACTIVATE)
        peer.connect(peer.goals)
        peer.connect(peer.scans)
        peer.send_goal()
        peer.drives()

    def test_a_goal_from_the_start(self):
        peer = Peer(self)
        self.start_driver(peer, goal_x=5, goal_y=0)
        peer.drives()

    def test_the_guard_slows_another_stack(self):
        peer = Peer(self)
        guard = self.start("guard", use_sim_time=True)
        peer.connect(peer.raw)
        peer.connect(peer.scans)

        def raw(is_it, ranges):
            """Commands 1.5 m/s until the guard answers so."""
            message = Twist()
            message.linear.x = 1.5
            timer = peer.node.create_timer(0.05, lambda: peer.raw.publish(message))
            peer.steps_until(lambda command: is_it(command[0]), ranges=ranges, by=0.2)
            peer.node.destroy_timer(timer)

        raw(lambda speed: abs(speed - 1.5) < 1e-6, np.full(720, 4.0))
        raw(lambda speed: speed < 0.75, np.full(720, 0.35))
        peer.stops(by=0.2)  # The other stack is silent now.
        guard.tell(signal.SIGTERM)
        self.assertEqual(guard.finish(60)[0], 0)

    def test_says_what_is_wrong(self):
        for node, parameters, expected in (
                ("driver", {}, "agent is '', expected a policy's file, or one of dwa"),
                ("driver", {"agent": POLICY, "max_speed": "fast"}, "max_speed is 'fast', expected a number"),
                ("guard", {"profile": "nowhere.toml"}, "nowhere.toml"),
                ("robot", {"lockstep": "maybe"}, "lockstep is 'maybe', expected true or false"),
                ("robot", {"client_timeout": 1.0}, "found no node that reads scan")):
            with self.subTest(node=node, expected=expected):
                code, said = self.start(node, **parameters).finish(60)
                self.assertEqual(code, 1)
                self.assertIn(expected, said)


if __name__ == "__main__":
    faulthandler.dump_traceback_later(480, exit=True)
    unittest.main(verbosity=1)
