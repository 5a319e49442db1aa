"""The law server as the drive sees it: asked for cams, heard when one is mounted."""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import qos_profile_parameter_events

#: Of the drive's own namespace.
LAW_SERVER = "law_server"


class LawServerClient:
    """Speaks to the law server for a node."""

    def __init__(self, node: Node) -> None:
        self._node, self._client = node, AsyncParameterClient(node, LAW_SERVER)

    def ask_for(self, cam: str) -> bool:
        """Ask for a cam; False while nobody is there to be asked."""
        if not self._client.services_are_ready():
            return False
        self._client.set_parameters([Parameter("cam", value=cam)])
        return True

    def tell(self, mounted: Callable[[str], None]) -> None:
        """From now on tell of each cam that is mounted, by a hand or as asked."""
        server = f"{self._node.get_namespace().rstrip('/')}/{LAW_SERVER}"

        def heard(event: ParameterEvent) -> None:
            if event.node == server:
                for changed in (p for p in event.changed_parameters if p.name == "cam"):
                    mounted(str(parameter_value_to_python(changed.value)))

        events = qos_profile_parameter_events
        self._node.create_subscription(ParameterEvent, "/parameter_events", heard, events)
