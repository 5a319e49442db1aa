"""Running a node: how every node takes messages, watches its topics, and ends."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Callable
from functools import wraps
from types import FrameType
from typing import Any

import rclpy
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from cam_rig.bag.publishers import second_publisher
from cam_rig.errors import CamRigError, ConfigError, RefusedError
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.messages.topics import DIAGNOSTICS, READY, Topic
from cam_rig.nodes.common.convert import message_class, qos, to_header
from cam_rig.nodes.common.diagnostics import Diagnostics
from cam_rig.nodes.common.parameters import PARAMETERS, declare, refuse_wrong

try:  # less CPU time a message; not in every distribution
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor


#: A signal is noticed when the executor comes back to Python, which it does this often (s).
SIGNAL_POLL_S = 0.1
#: Wall time (s) between two checks for other publishers on a node's topics.
WATCH_PERIOD_S = 0.25
#: Wall time (s) that the name of a newly discovered publisher's node is waited for.
NAME_TIMEOUT_S = 5.0
#: Wall time (s) for messages still in transit at the end; after 10 s the runner kills the node.
MAX_DRAIN_S = 3.0
#: What a message of the right type with impossible content may raise where it is read.
UNREADABLE = (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RuntimeError)


class RigNode(Node):
    """A node of the rig: it declares its parameters, and ends its process by `finish` or `fail`.

    ``given`` holds the parameters' values at the start; ``checkpoint`` is what takes the place of
    a killed predecessor, used through `save` and `restore`.
    """

    #: Whether callbacks need the publisher and number of each message, which rclpy's events
    #: executor does not pass on. The other one takes 0.1 ms more CPU time per message.
    needs_message_info = False

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.done: Future = Future()
        self.failure: CamRigError | None = None
        self.given = declare(self, PARAMETERS[name])
        self.checkpoint = Checkpoint(self.given["checkpoint"], name)
        self.checkpoint.count_launch()
        self._owned: list[Topic] = []
        #: Messages taken so far.
        self.taken = 0
        self.add_on_set_parameters_callback(refuse_wrong(PARAMETERS[name]))
        self.health = Diagnostics(self.publisher(DIAGNOSTICS), name)
        self._ready = self.publisher(READY)
        self.every(WATCH_PERIOD_S, self._watch)

    def save(self, state: Any, stamp_ns: int) -> None:
        """Keep what this node knows at a rig time for the one that takes its place."""
        if self.checkpoint.enabled:
            self.checkpoint.save((state, self.health.reported), stamp_ns)

    def restore(self) -> list[Any]:
        """What a predecessor saved, the oldest first; its diagnostics go on from the oldest."""
        saved = self.checkpoint.all()
        if saved:
            self.health.reported = saved[0][1]
        return [state for state, _ in saved]

    def publisher(self, topic: Topic) -> Publisher:
        """A publisher with the topic's type and quality of service."""
        if topic.owner:
            self._owned.append(topic)
        return self.create_publisher(message_class(topic), topic.name, qos(topic))

    def every(self, period: float, act: Callable[[], None]) -> Timer:
        """Call ``act`` with a period (s) of wall time, under use_sim_time too.

        The rig itself makes rig time: a node that waited for it would wait for ever.
        """
        return self.create_timer(period, act, clock=self._steady)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, *how: Any, **named: Any
    ) -> Any:
        """Subscribe; the one guard of every subscription, rclpy's own among them.

        A message that cannot be read or is refused (`RefusedError`) is logged as a warning, and the
        node goes on; any other of the rig's errors ends it.
        """
        guarded = self._guarded(topic, callback)
        return super().create_subscription(msg_type, topic, guarded, *how, **named)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **named: Any) -> Any:
        """Offer a service; an impossible request, of parameters too, has an empty answer."""

        def answer(request: Any, response: Any) -> Any:
            found = self._guarded(srv_name, callback)(request, response)
            return srv_type.Response() if found is None else found

        return super().create_service(srv_type, srv_name, answer, **named)

    def _guarded(self, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(callback)
        def guarded(*message: Any) -> Any:
            try:
                return callback(*message)
            except RefusedError as error:
                self.refuse(error)
            except CamRigError as error:
                self.fail(error)
            except UNREADABLE as error:
                self.refuse(RefusedError(f"{name}: cannot be read ({error})"))

        return guarded

    def subscribe(self, topic: Topic, callback: Callable[[Any], None]) -> None:
        """Subscribe with the topic's type and quality of service."""
        kind = message_class(topic)

        def take(cdr: bytes) -> None:
            require_length(topic, cdr)
            callback(deserialize_message(cdr, kind))
            self.taken += 1

        self.create_subscription(kind, topic.name, take, qos(topic), raw=True)

    def refuse(self, error: CamRigError) -> None:
        """Log a refused message as a warning, at most once per second."""
        self.get_logger().warning(f"refused: {error}", throttle_duration_sec=1.0)

    def serve(self, service: str, act: Callable[[], str]) -> None:
        """Offer ``~/service`` (std_srvs/Trigger); ``act`` returns the reply's message."""

        def answer(_request: Any, response: Any) -> Any:
            try:
                response.success, response.message = True, act()
            except CamRigError as error:
                response.success, response.message = False, str(error)
            return response

        self.create_service(Trigger, f"~/{service}", answer)

    def report_ready(self) -> None:
        """Publish, latched, that this node takes messages."""
        self._ready.publish(to_header(0, self.get_name()))

    def publishers_of(self, topic: Topic) -> dict[bytes, str]:
        """The publishers of a topic, by discovery: their node's name by DDS identity.

        Asked only for an error. A new node's name may be discovered after its publisher: it is
        waited for, as only a DDS program that is not a ROS node never gets one.
        """
        deadline = time.monotonic() + NAME_TIMEOUT_S
        while True:
            found = {
                bytes(info.endpoint_gid): f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                for info in self.get_publishers_info_by_topic(topic.name)
            }
            unnamed = {gid for gid, name in found.items() if "UNKNOWN" in name}
            if not unnamed or time.monotonic() > deadline:
                return found | dict.fromkeys(unnamed, "a program that is not a ROS node")
            time.sleep(0.02)

    def _watch(self) -> None:
        """A second publisher on a topic that this node owns ends the run."""
        for topic in self._owned:
            if self.count_publishers(topic.name) > self.checkpoint.launches(topic.owner):
                names = list(self.publishers_of(topic).values())
                own = f"{self.get_namespace().rstrip('/')}/{self.get_name()}"
                others = [name for name in names if name != own] or names[1:]
                if others:
                    self.fail(second_publisher(topic, topic.owner, ", ".join(others)))

    def finish(self) -> None:
        """End the process with code 0."""
        if not self.done.done():
            self.done.set_result(None)

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Take what has arrived but was not taken yet; see `take_rest`."""
        take_rest(spin_once, lambda: self.taken)

    def fail(self, error: CamRigError) -> None:
        """End the process with the error's message and code."""
        self.failure = self.failure or error
        self.finish()

    def close(self) -> None:
        """Release what the node holds; called once, after the executor has stopped."""


def require_length(topic: Topic, cdr: bytes) -> None:
    """Refuse a serialized message, before it is read, that is longer than any of its topic.

    Raises
    ------
    RefusedError : with its length and the limit
    """
    if len(cdr) > topic.most_bytes:
        raise RefusedError(f"{topic.name}: {len(cdr)} bytes; allowed: {topic.most_bytes}")


def take_rest(
    spin_once: Callable[..., None],
    taken: Callable[[], int],
    now: Callable[[], float] = time.monotonic,
) -> None:
    """Spin until nothing more is taken for a while, at most `MAX_DRAIN_S`."""
    quiet, deadline = 0, now() + MAX_DRAIN_S
    while quiet < 5 and now() < deadline:
        before = taken()
        spin_once(timeout_sec=0.02)
        quiet = quiet + 1 if taken() == before else 0


def run(make: Callable[[], RigNode]) -> None:
    """Run a node until it finishes, fails, or gets a signal to stop (SIGINT, SIGTERM)."""
    request = StopRequest()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # a parameter file that is missing or not one
        print(f"cam_rig: {error}", file=sys.stderr)
        sys.exit(ConfigError.exit_code)
    try:
        sys.exit(_spin(make, request))
    finally:
        rclpy.try_shutdown()


class StopRequest:
    """A signal to stop, which may come before there is a node to end."""

    def __init__(self) -> None:
        self.received, self.act = False, lambda: None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)

    def _stop(self, _signal: int, _frame: FrameType | None) -> None:
        self.received = True
        self.act()


def _spin(make: Callable[[], RigNode], request: StopRequest) -> int:
    try:
        node = make()
    except CamRigError as error:
        print(f"cam_rig: {error}", file=sys.stderr)
        return error.exit_code
    except ParameterException as error:
        print(f"cam_rig: parameter: {error}", file=sys.stderr)
        return ConfigError.exit_code
    request.act = node.finish
    if request.received:
        node.finish()
    executor = SingleThreadedExecutor() if node.needs_message_info else Executor()
    executor.add_node(node)
    node.report_ready()
    while not node.done.done():
        executor.spin_until_future_complete(node.done, timeout_sec=SIGNAL_POLL_S)
    if node.failure is None:
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
