"""Running a node: how every node takes messages, watches its topics, and ends."""

from __future__ import annotations

import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, cast

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from cam_rig.errors import CamRigError, ConfigError, RunError, did_you_mean
from cam_rig.files import read_bytes
from cam_rig.live.checkpoint import Checkpoint
from cam_rig.messages.topics import DIAGNOSTICS, HEARTBEAT, READY, TOPICS, Topic, second_publisher
from cam_rig.nodes.convert import (
    OK,
    SILENT_S,
    Activity,
    Diagnostics,
    guarded,
    message_class,
    qos,
    require_length,
    take_rest,
    to_diagnosis,
)
from cam_rig.nodes.parameters import PARAMETERS, Spec
from cam_rig.nodes.run_end import EndWithTheDrive, publishers
from cam_rig.runner.node_table import STAY
from cam_rig.runner.resources import namespace_named
from cam_rig.schema.load import MAX_BYTES

# Publishing beside subscribers that hold a writer up: nothing the rig needs is left out.

#: Wall time (s) that a message may wait for its writer. DDS gives up after 0.1 s each time: the
#: writer is busy while it sends again what a reliable subscriber, full and never read, refuses.
MAX_HELD_S = 60.0


class RigPublisher(Publisher):
    """A publisher that does not lose a message because its writer is held up."""

    def publish(self, msg: Any) -> None:
        """Publish a message, when its writer is free."""
        deadline = time.monotonic() + MAX_HELD_S
        while not self.offer(msg):
            if time.monotonic() > deadline:
                raise RunError(
                    f"{self.topic_name}: cannot be published for {MAX_HELD_S:g} s; does a "
                    "subscriber take nothing?"
                )

    def offer(self, msg: Any) -> bool:
        """Publish a message unless its writer is held up; whether it is published."""
        try:
            super().publish(msg)
        except rclpy_implementation.RCLError:
            return False
        return True


# Parameters as rclpy has them: declared from the table, converted, checked.


def descriptor(spec: Spec) -> ParameterDescriptor:
    """What `ros2 param describe` shows; rclpy refuses what is out of range by it."""
    out = ParameterDescriptor(description=spec.description, read_only=not spec.live)
    if spec.least is not None and spec.most is not None:
        if isinstance(spec.default, int):
            whole = IntegerRange(from_value=int(spec.least), to_value=int(spec.most), step=1)
            out.integer_range = [whole]
        else:
            span = FloatingPointRange(from_value=spec.least, to_value=spec.most, step=0.0)
            out.floating_point_range = [span]
    if spec.choices:
        out.additional_constraints = f"one of: {', '.join(spec.choices)}"
    return out


def declare(node: Node, table: tuple[Spec, ...]) -> dict[str, Any]:
    """Declare a node's parameters; their values by name."""
    values = {}
    for spec in table:
        any_type = ParameterDescriptor(dynamic_typing=True)
        given = node.declare_parameter(spec.name, spec.default, any_type).value
        node.undeclare_parameter(spec.name)
        value: Any = spec.convert(given)
        spec.require(value)
        node.declare_parameter(spec.name, value, descriptor(spec), ignore_override=True)
        values[spec.name] = value
    return values


def unknown_names(node: Node, table: tuple[Spec, ...]) -> list[str]:
    """What was given for parameters of other nodes, as a file may, in words: one each."""
    known = [spec.name for spec in table]
    given = (name for name in node._parameter_overrides if not node.has_parameter(name))
    found = []
    for name in sorted(given):
        if not name.startswith("qos_overrides."):
            hint = did_you_mean(name, known)
            found.append(f"parameter {name!r} is none of this node's{hint}; it is left aside")
    return found


def convert(table: tuple[Spec, ...], parameters: list[Parameter]) -> list[Parameter]:
    """Convert what is to be set: 250 to 250.0, a factor to its text."""
    specs = {spec.name: spec for spec in table}
    return [
        Parameter(one.name, value=specs[one.name].convert(one.value)) if one.name in specs else one
        for one in parameters
    ]


# One scene for all nodes: each says which it has, and the drive refuses another.


def scene_mark(scene: str) -> str:
    """A scene's file name and a checksum of what it holds; empty where there is no such file."""
    try:
        data = read_bytes(Path(scene), MAX_BYTES)
    except (OSError, ConfigError):  # no scene is given, or its file is gone since it was read
        return ""
    return f"{Path(scene).stem}#{zlib.crc32(data):08x}"


