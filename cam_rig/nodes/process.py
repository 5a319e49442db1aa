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
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
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

#: Period (s) at which the executor returns to Python, which then handles signals.
SIGNAL_POLL_S = 0.1
#: Time (s, wall clock) for DDS to shut down, which usually takes less than one second. It is
#: shorter than the time after which the runner kills a node.
MAX_TEARDOWN_S = 3
#: Time (s, wall clock) to discover a subscriber of /rosout, for the error of a node that cannot
#: start. The discovery takes 0.06 to 0.08 s on an idle machine.
ROSOUT_DISCOVERY_S = 0.5
#: Period (s, wall clock) at which the number of these subscribers is polled.
ROSOUT_POLL_S = 0.02
#: Time (s, wall clock) to deliver the error to the subscribers.
ROSOUT_DELIVERY_S = 0.2


class StopRequest:
    """Signals to stop (SIGINT, SIGTERM), which may arrive before there is a node.

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
    RigNode.process_logger, invalid = None, ""
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
    """Log why a node cannot start, on /rosout as well, and return the exit code.

    The node exists if its constructor has failed. Otherwise a plain node of its `name` takes its
    place: the logger of a process without a node does not publish on /rosout.
    """
    monitor = rclpy.create_node(
        name,
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=RigNode.process_logger is None,
    )
    deadline = time.monotonic() + ROSOUT_DISCOVERY_S
    while not monitor.count_subscribers("/rosout") and time.monotonic() < deadline:
        time.sleep(ROSOUT_POLL_S)
    # rclpy reports neither when the logger's publisher has matched nor when the message has arrived
    wait = ROSOUT_DELIVERY_S if monitor.count_subscribers("/rosout") else 0.0
    time.sleep(wait)
    (RigNode.process_logger or monitor.get_logger()).fatal(text)
    time.sleep(wait)
    return code


def _run(name: str, make: Callable[[], RigNode], request: StopRequest) -> int:
    """Run a node once, or once per run if it stays, and return the exit code."""
    staying_node = None
    while True:
        try:
            node = make()
        except CamRigError as error:
            return _fail(name, str(error), error.exit_code)
        except ParameterException as error:
            return _fail(name, f"parameter: {error}", ConfigError.exit_code)
        except (NameValidationException, rclpy_implementation.RCLError) as error:
            text = first_line(error)
            if "should not exceed" in text:  # ROS does not report the limit of a namespace
                text = f"the namespace must have at most {MAX_NAMESPACE} characters"
            return _fail(name, f"the node cannot be created: {text}", ConfigError.exit_code)
        if staying_node is None and node.settings.get("at_end") == STAY:
            staying_node = create_staying_node(node.get_name())
        code = _spin(node, request)
        if code or request.received or staying_node is None or not node.stays:
            return code
        wait_until_gone(staying_node, node.rig_endpoints, lambda: request.received)
        RigNode.runs_before += 1


def _spin(node: RigNode, request: StopRequest) -> int:
    """Spin a node to its end, destroy it, and return the exit code."""
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
