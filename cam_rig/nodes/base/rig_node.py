"""Base class of the nodes: parameters, topics, diagnostics, end of the run."""

from __future__ import annotations

import time
import zlib
from collections import deque
from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import Any, ClassVar, cast

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from cam_rig.errors import CamRigError, ConfigError, RefusedError, RunError
from cam_rig.files import read_bytes
from cam_rig.messages.topics import DIAGNOSTICS, READY, TOPICS, Topic
from cam_rig.nodes.base.diagnostics import Activity, Diagnostics, Heartbeat
from cam_rig.nodes.base.parameter_table import ParameterTable
from cam_rig.nodes.base.publisher_monitor import PublisherMonitor, UnnamedPublisherError
from cam_rig.nodes.base.publishing_monitor import PublishingMonitor
from cam_rig.nodes.base.run_end import RunEndMonitor, find_endpoints
from cam_rig.nodes.convert import message_class, qos, require_length
from cam_rig.nodes.parameters import PARAMETERS
from cam_rig.runner.node_table import STAY
from cam_rig.runner.resources import parse_namespace
from cam_rig.schema.load import MAX_BYTES

#: Longest time (s, wall clock) for which a reliable subscriber with a full queue may block a writer
#: before the node fails.
MAX_BLOCKED_S = 60.0
#: Longest time (s, wall clock) for which a node processes messages in transit at the end of a run.
#: It is well below 10 s, after which the runner kills a node.
MAX_DRAIN_S = 3.0
#: Duration (s, wall clock) of a spin while messages in transit are processed.
DRAIN_SPIN_S = 0.02
#: Number of spins without a message after which the queues are considered empty.
QUIET_SPINS = 5
#: Exceptions that reading a message of the right type but with invalid content can raise.
INVALID_CONTENT = (
    ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RuntimeError,
)  # fmt: skip


class RigPublisher(Publisher):
    """Publisher that delays a message instead of losing it if the writer is blocked.

    `Publisher.publish` is overridden because rclpy (Kilted) raises RCLError when a reliable writer
    is blocked for longer than 0.1 s, and does not send the message later. rclpy creates this class
    through the public argument `publisher_class` of `create_publisher`. The exception type has no
    public name: if a later rclpy moves it, this module cannot be imported.

    No call blocks the executor for longer than one attempt of DDS (0.1 s). `PublishingMonitor`
    calls `publish_delayed` periodically. At most four ticks are in flight, which bounds the number
    of delayed messages.
    """

    #: Time (s, wall clock) that the publisher has spent in publishing.
    publishing_s = 0.0
    #: Time (s, monotonic clock) at which a slow subscriber first blocked the writer.
    blocked_since = 0.0

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        #: Messages that a blocked writer has not published yet, in their order.
        self.delayed = deque[Any]()

    def publish(self, msg: Any) -> None:
        """Publish a message, or delay it if a slow subscriber blocks the writer.

        Delayed messages are published first.
        """
        if not self.delayed and self.try_publish(msg):
            return
        if not self.delayed:
            self.blocked_since = time.monotonic()
        self.delayed.append(msg)

    def publish_delayed(self) -> None:
        """Publish delayed messages until the writer is blocked again.

        Raises
        ------
        RunError
            If the writer has been blocked for `MAX_BLOCKED_S`.
        """
        while self.delayed and self.try_publish(self.delayed[0]):
            self.delayed.popleft()
            self.blocked_since = time.monotonic()
        if self.delayed and time.monotonic() - self.blocked_since > MAX_BLOCKED_S:
            raise RunError(
                f"{self.topic_name}: the writer has been blocked for {MAX_BLOCKED_S:g} s; "
                "check for a subscriber that does not take messages"
            )

    def try_publish(self, msg: Any) -> bool:
        """Publish a message and return True, or return False if the writer is blocked.

        A slow reliable subscriber blocks it.
        """
        start = time.monotonic()
        try:
            super().publish(msg)
        except rclpy_implementation.RCLError:
            return False
        finally:
            self.publishing_s += time.monotonic() - start
        return True


