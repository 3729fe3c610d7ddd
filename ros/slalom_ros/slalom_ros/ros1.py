"""What the nodes of ROS 1 share."""

from __future__ import annotations

import dataclasses
import math
import re
import threading
import time
import traceback
from typing import Any, Callable, NoReturn, Optional

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
from sensor_msgs.msg import LaserScan

from .bridge import STOP, Output, Refused, Settings
from .messages import fill_velocity, odometry_of, scan_of
from .nodes import Ending, leave, parameter_of


def declare(defaults: dict[str, Any]) -> dict[str, Any]:
    """Returns the node's private parameters; those that are not given have the defaults. Raises `Refused`."""
    return {name: parameter_of(name, rospy.get_param("~" + name, default), default) for name, default in defaults.items()}


def settings_of() -> Settings:
    """Returns the settings that the node's parameters give. A simulated clock may come steps after the scans that it stamps."""
    settings = Settings(**declare({field.name: field.default for field in dataclasses.fields(Settings)}))
    return dataclasses.replace(settings, max_ahead=math.inf) if rospy.get_param("/use_sim_time", False) else settings


def now() -> float:
    return rospy.get_time()


def wait_for_clock(stamp: float) -> float:
    """Waits, for a second at most, until a simulated clock that a new simulator has set back is there: in its own thread it may
    come after what it stamps. Returns the stamp, or that of no time where the clock is the machine's."""
    if rospy.rostime.is_wallclock():
        return -math.inf
    for _ in range(100):
        if abs(now() - stamp) < 1.0:
            break
        time.sleep(0.01)
    return stamp


class Inputs:
    """Hands scans, odometry and time to a bridge, and sends what it answers: the same for the driver and the guard."""

    def __init__(self, bridge: Any, period: float = 0.05):
        self.bridge, self._period = bridge, period
        self.lock = threading.RLock()  # rospy calls back in a thread for each topic.
        parameters = declare({"stamped": False, "robot_frame": "base_link"})
        self._stamped, self._robot_frame = parameters["stamped"], parameters["robot_frame"]
        self._said, self._ticks = "", 0
        self.on_sent: Callable[[], None] = lambda: None
        self._commands = rospy.Publisher("cmd_vel", TwistStamped if self._stamped else Twist, queue_size=10, tcp_nodelay=True)
        self._diagnostics = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=1)
        rospy.Subscriber("odom", OdometryMessage, self._on_odometry, queue_size=50, tcp_nodelay=True)
        rospy.Subscriber("scan", LaserScan, self._on_scan, queue_size=5, tcp_nodelay=True)

    def _on_scan(self, message):
        with self.lock:
            self.send(self.bridge.on_scan(scan_of(message), now()))

    def _on_odometry(self, message):
        try:
            odometry = odometry_of(message)
        except Refused as error:
            rospy.logerr_throttle(1.0, f"odom: {error}")
            return
        with self.lock:
            self.send(self.bridge.on_odometry(odometry, now()))

    def send(self, output: Optional[Output]) -> None:
        """Sends an answer of the bridge, if there is one."""
        said = re.sub(r"[\d.]+", "", self.bridge.status)
        if said != self._said:
            self._said = said
            (rospy.logwarn if self.bridge.is_stopped else rospy.loginfo)(self.bridge.status)
        if output is None:
            return
        message = TwistStamped() if self._stamped else Twist()
        if self._stamped:
            message.header.stamp = rospy.Time.from_sec(max(now(), self.bridge.scan_stamp))
            message.header.frame_id = self._robot_frame
        self._commands.publish(fill_velocity(message, output.linear, output.angular))
        self.on_sent()

    def tick(self) -> None:
        with self.lock:
            self.send(self.bridge.tick(now()))
            self._ticks += 1
            if self._ticks * self._period % 1.0 < self._period:
                level = DiagnosticStatus.WARN if self.bridge.is_stopped else DiagnosticStatus.OK
                message = DiagnosticArray(status=[DiagnosticStatus(level=level, name=rospy.get_name(), message=self.bridge.status)])
                message.header.stamp = rospy.Time.from_sec(now())
                self._diagnostics.publish(message)


def run(name: str, make_inputs: Callable[[], Inputs]) -> NoReturn:
    """Runs a node until SIGINT, SIGTERM or the master's word; stops the robot then, and ends the process."""
    rospy.init_node(name, disable_signals=True)
    ending = Ending()
    try:
        inputs = make_inputs()
    except ValueError as error:  # Bad input, of this package or of slalom.
        print(f"slalom_ros: {error}", flush=True)
        leave(1, lambda: rospy.signal_shutdown("bad input"))
    code = 0
    try:
        while not ending.is_told and not rospy.is_shutdown():
            inputs.tick()
            time.sleep(0.05)
    except Exception:
        traceback.print_exc()
        code = 1
    with inputs.lock:
        inputs.send(STOP)
    time.sleep(0.2)  # rospy does not tell when a message has arrived.
    leave(code, lambda: rospy.signal_shutdown("the end"))
