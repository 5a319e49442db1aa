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
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from cam_rig.bag.topics import Topic
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.nodes.convert import message_class, qos

try:  # a fifth of the CPU time a message; not in every distribution
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor


#: A signal is noticed when the executor comes back to Python, which it does this often (s).
SIGNALS_EVERY = 0.1


class RigNode(Node):
    """A node of the rig: it ends its process by `finish` or `fail`."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.done: Future = Future()
        self.failure: CamRigError | None = None

    def publisher(self, topic: Topic) -> Publisher:
        """A publisher with the topic's type and quality of service."""
        return self.create_publisher(message_class(topic), topic.name, qos(topic))

    def subscribe(self, topic: Topic, callback: Callable[[Any], None], raw: bool = False) -> None:
        """Subscribe with the topic's type and quality of service."""
        self.create_subscription(message_class(topic), topic.name, callback, qos(topic), raw=raw)

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
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
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
    executor = Executor()
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
