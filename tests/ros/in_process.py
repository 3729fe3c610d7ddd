"""A robot and its driver without topics between them: what a closed loop through topics must be equal to."""

import slalom
from slalom_ros.bridge import STOP, DriverBridge, Goal, Scan, Settings
from slalom_ros.simulated_robot import score


class DirectPort:
    def __init__(self, driver, settings=Settings()):
        self.bridge = DriverBridge(driver, settings)
        self.ended = []

    def ready(self, robot):
        self.robot = robot

    def begin(self, stamp, goal, status):
        self.bridge.on_goal(Goal(*goal), stamp, stamp)

    def ask(self, sensed, step):
        view, count = self.robot.lidar["field_of_view"], len(sensed.ranges)
        answers = (self.bridge.on_odometry(sensed.odometry, sensed.stamp),
                   self.bridge.on_scan(Scan(sensed.stamp, -view / 2, view / (count - 1), sensed.ranges), sensed.stamp))
        output = answers[0] or answers[1] or STOP  # One that has arrived, as it believes, is silent.
        return output.linear, output.angular

    def end(self, collided, status):
        self.ended.append((collided, status))


def score_in_process(agent, parameters, settings=Settings(), **driver):
    """Returns the evaluation of an agent that drives through the bridge, and the port."""
    port = DirectPort(slalom.Driver(agent, **driver), settings)
    return score(port, parameters, port.ready), port
