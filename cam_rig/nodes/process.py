"""A node's process: from rclpy's start to its exit code, and to another run where it stays."""

from __future__ import annotations

import faulthandler
import os
import signal
import sys
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
from cam_rig.nodes.rig_node import RigNode
from cam_rig.nodes.run_end import staying_node, wait_until_gone
from cam_rig.runner.node_table import STAY
from cam_rig.runner.resources import MAX_NAMESPACE

try:  # less CPU time a message; not in every distribution
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor

#: A signal is noticed when the executor comes back to Python, which it does this often (s).
SIGNAL_POLL_S = 0.1
#: Wall time (s) that DDS may take to be taken down, of less than one in general; before the runner
#: kills what has not ended.
MAX_TEARDOWN_S = 3


class StopRequest:
    """A signal to stop, which may come before there is a node to end."""

    def __init__(self) -> None:
        self.received, self.act = False, lambda: None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)

    def _stop(self, _signal: int, _frame: FrameType | None) -> None:
        self.received = True
        self.act()


@contextmanager
def bounded(failed: bool = False) -> Iterator[None]:
    """End the process where DDS does not come back: by SIGALRM, with code 1 where it has failed.

    When another node leaves while this one announces itself, Fast DDS may wait for itself for ever
    (eProsima/Fast-DDS issue 6502). All that the node had to do is done by then.
    """
    with open(os.devnull, "w", encoding="utf-8") as nowhere:
        if failed:
            faulthandler.dump_traceback_later(MAX_TEARDOWN_S, exit=True, file=nowhere)
        else:
            signal.alarm(MAX_TEARDOWN_S)
        try:
            yield
        finally:
            signal.alarm(0)
            faulthandler.cancel_dump_traceback_later()


def run(make: Callable[[], RigNode]) -> None:
    """Run a node until it finishes, fails, or gets a signal to stop (SIGINT, SIGTERM)."""
    request = StopRequest()
    # of a node that cannot be made, beside its error
    warnings.filterwarnings("ignore", "Failed to fini rosout publisher", RuntimeWarning)
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # a parameter file that is missing or not one
        raise ConfigError(str(error)) from None
    if stray := remove_ros_args(sys.argv)[1:]:
        raise ConfigError(
            f"{stray[0]!r}: no such argument; allowed: --help, and what is given after --ros-args"
        )
    code = 1
    try:
        code = _run(make, request)
    finally:
        with bounded(failed=code != 0):
            rclpy.try_shutdown()
    sys.exit(code)


def _run(make: Callable[[], RigNode], request: StopRequest) -> int:
    """One run after the other, as long as the node stays; the exit code."""
    staying = None
    while True:
        try:
            node = make()
        except CamRigError as error:
            print(f"cam_rig: {error}", file=sys.stderr)
            return error.exit_code
        except ParameterException as error:
            print(f"cam_rig: parameter: {error}", file=sys.stderr)
            return ConfigError.exit_code
        except (NameValidationException, rclpy_implementation.RCLError) as error:
            print(f"cam_rig: the node cannot be made: {_reason(error)}", file=sys.stderr)
            return ConfigError.exit_code
        if staying is None and node.given.get("at_end") == STAY:
            staying = staying_node(node.get_name())
        code = _spin(node, request)
        if code or request.received or staying is None or not node.stays:
            return code
        wait_until_gone(staying, node.rig_publishers, lambda: request.received)
        RigNode.runs_before += 1


def _reason(error: Exception) -> str:
    """Why ROS makes no node; of a namespace that is too long it names no limit."""
    words = str(error).splitlines()[0].split(", at ")[0]
    too_long = "should not exceed" in words  # itself, or with the name of a topic or service
    return f"the namespace is too long; allowed: {MAX_NAMESPACE} characters" if too_long else words


def _spin(node: RigNode, request: StopRequest) -> int:
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
    executor.shutdown()
    try:
        node.close()
    except CamRigError as error:
        node.failure = node.failure or error
    name, failure = node.get_name(), node.failure
    if failure is None:
        node.get_logger().info(node.summary())
    request.act = lambda: None
    if failure is not None:
        print(f"{name}: {failure}", file=sys.stderr)
    with bounded(failed=failure is not None):
        node.destroy_node()
    return 0 if failure is None else failure.exit_code
