"""A node beside the rig: it calls services, sets parameters, publishes, listens, and waits."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.publisher import Publisher
from std_srvs.srv import Trigger

from cam_rig.errors import RunError
from cam_rig.messages import topics
from cam_rig.nodes.convert import message_class, qos
from cam_rig.runner.node_table import ENTRIES

#: Wall time (s) after which what has not come true never will, however busy the machine.
PATIENCE_S = 300.0
#: Wall time (s) between two looks at a condition.
POLL_S = 0.02
#: Wall time (s) without an answer of a service after which it is asked again.
ANSWER_S = 5.0
#: Messages that wait for one who listens, of a topic that is not the rig's.
DEPTH = 1000
_RIG_TOPICS = {topic.name: topic for topic in topics.TOPICS}


class RigClient:
    """A node in a context and ROS domain of its own; messages are taken while it waits.

    ``node`` is for subscriptions and clients of your own, ``context`` for nodes to `add_node`.
    """

    def __init__(self, domain: int, patience: float = PATIENCE_S, name: str = "test") -> None:
        self.patience = patience
        self.context = rclpy.Context()
        rclpy.init(args=[], context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._publishers: dict[str, Publisher] = {}

    def __enter__(self) -> RigClient:
        return self

    def __exit__(self, *_error: object) -> None:
        nodes = self._executor.get_nodes()
        self._executor.shutdown()
        for node in nodes:
            node.destroy_node()
        self.context.shutdown()

    def add_node(self, node: Node) -> None:
        """Spin a node of yours, made with ``context=rig.context``, whenever the rig waits."""
        self._executor.add_node(node)

    def spin(self, seconds: float = 0.0) -> None:
        """Take one message that has arrived, or arrives within a wall time (s)."""
        self._executor.spin_once(timeout_sec=seconds)

    def wait_for(self, condition: Callable[[], Any], what: str = "the condition") -> Any:
        """Take messages until a condition is true; what it gave; RunError after ``patience``."""
        deadline = time.monotonic() + self.patience
        while not (found := condition()):
            if time.monotonic() > deadline:
                raise RunError(f"{what}: did not come true within {self.patience:g} s")
            self.spin(POLL_S)
        return found

    def listen(
        self, topic: str, kind: Any = None, accept: Callable[[Any], Any] = lambda _message: True
    ) -> list[Any]:
        """A list that grows by each message of a topic that ``accept`` takes, while the rig waits.

        ``kind`` is its type; not needed for one of the rig. A latched topic's history comes first.
        """
        heard: list[Any] = []

        def take(message: Any) -> None:
            if accept(message):
                heard.append(message)

        self._subscribe(topic, kind, take)
        return heard

    def wait_for_message(
        self, topic: str, accept: Callable[[Any], Any] = lambda _message: True, kind: Any = None
    ) -> Any:
        """The first message of a topic that ``accept`` takes; RunError after ``patience``."""
        heard: list[Any] = []
        subscription = self._subscribe(topic, kind, heard.append)
        try:
            return self.wait_for(partial(_first, heard, accept), f"a message on {topic}")
        finally:
            self.node.destroy_subscription(subscription)

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message as soon as somebody subscribes to its topic."""
        if topic not in self._publishers:
            publisher = self.node.create_publisher(type(message), topic, DEPTH)
            self._publishers[topic] = publisher
        self.wait_for(self._publishers[topic].get_subscription_count, f"a subscriber to {topic}")
        self._publishers[topic].publish(message)

    def call(self, service: str) -> str:
        """Call a std_srvs/Trigger, as ``/cam_drive/stop``; its words, RunError if it refuses."""
        answer = self.ask(Trigger, service, Trigger.Request())
        if not answer.success:
            raise RunError(f"{service}: {answer.message}")
        return str(answer.message)

    def ask(self, kind: Any, service: str, request: Any) -> Any:
        """A service's answer to a request.

        The request is repeated where no answer comes: a service that has not discovered this
        client yet, as on a busy machine, drops its answer. All services of the rig may be asked
        twice.
        """
        client: Any = self.node.create_client(kind, service)
        asked: list[tuple[float, Any]] = []

        def answered() -> Any:
            if not asked or time.monotonic() - asked[-1][0] > ANSWER_S:
                asked.append((time.monotonic(), client.call_async(request)))
            return next((future for _, future in asked if future.done()), None)

        try:
            self.wait_for(client.service_is_ready, f"service {service}")
            return self.wait_for(answered, f"an answer of {service}").result()
        finally:
            self.node.destroy_client(client)

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter, such as ``("cam_drive", "rpm", 320.0)``; RunError if it is refused."""
        wanted = [Parameter(name, value=value).to_parameter_msg()]
        request = SetParameters.Request(parameters=wanted)
        result = self.ask(SetParameters, f"/{node}/set_parameters", request).results[0]
        if not result.successful:
            raise RunError(f"{node}: {name}: {result.reason}")

    def get_parameter(self, node: str, name: str) -> Any:
        """A parameter's value."""
        request = GetParameters.Request(names=[name])
        values = self.ask(GetParameters, f"/{node}/get_parameters", request).values
        return parameter_value_to_python(values[0])

    def _subscribe(self, topic: str, kind: Any, take: Callable[[Any], Any]) -> Any:
        how: Any = DEPTH
        if (known := _RIG_TOPICS.get(topic)) is not None:
            kind, how = kind or message_class(known), qos(known, histories=len(ENTRIES))
        elif kind is None:
            raise TypeError(f"{topic}: is no topic of the rig, so its type must be given: kind=...")
        return self.node.create_subscription(kind, topic, take, how)


def _first(heard: list[Any], accept: Callable[[Any], Any]) -> Any:
    """The first accepted message; those before it are forgotten."""
    while heard:
        if accept(message := heard.pop(0)):
            return message
    return None