class RigNode(Node):
    """Node of the rig.

    Subclasses create their publishers with `advertise`, their subscriptions with `subscribe` and
    their timers with `create_wall_timer`. These catch errors: a message that cannot be used is
    logged as a warning, and any other error of the rig ends the process through `fail`.

    All callbacks run on the thread of the executor, so the state of a node needs no lock. The
    signal handler that calls `interrupt` runs on the same thread.

    Attributes
    ----------
    settings : dict
        Parameter values at start-up by name.
    parameter_table, diagnostics, publisher_monitor, publishing_monitor
        The components of the node.
    done : rclpy.task.Future
        Completed when the node is to end.
    failure : CamRigError or None
        The error that ends the node.
    received, ticks, interrupts : int
        Numbers of messages received, ticks processed and signals received.
    """

    #: True if callbacks need the publisher and sequence number of each message. The events
    #: executor of rclpy does not pass them. The other executor uses 0.1 ms more CPU time per
    #: message.
    needs_message_info = False
    #: Names of the nodes whose messages this node needs before its first tick (time between two cam
    #: states).
    waits_for: tuple[str, ...] = ("cam_drive",)
    #: Number of runs that this process has completed (parameter on_finish: stay).
    runs_before: ClassVar[int] = 0

    def __init__(self, name: str) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        self._require_own_name(name)
        self.done: Future = Future()
        self.failure: CamRigError | None = None
        self.received = self.ticks = self.interrupts = 0
        #: Number of ticks (times between two cam states) of the scene, 0 if unknown.
        self.total_ticks = 0
        #: DDS identifiers of the publishers of the rig's topics when the run ended, by topic. Empty
        #: before.
        self.rig_endpoints: dict[str, set[bytes]] = {}
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.parameter_table = ParameterTable(self, PARAMETERS[name])
        self.settings = self.parameter_table.values
        for warning in self.parameter_table.unknown:
            self.get_logger().warning(warning)
        parse_namespace(self.get_namespace())  # raises ConfigError if it is too long
        self._guard_parameter_services()
        self.publisher_monitor = PublisherMonitor(self)
        self.publishing_monitor = PublishingMonitor(self)
        self.diagnostics = Diagnostics(self.advertise(DIAGNOSTICS), name)
        self._heartbeat = Heartbeat(self, self.diagnostics)
        self._ready_publisher = self.advertise(READY)
        self.monitor_run_end()
        if self.runs_before:
            self.get_logger().info("ready for another run")

    # Topics, services and timers.

    def _require_own_name(self, name: str) -> None:
        """Raise ConfigError if the node or its services are renamed.

        The nodes of a rig find each other by name, also the law server's parameter services.
        """
        if self.get_name() != name:
            raise ConfigError(
                f"the node's name must be {name}, got {self.get_name()}; remove the remapping of "
                "__node, or separate rigs by namespace: -r __ns:=/rig1"
            )
        prefix = self.get_fully_qualified_name()
        for service in self.services:
            if not service.service_name.startswith(f"{prefix}/"):
                raise ConfigError(
                    f"the parameter services must be below {prefix}, got {service.service_name}; "
                    "remove the remapping, or separate rigs by namespace: -r __ns:=/rig1"
                )

    def _require_own_topic(self, topic: Topic) -> None:
        """Raise ConfigError if a topic is remapped.

        The other nodes and the bags need its original name.
        """
        expected = topic.within(self.get_namespace().rstrip("/"))
        if (actual := self.resolve_topic_name(topic.relative)) != expected:
            raise ConfigError(
                f"the topic {expected} cannot be remapped, got {actual}; remove the remapping, or "
                "separate rigs by namespace: -r __ns:=/rig1"
            )

    def advertise(self, topic: Topic) -> RigPublisher:
        """Create a publisher with the type and the quality of service of a topic."""
        self._require_own_topic(topic)
        if topic.owner:
            self.publisher_monitor.add(topic)
        publisher = cast(
            "RigPublisher",
            self.create_publisher(
                message_class(topic), topic.relative, qos(topic), publisher_class=RigPublisher
            ),
        )
        self.publishing_monitor.add(topic, publisher)
        return publisher

    def subscribe(
        self,
        topic: Topic,
        callback: Callable[[Any], None],
        on_publishers: Callable[[int], None] | None = None,
    ) -> Subscription:
        """Subscribe to a topic with a `callback` that takes the message.

        `on_publishers` is that of `subscribe_raw`.
        """
        kind = message_class(topic)
        return self.subscribe_raw(
            topic,
            lambda cdr: callback(deserialize_message(cdr, kind)),
            on_publishers=on_publishers,
        )

    def subscribe_raw(
        self,
        topic: Topic,
        callback: Callable[..., None],
        histories: int = 1,
        on_publishers: Callable[[int], None] | None = None,
    ) -> Subscription:
        """Subscribe to a topic with a `callback` that takes the serialized message.

        The message is deserialized inside the guarded callback, because rclpy would propagate a
        deserialization error to the executor and end the process. If `needs_message_info` is set,
        `callback` takes the message info of rclpy as well. The queue has room for the histories of
        `histories` publishers. `on_publishers` is called with the number of connected publishers
        when it changes (matched event of rclpy).
        """
        self._require_own_topic(topic)

        def on_message(cdr: bytes) -> None:
            require_length(topic, cdr)
            callback(cdr)
            self.received += 1

        def on_message_with_info(cdr: bytes, info: dict[str, Any]) -> None:
            require_length(topic, cdr)
            callback(cdr, info)
            self.received += 1

        chosen = on_message_with_info if self.needs_message_info else on_message
        events = None
        if on_publishers is not None:
            events = SubscriptionEventCallbacks(
                matched=lambda event: on_publishers(event.current_count)
            )
        return self.create_subscription(
            message_class(topic),
            topic.relative,
            self._guard(topic.relative, chosen),
            qos(topic, histories),
            event_callbacks=events,
            raw=True,
        )

    def create_trigger(self, service: str, action: Callable[[], str]) -> None:
        """Create a service `~/<service>` (std_srvs/Trigger) that performs `action`.

        `action` returns the text of the reply. If it raises a `CamRigError`, the reply reports a
        failure with the text of the error.
        """

        def on_request(_request: Any, response: Any) -> Any:
            try:
                response.success, response.message = True, action()
            except CamRigError as error:
                response.success, response.message = False, str(error)
            return response

        self.create_service(Trigger, f"~/{service}", on_request)

    def create_wall_timer(self, period: float, callback: Callable[[], None]) -> Timer:
        """Create a timer with a period in s of wall-clock time.

        The default clock of a node may follow rig time, which stops with the cam.
        """

        def on_timer() -> None:
            try:
                callback()
            except CamRigError as error:
                self.fail(error)

        return self.create_timer(period, on_timer, clock=self._steady_clock)

    def reject(self, error: CamRigError) -> None:
        """Log a rejected message as a warning, at most once per second."""
        self.get_logger().warning(f"rejected: {error}", throttle_duration_sec=1.0)

    def _guard(self, name: str, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return `callback`, extended by the handling of its errors.

        A message or request with unusable content is logged and skipped, any other error of the
        rig ends the node. `name` is the topic or service in error messages. `wraps` keeps the
        signature, from which rclpy determines whether to pass the message info.
        """

        @wraps(callback)
        def guarded(*arguments: Any) -> Any:
            try:
                return callback(*arguments)
            except RefusedError as error:
                self.reject(error)
            except UnnamedPublisherError:
                self.publisher_monitor.repeat(partial(guarded, *arguments))
            except CamRigError as error:
                self.fail(error)
            except INVALID_CONTENT as error:
                self.reject(RefusedError(f"{name}: invalid content ({error})"))
            return None

        return guarded

    def _guard_parameter_services(self) -> None:
        """Let rclpy's parameter services answer an invalid request with an empty response.

        rclpy (Kilted) converts requests without catching errors: one request with an unknown
        parameter type raises in `Parameter.from_parameter_msg` and ends the process. The public
        attribute `Service.callback` is replaced, which both executors read at each request. If a
        future rclpy reads it once, test_security.py fails.
        """

        def respond(callback: Callable[..., Any], response_class: Any) -> Callable[..., Any]:
            return lambda request, response: callback(request, response) or response_class()

        for service in self.services:
            callback = self._guard(service.service_name, service.callback)
            service.callback = respond(callback, service.srv_type.Response)

    # State of the node.

    def activity(self) -> Activity:
        """Return the current activity of the node for its heartbeat message."""
        subject = "the next tick" if self.ticks else " and ".join(self.waits_for)
        return Activity("waiting", self.waits_for, f"waiting for {subject}")

    def summary(self) -> str:
        """Return the text that is logged when the node ends without an error."""
        return progress_text(self.ticks, self.total_ticks, self.ticks >= self.total_ticks)

    def report_ready(self) -> None:
        """Publish (latched) that this node is ready, and the identity of its scene."""
        identity = scene_identity(self.settings.get("scene", ""))
        text = f"{self.get_name()} {identity}".rstrip()
        self._ready_publisher.publish(message_class(READY)(data=text))

    # End of the run.

    @property
    def stays(self) -> bool:
        """True if the run has ended and this process waits for another run."""
        return bool(self.rig_endpoints) and self.settings.get("on_finish") == STAY

    def monitor_run_end(self) -> None:
        """End the node when the run ends, if the parameter on_finish requires it."""
        RunEndMonitor(self)

    def remember_endpoints(self) -> None:
        """Store the present publishers of the rig's topics in `rig_endpoints`.

        A node that stays for another run starts it when all of them have left.
        """
        names = (self.resolve_topic_name(topic.relative) for topic in TOPICS if topic.owner)
        self.rig_endpoints = find_endpoints(self, *names)

    def finish(self) -> None:
        """Request the end of the process with exit code 0."""
        if not self.done.done():
            self.done.set_result(None)

    def fail(self, error: CamRigError) -> None:
        """Request the end of the process with the exit code of an error.

        The first error counts. It is logged at once, so that it reaches /rosout, the log file of
        the node and the runner, which reads the [FATAL] line from stderr.
        """
        if self.failure is None:
            self.failure = error
            self.get_logger().fatal(str(error))
        self.finish()

    def interrupt(self) -> None:
        """Handle SIGINT or SIGTERM: request the end of the node."""
        self.interrupts += 1
        self.finish()

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Process messages in transit until the queues are empty.

        The call takes at most `MAX_DRAIN_S`.
        """
        quiet, deadline = 0, time.monotonic() + MAX_DRAIN_S
        while quiet < QUIET_SPINS and time.monotonic() < deadline:
            before = self.received
            spin_once(timeout_sec=DRAIN_SPIN_S)
            quiet = quiet + 1 if self.received == before else 0

    def conclude(self, spin_once: Callable[..., None]) -> None:
        """Announce the end of this node to the other nodes.

        The method is called once, while messages are still received. A subclass may call
        `spin_once` to process them.
        """

    def close(self) -> None:
        """Release the resources of the node.

        The method is called once, after the executor has stopped.
        """


def progress_text(done: int, total: int, is_complete: bool, unit: str = "ticks") -> str:
    """Return a text on the number of ticks that a node has processed when it ends.

    A tick is the time between two cam states. `done` is the processed number, and `total` the
    expected number, 0 if it is unknown. `unit` names what is counted.
    """
    if is_complete:
        return f"done with {done} {unit}"
    # a run that an operator has reset may have more ticks than its scene
    return f"stopped after {done}{f' of {total}' if done < total else ''} {unit}"


def scene_identity(scene: str) -> str:
    """Return a scene's name and CRC-32 such as quick#1c291ca3, or "" without a file.

    All nodes of a run must have the same scene. The drive compares the identities.
    """
    try:
        data = read_bytes(Path(scene), MAX_BYTES)
    except (OSError, ConfigError):  # no scene, or its file was removed after it was read
        return ""
    return f"{Path(scene).stem}#{zlib.crc32(data):08x}"
