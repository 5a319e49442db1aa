"""Starting and ending a node's process: one way for all of them."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from types import FrameType

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from cam_rig.errors import CamRigError

try:  # a fifth of the CPU time a message; not in every distribution
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor


class RigNode(Node):
    """A node of the rig: it ends its process by `finish` or `fail`."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.done: Future = Future()
        self.failure: CamRigError | None = None

    def finish(self) -> None:
        """End the process with code 0."""
        if not self.done.done():
            self.done.set_result(None)

    def fail(self, error: CamRigError) -> None:
        """End the process with the error's message and code."""
        self.failure = self.failure or error
        self.finish()

    def close(self) -> None:
        """Release what the node holds; called once, after the executor has stopped."""


def run(make: Callable[[], RigNode]) -> None:
    """Run a node until it finishes, fails, or is told to stop (SIGINT, SIGTERM)."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        sys.exit(_spin(make))
    finally:
        rclpy.try_shutdown()


def _spin(make: Callable[[], RigNode]) -> int:
    try:
        node = make()
    except CamRigError as error:
        print(f"cam_rig: {error}", file=sys.stderr)
        return error.exit_code

    def stop(_signal: int, _frame: FrameType | None) -> None:
        node.finish()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    executor = Executor()
    executor.add_node(node)
    while not node.done.done():
        executor.spin_until_future_complete(node.done, timeout_sec=0.5)
    executor.shutdown()
    try:
        node.close()
    except CamRigError as error:
        node.failure = node.failure or error
    node.destroy_node()
    if node.failure is not None:
        print(f"{node.get_name()}: {node.failure}", file=sys.stderr)
        return node.failure.exit_code
    return 0
