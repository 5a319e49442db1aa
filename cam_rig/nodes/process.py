"""Process of a node: initialises rclpy, spins the node, returns its exit code."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

import rclpy
import rclpy.logging
from rcl_interfaces.msg import Log
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import LoggingSeverity
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from cam_rig.errors import CamRigError, ConfigError
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.base.run_end import create_staying_node, wait_until_gone
from cam_rig.runner.node_table import STAY
from cam_rig.runner.resources import MAX_NAMESPACE

try:  # uses less CPU time per message; not part of every distribution
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor

#: Period (s, wall clock) at which the executor returns to Python, which then handles signals.
SIGNAL_POLL_S = 0.1
#: Time (s, wall clock) for DDS to shut down, which usually takes less than one second. It is
#: shorter than the time after which the runner kills a node.
MAX_TEARDOWN_S = 3
#: Longest time (s, wall clock) for which a node that cannot start waits until a subscriber of
#: /rosout is discovered. Discovery takes 0.06 to 0.08 s on a free machine.
ROSOUT_DISCOVERY_S = 0.5
#: Longest time (s, wall clock) to wait until a discovered subscriber of /rosout is connected, and
#: again until it has acknowledged the error message.
ROSOUT_DELIVERY_S = 5.0
#: Polling period (s, wall clock) of the waits for a subscriber of /rosout.
ROSOUT_POLL_S = 0.02


class StopRequest:
    """Request to stop by SIGINT or SIGTERM, which may arrive before the node exists.

    Python runs signal handlers on the main thread between two bytecodes. This is also the thread of
    the executor, so `act` needs no lock.
    """

    def __init__(self) -> None:
        self.received, self.act = False, lambda: None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, _signal: int, _frame: FrameType | None) -> None:
        self.received = True
        self.act()


@contextmanager
def bounded(failed: bool = False) -> Iterator[None]:
    """End the process if DDS does not shut down within `MAX_TEARDOWN_S`.

    The process ends by SIGALRM, which the runner counts as code 0, or with code 1 if the node has
    `failed`. If another node leaves while this node announces itself, Fast DDS can deadlock
    (eProsima/Fast-DDS issue 6502). All work of the node is done by then.
    """
    with open(os.devnull, "w", encoding="utf-8") as devnull:
        if failed:
            faulthandler.dump_traceback_later(MAX_TEARDOWN_S, exit=True, file=devnull)
        else:
            signal.alarm(MAX_TEARDOWN_S)
        try:
            yield
        finally:
            signal.alarm(0)
            faulthandler.cancel_dump_traceback_later()


def run(name: str, make: Callable[[], RigNode]) -> None:
    """Run a node until it ends or receives a signal, and exit with its code."""
    request = StopRequest()
    # rclpy warns if a node could not be created, in addition to the error
    warnings.filterwarnings("ignore", "Failed to fini rosout publisher", RuntimeWarning)
    invalid = ""
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        if stray := remove_ros_args(sys.argv)[1:]:
            invalid = f"unknown argument {stray[0]!r}; use --help, or --ros-args first"
    except RuntimeError as error:  # a parameter file is missing or invalid
        invalid = first_line(error)
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    code = 1
    try:
        code = _fail(name, invalid, ConfigError.exit_code) if invalid else _run(name, make, request)
    finally:
        with bounded(failed=code != 0):
            rclpy.try_shutdown()
    sys.exit(code)


def first_line(error: Exception) -> str:
    """Return the text of an error of rcl without the positions in its source files."""
    return str(error).splitlines()[0].split(", at ")[0]


def _fail(name: str, text: str, code: int) -> int:
    """Log why a node cannot start, also on /rosout, and return the exit code.

    The message on /rosout has a separate publisher, because rclpy reports neither when the
    publisher of a logger has matched nor when its message has arrived.
    """
    rclpy.logging.get_logger(f"{name}.start").fatal(text)
    monitor = rclpy.create_node(
        name, use_global_arguments=False, start_parameter_services=False, enable_rosout=False
    )
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = monitor.create_publisher(Log, "/rosout", latched)
    stamp = monitor.get_clock().now().to_msg()
    publisher.publish(Log(stamp=stamp, level=LoggingSeverity.FATAL, name=name, msg=text))
    if _wait_for(lambda: monitor.count_subscribers("/rosout") > 0, ROSOUT_DISCOVERY_S):
        _wait_for(lambda: publisher.get_subscription_count() > 0, ROSOUT_DELIVERY_S)
        publisher.wait_for_all_acked(Duration(seconds=ROSOUT_DELIVERY_S))
    return code


def _wait_for(condition: Callable[[], bool], seconds: float) -> bool:
    """Wait at most `seconds` (wall clock) for a condition, and return True if it is met."""
    deadline = time.monotonic() + seconds
    while not (met := condition()) and time.monotonic() < deadline:
        time.sleep(ROSOUT_POLL_S)
    return met


def _run(name: str, make: Callable[[], RigNode], request: StopRequest) -> int:
    """Run a node until it is done, and return the exit code.

    With on_finish `stay`, the node is created again for each further run of the rig. `make` creates
    the node, and `request` reports a signal to stop.
    """
    staying_node = None
    while True:
        try:
            node = make()
        except CamRigError as error:
            return _fail(name, str(error), error.exit_code)
        except ParameterException as error:
            return _fail(name, f"parameter: {error}", ConfigError.exit_code)
        # RCLError has no public name in rclpy (Kilted): an import error would follow its move
        except (NameValidationException, rclpy_implementation.RCLError) as error:
            text = first_line(error)
            if "should not exceed" in text:  # ROS does not report the limit of a namespace
                text = f"the namespace must have at most {MAX_NAMESPACE} characters"
            return _fail(name, f"the node cannot be created: {text}", ConfigError.exit_code)
        if staying_node is None and node.settings.get("on_finish") == STAY:
            staying_node = create_staying_node(node.get_name())
        code = _spin(node, request)
        if code or request.received or staying_node is None or not node.stays:
            return code
        wait_until_gone(staying_node, node.rig_endpoints, lambda: request.received)
        RigNode.runs_before += 1


def _spin(node: RigNode, request: StopRequest) -> int:
    """Process a node's callbacks until it ends, and return the exit code.

    The node is destroyed at the end. `request` reports a signal to stop.
    """
    request.act = node.interrupt
    if request.received:
        node.interrupt()
    executor = SingleThreadedExecutor() if node.needs_message_info else Executor()
    executor.add_node(node)
    node.report_ready()
    while not node.done.done():
        executor.spin_until_future_complete(node.done, timeout_sec=SIGNAL_POLL_S)
    if node.failure is None:
        node.drain(executor.spin_once)
    node.conclude(executor.spin_once)
    node.publishing_monitor.flush()
    node.publishing_monitor.check(time.monotonic())
    executor.shutdown()
    try:
        node.close()
    except CamRigError as error:
        node.fail(error)
    if node.failure is None:
        node.get_logger().info(node.summary())
    request.act = lambda: None
    with bounded(failed=node.failure is not None):
        node.destroy_node()
    return 0 if node.failure is None else node.failure.exit_code
