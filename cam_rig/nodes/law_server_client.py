"""The law server as the drive sees it: asked for cams, heard when one is mounted."""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future

#: Of the drive's own namespace.
LAW_SERVER = "law_server"


class LawServerClient:
    """Speaks to the law server for a node.

    Parameters
    ----------
    refused : told of a cam that the law server does not have, and of the reason
    """

    def __init__(self, node: Node, refused: Callable[[str, str], None]) -> None:
        self._node, self._refused = node, refused
        self._client = AsyncParameterClient(node, LAW_SERVER)

    def ask_for(self, cam: str) -> bool:
        """Ask for a cam; False while nobody is there to be asked."""
        if not self._client.services_are_ready():
            return False
        answer = self._client.set_parameters([Parameter("cam", value=cam)])
        answer.add_done_callback(lambda answered: self._on_answer(cam, answered))
        return True

    def _on_answer(self, cam: str, answered: Future) -> None:
        response = answered.result()
        if response is not None and not response.results[0].successful:
            self._refused(cam, response.results[0].reason)

    def tell(self, mounted: Callable[[str], None]) -> None:
        """From now on tell of each cam that is mounted, by a hand or as asked."""
        server = f"{self._node.get_namespace().rstrip('/')}/{LAW_SERVER}"

        def heard(event: ParameterEvent) -> None:
            if event.node == server:
                for changed in (p for p in event.changed_parameters if p.name == "cam"):
                    mounted(str(parameter_value_to_python(changed.value)))

        events = qos_profile_parameter_events
        self._node.create_subscription(ParameterEvent, "/parameter_events", heard, events)
