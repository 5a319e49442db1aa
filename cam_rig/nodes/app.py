"""Starting and ending a node's process: one way for all of them."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from cam_rig.bag.topics import DIAGNOSTICS, Topic
from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.experiment.handover import Handover
from cam_rig.nodes.convert import message_class, qos
from cam_rig.nodes.diagnostics import Diagnostics
from cam_rig.nodes.parameters import PARAMETERS, declare, refuse_wrong

try:  # a fifth of the CPU time a message; not in every distribution
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor


#: A signal is noticed when the executor comes back to Python, which it does this often (s).
SIGNALS_EVERY = 0.1


class RigNode(Node):
    """A node of the rig: it declares its parameters, and ends its process by `finish` or `fail`.

    ``given`` holds the parameters' values at the start, ``handover`` what a predecessor left.
    """

    #: Whether the executor must tell who sent a message; it costs three times the CPU a message.
    knows_senders = False

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.done: Future = Future()
        self.failure: CamRigError | None = None
        self.given = declare(self, PARAMETERS[name])
        self.handover = Handover(self.given["handover"], name)
        self.add_on_set_parameters_callback(refuse_wrong(PARAMETERS[name]))
        self.health = Diagnostics(self.publisher(DIAGNOSTICS), name)

    def publisher(self, topic: Topic) -> Publisher:
        """A publisher with the topic's type and quality of service."""
        return self.create_publisher(message_class(topic), topic.name, qos(topic))

    def every(self, period: float, act: Callable[[], None]) -> Timer:
        """Call ``act`` every so often (s) of wall time, under use_sim_time too.

        The rig makes rig time: who waited for it to go on would wait for itself.
        """
        return self.create_timer(period, act, clock=self._steady)

    def subscribe(self, topic: Topic, callback: Callable[..., None], raw: bool = False) -> None:
        """Subscribe with the topic's type and quality of service.

        What the callback refuses (`RefusedError`) is warned of, and the node lives on; any other
        of the rig's errors ends it.
        """

        def guarded(message: Any) -> None:
            try:
                callback(message)
            except RefusedError as error:
                self.refuse(error)
            except CamRigError as error:
                self.fail(error)

        self.create_subscription(message_class(topic), topic.name, guarded, qos(topic), raw=raw)

    def refuse(self, error: CamRigError) -> None:
        """Warn of a message that was refused, at most once a second."""
        self.get_logger().warning(f"refused: {error}", throttle_duration_sec=1.0)

    def serve(self, service: str, act: Callable[[], str]) -> None:
        """Offer ``~/service`` (std_srvs/Trigger); ``act`` gives the answer's words."""

        def answer(_request: Any, response: Any) -> Any:
            try:
                response.success, response.message = True, act()
            except CamRigError as error:
                response.success, response.message = False, str(error)
            return response

        self.create_service(Trigger, f"~/{service}", answer)

    def finish(self) -> None:
        """End the process with code 0."""
        if not self.done.done():
            self.done.set_result(None)

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Take what is still on its way; nothing for a node whose drive waits for it."""

    def fail(self, error: CamRigError) -> None:
        """End the process with the error's message and code."""
        self.failure = self.failure or error
        self.finish()

    def close(self) -> None:
        """Let go of what the node holds; called once, after the executor has stopped."""


def run(make: Callable[[], RigNode]) -> None:
    """Run a node until it finishes, fails, or is told to stop (SIGINT, SIGTERM)."""
    _end_with_the_runner()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # a parameter file that is missing or none
        print(f"cam_rig: {error}", file=sys.stderr)
        sys.exit(ConfigError.exit_code)
    try:
        sys.exit(_spin(make))
    finally:
        rclpy.try_shutdown()


def _end_with_the_runner() -> None:
    """A runner that is killed outright must not leave its nodes behind (PR_SET_PDEATHSIG)."""
    runner = os.environ.get("CAM_RIG_RUNNER")
    if runner is not None and sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGINT)
        if os.getppid() != int(runner):
            sys.exit(f"the runner {runner} has ended")


def _spin(make: Callable[[], RigNode]) -> int:
    try:
        node = make()
    except CamRigError as error:
        print(f"cam_rig: {error}", file=sys.stderr)
        return error.exit_code
    except ParameterException as error:
        print(f"cam_rig: parameter: {error}", file=sys.stderr)
        return ConfigError.exit_code

    def stop(_signal: int, _frame: FrameType | None) -> None:
        node.finish()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    executor = SingleThreadedExecutor() if node.knows_senders else Executor()
    executor.add_node(node)
    while not node.done.done():
        executor.spin_until_future_complete(node.done, timeout_sec=SIGNALS_EVERY)
    node.drain(executor.spin_once)
    executor.shutdown()
    try:
        node.close()
    except CamRigError as error:
        node.failure = node.failure or error
    name, failure = node.get_name(), node.failure
    node.destroy_node()
    if failure is not None:
        print(f"{name}: {failure}", file=sys.stderr)
        return failure.exit_code
    return 0
