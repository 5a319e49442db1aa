"""ROS 2 client of a rig for tests: services, parameters, topics, and waiting for conditions."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, cast

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

#: Default wall time (s) after which a wait fails. It is ample for a busy machine.
TIMEOUT_S = 300.0
#: Period (s, wall clock) at which a condition is evaluated while a test waits for it.
POLL_S = 0.02
#: Wall time (s) without an answer after which the request to a service is repeated.
ANSWER_TIMEOUT_S = 5.0
#: Queue depth (messages) of subscriptions to topics that do not belong to the rig.
QUEUE_DEPTH = 1000
#: Topics of the rig by name.
_RIG_TOPICS = {topic.name: topic for topic in topics.TOPICS}


class RigClient:
    """Client node in a separate rclpy context. It processes messages while it waits.

    Parameters
    ----------
    domain : int
        ROS domain of the rig.
    timeout : float
        Wall time (s) after which a wait raises RunError.
    name : str
        Name of the node.

    Attributes
    ----------
    node : rclpy.node.Node
        Node for further subscriptions and clients.
    context : rclpy.Context
        Context for nodes that are added by `add_node`.
    """

    def __init__(self, domain: int, timeout: float = TIMEOUT_S, name: str = "test") -> None:
        self.timeout = timeout
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
        """Spin another node, made with ``context=rig.context``, while this client waits."""
        self._executor.add_node(node)

    def spin(self, seconds: float = 0.0) -> None:
        """Process one message, waiting for it for at most `seconds` of wall time."""
        self._executor.spin_once(timeout_sec=seconds)

    def wait_for(self, condition: Callable[[], Any], what: str = "the condition") -> Any:
        """Process messages until a condition is true.

        Parameters
        ----------
        condition : callable
            Function without arguments.
        what : str
            Name of the condition in an error message.

        Returns
        -------
        object
            First true value of the condition.

        Raises
        ------
        RunError
            If the condition is not true within `timeout`.
        """
        deadline = time.monotonic() + self.timeout
        while not (value := condition()):
            if time.monotonic() > deadline:
                raise RunError(f"{what}: not reached within {self.timeout:g} s")
            self.spin(POLL_S)
        return value

    def listen(
        self, topic: str, kind: Any = None, accept: Callable[[Any], Any] = lambda _message: True
    ) -> list[Any]:
        """Subscribe to a topic, and return the list of its messages.

        Received messages are appended to the list while this client waits.

        Parameters
        ----------
        topic : str
            Name of the topic. The list starts with the history of a latched topic.
        kind : type, optional
            Message type, required if the topic does not belong to the rig.
        accept : callable
            Function of a message. Messages for which it is false are ignored.
        """
        _, messages = self._subscribe(topic, kind, accept)
        return messages

    def wait_for_message(
        self, topic: str, accept: Callable[[Any], Any] = lambda _message: True, kind: Any = None
    ) -> Any:
        """Wait for the first message of a topic that `accept` accepts, and return it.

        The parameters are those of `listen`.

        Raises
        ------
        RunError
            If no such message arrives within `timeout`.
        """
        subscription, messages = self._subscribe(topic, kind, accept)
        try:
            return self.wait_for(lambda: messages, f"a message on {topic}")[0]
        finally:
            self.node.destroy_subscription(subscription)

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message as soon as its topic has a subscriber."""
        if topic not in self._publishers:
            publisher = self.node.create_publisher(type(message), topic, QUEUE_DEPTH)
            self._publishers[topic] = publisher
        self.wait_for(self._publishers[topic].get_subscription_count, f"a subscriber to {topic}")
        self._publishers[topic].publish(message)

    def call(self, service: str) -> str:
        """Call a std_srvs/Trigger service, such as ``/cam_drive/stop``. Return its message.

        Raises
        ------
        RunError
            If the service does not report success.
        """
        answer = self.ask(Trigger, service, Trigger.Request())
        if not answer.success:
            raise RunError(f"{service}: {answer.message}")
        return str(answer.message)

    def ask(self, kind: Any, service: str, request: Any) -> Any:
        """Send a request to a service of type `kind`, and return its answer.

        The request is repeated after `ANSWER_TIMEOUT_S`. A service drops its answer if it has not
        yet discovered this client, as on a busy machine. All services of the rig can receive a
        request twice.
        """
        client: Any = self.node.create_client(kind, service)
        requests: list[tuple[float, Any]] = []

        def completed() -> Any:
            if not requests or time.monotonic() - requests[-1][0] > ANSWER_TIMEOUT_S:
                requests.append((time.monotonic(), client.call_async(request)))
            return next((future for _, future in requests if future.done()), None)

        try:
            self.wait_for(client.service_is_ready, f"service {service}")
            return self.wait_for(completed, f"an answer of {service}").result()
        finally:
            self.node.destroy_client(client)

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of a node, such as ``("cam_drive", "rpm", 320.0)``.

        Raises
        ------
        RunError
            If the node refuses the value.
        """
        parameters = [Parameter(name, value=value).to_parameter_msg()]
        request = SetParameters.Request(parameters=parameters)
        result = self.ask(SetParameters, f"/{node}/set_parameters", request).results[0]
        if not result.successful:
            raise RunError(f"{node}: {name}: {result.reason}")

    def get_parameter(self, node: str, name: str) -> Any:
        """Return the present value of a parameter of a node."""
        request = GetParameters.Request(names=[name])
        values = self.ask(GetParameters, f"/{node}/get_parameters", request).values
        return parameter_value_to_python(values[0])

    def _subscribe(
        self, topic: str, kind: Any, accept: Callable[[Any], Any]
    ) -> tuple[Any, list[Any]]:
        """Return a subscription, and the list of the accepted messages."""
        messages, profile = list[Any](), cast("Any", QUEUE_DEPTH)
        if (rig_topic := _RIG_TOPICS.get(topic)) is not None:
            kind, profile = kind or message_class(rig_topic), qos(rig_topic, histories=len(ENTRIES))
        elif kind is None:
            raise TypeError(f"{topic} is not a topic of the rig; give its message type by kind=...")

        def take(message: Any) -> None:
            if accept(message):
                messages.append(message)

        return self.node.create_subscription(kind, topic, take, profile), messages
