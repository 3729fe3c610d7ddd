"""What the nodes of ROS 2 share."""

from __future__ import annotations

import dataclasses
import math
import re
import traceback
from typing import Any, Callable, NoReturn, Optional

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import LaserScan

from .bridge import STOP, Output, Refused, Settings
from .messages import fill_velocity, odometry_of, scan_of
from .nodes import Ending, leave, parameter_of

try:
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None
if not hasattr(TFMessage, "get_fields_and_field_types"):  # ROS 1's on the same machine.
    TFMessage = None  # Not among the wheels of PyPI; every other ROS 2 has it.

SENSOR = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE,
                    history=HistoryPolicy.KEEP_LAST, depth=5)
RELIABLE = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.VOLATILE,
                      history=HistoryPolicy.KEEP_LAST, depth=10)
LATCHED = QoSProfile(reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL,
                     history=HistoryPolicy.KEEP_LAST, depth=1)


def stamp_of(seconds: float) -> Time:
    """Returns a stamp, to the nearest nanosecond."""
    whole, nanoseconds = divmod(round(seconds * 1e9), 10**9)
    return Time(sec=whole, nanosec=nanoseconds)


def now_of(node: Any) -> float:
    return 1e-9 * node.get_clock().now().nanoseconds


def declare(node: Any, defaults: dict[str, Any]) -> dict[str, Any]:
    """Returns the node's parameters; those that are not given have the defaults. Raises `Refused`."""
    for name, default in defaults.items():
        if not node.has_parameter(name):
            # An empty list is one of texts. Of another type a number without a fraction, such as 1, would be refused.
            node.declare_parameter(name, default if default != [] else [""], ParameterDescriptor(dynamic_typing=True))
    return {name: parameter_of(name, node.get_parameter(name).value, default) for name, default in defaults.items()}


def settings_of(node: Any) -> Settings:
    """Returns the settings that the node's parameters give. A simulated clock may come steps after the scans that it stamps."""
    settings = Settings(**declare(node, {field.name: field.default for field in dataclasses.fields(Settings)}))
    return dataclasses.replace(settings, max_ahead=math.inf) if node.get_parameter("use_sim_time").value else settings


class Inputs:
    """Hands scans, odometry and time to a bridge, and sends what it answers: the same for the driver and the guard."""

    def __init__(self, node: Any, bridge: Any, frequency: float = 20.0):
        self._node, self._bridge = node, bridge
        self.is_active = True
        parameters = declare(node, {"stamped": False, "robot_frame": "base_link"})
        self._stamped, self._robot_frame = parameters["stamped"], parameters["robot_frame"]
        self._commands = node.create_publisher(TwistStamped if self._stamped else Twist, "cmd_vel", RELIABLE)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", RELIABLE)
        self._said = ""
        self.on_sent: Callable[[Output], None] = lambda output: None
        self._made = [
            node.create_subscription(LaserScan, "scan", self._on_scan, SENSOR),
            node.create_subscription(OdometryMessage, "odom", self._on_odometry, SENSOR),
            node.create_timer(1.0 / frequency, self._on_tick),
            node.create_timer(1.0, self._diagnose),
        ]

    def destroy(self) -> None:
        for each in self._made[:2]:
            self._node.destroy_subscription(each)
        for each in self._made[2:]:
            self._node.destroy_timer(each)
        for each in self._commands, self._diagnostics:
            self._node.destroy_publisher(each)

    def _on_scan(self, message):
        self.send(self._bridge.on_scan(scan_of(message), now_of(self._node)))

    def _on_odometry(self, message):
        try:
            odometry = odometry_of(message)
        except Refused as error:
            self._node.get_logger().error(f"odom: {error}", throttle_duration_sec=1.0)
            return
        self.send(self._bridge.on_odometry(odometry, now_of(self._node)))

    def _on_tick(self):
        self.send(self._bridge.tick(now_of(self._node)))

    def send(self, output: Optional[Output]) -> None:
        """Sends an answer of the bridge, if there is one."""
        self._say()
        if output is None or not self.is_active:
            return
        message = TwistStamped() if self._stamped else Twist()
        if self._stamped:
            # A simulated clock may come after the scan that it stamps.
            message.header.stamp = stamp_of(max(now_of(self._node), self._bridge.scan_stamp))
            message.header.frame_id = self._robot_frame
        self._commands.publish(fill_velocity(message, output.linear, output.angular))
        self.on_sent(output)

    def _say(self):
        """Logs a status that differs in more than its numbers from the last."""
        said = re.sub(r"[\d.]+", "", self._bridge.status)
        if said == self._said:
            return
        self._said = said
        if self._bridge.is_stopped:
            self._node.get_logger().warning(self._bridge.status)
        else:
            self._node.get_logger().info(self._bridge.status)

    def stop(self) -> None:
        """Sends a stop, and waits until it has arrived."""
        self.send(STOP)
        self._commands.wait_for_all_acked(rclpy.duration.Duration(seconds=1.0))

    def _diagnose(self):
        level = DiagnosticStatus.WARN if self._bridge.is_stopped else DiagnosticStatus.OK
        status = DiagnosticStatus(level=level, name=self._node.get_name(), message=self._bridge.status,
                                  values=[KeyValue(key="active", value=str(self.is_active))])
        message = DiagnosticArray(status=[status])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def run(make_node: Callable[[], Any]) -> NoReturn:
    """Runs a node until SIGINT, SIGTERM or its own end; calls its `stop` then, and ends the process."""
    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.NO)
    ending = Ending()
    try:
        node = make_node()
    except ValueError as error:  # Bad input, of this package or of slalom.
        print(f"slalom_ros: {error}", flush=True)
        leave(1, rclpy.shutdown)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def shut_down():
        node.destroy_node()
        rclpy.try_shutdown()

    code = 0
    try:
        while not ending.is_told and rclpy.ok():
            executor.spin_once(timeout_sec=0.1)
    except ExternalShutdownException:
        pass
    except Exception:
        traceback.print_exc()
        code = 1
    node.stop()
    leave(code, shut_down)