def require_one_scene(node: str, mark: str, scene: str) -> None:
    """Refuse a node that was started with another scene than the drive."""
    own = scene_mark(scene)
    if not (mark and own) or mark == own:
        return
    theirs, ours = mark.partition("#")[0], own.partition("#")[0]
    other = "another file of that name" if theirs == ours else theirs
    raise ConfigError(
        f"scene: is {ours}, and {node} has {other}; allowed: one scene for all nodes, given to "
        f"each (-p scene:={ours})"
    )


#: Wall time (s) between two checks for other publishers on a node's topics.
WATCH_PERIOD_S = 0.25
#: Wall time (s) that the name of a newly discovered publisher's node is waited for.
NAME_TIMEOUT_S = 5.0
#: Wall time (s) between two heartbeats.
HEARTBEAT_S = 1.0


class RigNode(Node):
    """A node of the rig: it declares its parameters, and ends its process by `finish` or `fail`.

    ``given`` holds the parameters' values at the start; ``checkpoint`` is what takes the place of
    a killed predecessor, used through `save` and `restore`.
    """

    #: Whether callbacks need the publisher and number of each message, which rclpy's events
    #: executor does not pass on. The other one takes 0.1 ms more CPU time per message.
    needs_message_info = False
    #: Whom the node waits for before it has anything to do.
    waits_for: tuple[str, ...] = ("cam_drive",)
    #: Runs that this process has done before, as a node that stays.
    runs_before: ClassVar[int] = 0

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._table = PARAMETERS[name]
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.done: Future = Future()
        self.failure: CamRigError | None = None
        self.given = declare(self, self._table)
        for words in unknown_names(self, self._table):
            self.get_logger().warning(words)
        namespace_named(self.get_namespace())  # refused where it is too long for a lock's name
        if self.given.get("at_end") == STAY and self.given["checkpoint"]:
            raise ConfigError(  # a successor would go on with the run before the present one
                f"at_end: is {STAY} with a checkpoint folder, which is of one run; allowed: one of "
                "the two"
            )
        self.checkpoint = Checkpoint(self.given["checkpoint"], name)
        self.checkpoint.count_start()
        self._owned: list[Topic] = []
        #: Messages taken, ticks dealt with, signals to stop received so far.
        self.taken = self.ticks = self.interrupts = 0
        #: Who published on the rig's topics when the run ended; empty before.
        self.rig_publishers: dict[str, set[bytes]] = {}
        self.check(**{spec.name: spec.require for spec in self._table})
        self.health = Diagnostics(self.publisher(DIAGNOSTICS), name)
        # of its own, so that the history of the rig's diagnostics holds no heartbeat
        self._heartbeats = self.publisher(replace(DIAGNOSTICS, depth=1))
        self.every(HEARTBEAT_S, self._beat)
        self._ready = self.publisher(READY)
        self.every(WATCH_PERIOD_S, self._watch)
        self.listen_for_end()
        if self.runs_before:
            self.get_logger().info("stays for another run")

    def check(self, **checks: Callable[[Any], object]) -> None:
        """Refuse to set a parameter to a value for which its check raises an error."""

        def answer(parameters: list[Parameter]) -> SetParametersResult:
            try:
                for parameter in (p for p in parameters if p.name in checks):
                    checks[parameter.name](parameter.value)
            except CamRigError as error:
                return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        self.add_on_set_parameters_callback(answer)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters together, after conversion; refused, with the reason, if one is wrong."""
        try:
            wanted = convert(self._table, parameter_list)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return super().set_parameters_atomically(wanted)

    def listen_for_end(self) -> None:
        """End with the run, as the parameter at_end asks."""
        EndWithTheDrive(self)

    def activity(self) -> Activity:
        """What the node does now."""
        whom = "the next tick" if self.ticks else " and ".join(self.waits_for)
        return Activity("waiting", self.waits_for, f"waiting for {whom}")

    def _beat(self) -> None:
        """Publish what the node does, unless its diagnostics have just said so; for no bag."""
        if time.monotonic() - self.health.published_at >= SILENT_S:
            now, name = self.activity(), self.health.node + HEARTBEAT
            values = {"state": now.state, "waits_for": ", ".join(now.waits_for)}
            message = to_diagnosis(time.time_ns(), name, OK, now.words, values)
            self._heartbeats.publish(message)

    def summary(self) -> str:
        """What the node has done, in words, when it ends."""
        return f"done with {self.ticks} ticks"

    @property
    def stays(self) -> bool:
        """Whether another run is to follow this one, which has ended."""
        return bool(self.rig_publishers) and self.given.get("at_end") == STAY

    def remember_publishers(self) -> None:
        """Note who publishes for the run that ends now."""
        names = (self.resolve_topic_name(topic.relative) for topic in TOPICS if topic.owner)
        self.rig_publishers = publishers(self, *names)

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

    def publisher(self, topic: Topic) -> RigPublisher:
        """A publisher with the topic's type and quality of service."""
        if topic.owner:
            self._owned.append(topic)
        made = self.create_publisher(
            message_class(topic), topic.relative, qos(topic), publisher_class=RigPublisher
        )
        return cast("RigPublisher", made)

    def every(self, period: float, act: Callable[[], None]) -> Timer:
        """Call ``act`` with a period (s) of wall time: rig time, which the rig makes, may stand."""

        def safe() -> None:
            try:
                act()
            except CamRigError as error:
                self.fail(error)

        return self.create_timer(period, safe, clock=self._steady)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, *how: Any, **named: Any
    ) -> Any:
        """Subscribe; the one guard of every subscription, rclpy's own among them.

        A message that cannot be read or is refused (`RefusedError`) is logged as a warning, and the
        node goes on; any other of the rig's errors ends it.
        """
        safe = guarded(self, topic, callback)
        return super().create_subscription(msg_type, topic, safe, *how, **named)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **named: Any) -> Any:
        """Offer a service; an impossible request, of parameters too, has an empty answer."""

        def answer(request: Any, response: Any) -> Any:
            found = guarded(self, srv_name, callback)(request, response)
            return srv_type.Response() if found is None else found

        return super().create_service(srv_type, srv_name, answer, **named)

    def subscribe(self, topic: Topic, callback: Callable[[Any], None]) -> Any:
        """Subscribe with the topic's type and quality of service."""
        kind = message_class(topic)

        def take(cdr: bytes) -> None:
            require_length(topic, cdr)
            callback(deserialize_message(cdr, kind))
            self.taken += 1

        return self.create_subscription(kind, topic.relative, take, qos(topic), raw=True)

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
        """Publish, latched, that this node takes messages, and of which scene."""
        words = f"{self.get_name()} {scene_mark(self.given.get('scene', ''))}".rstrip()
        self._ready.publish(message_class(READY)(data=words))

    def publishers_of(self, topic: Topic) -> dict[bytes, str]:
        """The publishers of a topic, by discovery: their node's name by DDS identity.

        One of another type is none: DDS connects it to nobody. A new node's name may be discovered
        after its publisher: it is waited for, as only a program that is no ROS node never has one.
        """
        deadline = time.monotonic() + NAME_TIMEOUT_S
        while True:
            found = {
                bytes(info.endpoint_gid): f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                for info in self.get_publishers_info_by_topic(topic.relative)
                if info.topic_type == topic.type
            }
            unnamed = {gid for gid, name in found.items() if "UNKNOWN" in name}
            if not unnamed or time.monotonic() > deadline:
                return found | dict.fromkeys(unnamed, "a program that is not a ROS node")
            time.sleep(0.02)

    def _watch(self) -> None:
        """A second publisher on a topic that this node owns ends the run."""
        for topic in self._owned:
            most = self.checkpoint.starts(topic.owner)
            if self.count_publishers(topic.relative) <= most:
                continue
            if len(names := list(self.publishers_of(topic).values())) > most:
                own = self.get_fully_qualified_name()
                others = [name for name in names if name != own] or names[1:]
                self.fail(second_publisher(topic, topic.owner, ", ".join(others)))

    def finish(self) -> None:
        """End the process with code 0."""
        if not self.done.done():
            self.done.set_result(None)

    def interrupt(self) -> None:
        """A signal to stop has come."""
        self.interrupts += 1
        self.finish()

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Take what has arrived but was not taken yet; see `take_rest`."""
        take_rest(spin_once, lambda: self.taken)

    def conclude(self, spin_once: Callable[..., None]) -> None:
        """Tell the other nodes that this one ends; called once, while it still takes messages."""

    def fail(self, error: CamRigError) -> None:
        """End the process with the error's message and code."""
        self.failure = self.failure or error
        self.finish()

    def close(self) -> None:
        """Release what the node holds; called once, after the executor has stopped."""
