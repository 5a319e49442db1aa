"""The law server as the drive sees it: requests for cams, and reports of mounted ones."""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

from cam_rig.errors import RefusedError
from cam_rig.messages.topics import PARAMETER_EVENTS
from cam_rig.nodes.common.rig_node import RigNode

#: Of the drive's own namespace.
LAW_SERVER = "law_server"


class LawServerClient:
    """Calls the law server for a node.

    Parameters
    ----------
    refused : called with a cam that the law server refuses, and the reason
    """

    def __init__(self, node: RigNode, refused: Callable[[str, str], None]) -> None:
        self._node, self._refused = node, refused
        self._client = AsyncParameterClient(node, LAW_SERVER)

    def request(self, cam: str) -> bool:
        """Request a cam; False while the law server's services are not there."""
        if not self._client.services_are_ready():
            return False
        future = self._client.set_parameters([Parameter("cam", value=cam)])
        future.add_done_callback(lambda done: self._on_reply(cam, done))
        return True

    def _on_reply(self, cam: str, future: Future) -> None:
        response = future.result()
        if response is not None and not response.results[0].successful:
            self._refused(cam, response.results[0].reason)

    def on_mounted(self, expected: Callable[[str], bool], mounted: Callable[[str], None]) -> None:
        """Call ``mounted`` with each cam that is mounted from now on, as requested or overridden.

        Any program can publish a parameter event. One that is not ``expected`` counts only when the
        law server itself confirms it.
        """
        server = f"{self._node.get_namespace().rstrip('/')}/{LAW_SERVER}"

        def on_event(event: ParameterEvent) -> None:
            if event.node == server:
                for changed in (p for p in event.changed_parameters if p.name == "cam"):
                    cam = str(parameter_value_to_python(changed.value))
                    if expected(cam):
                        mounted(cam)
                    else:
                        self._verify(cam, mounted)

        self._node.subscribe(PARAMETER_EVENTS, on_event)

    def _verify(self, cam: str, mounted: Callable[[str], None]) -> None:
        def on_reply(future: Future) -> None:
            response = future.result()
            values = [] if response is None else [value.string_value for value in response.values]
            if values == [cam]:
                mounted(cam)
            else:
                self._node.refuse(RefusedError(f"{PARAMETER_EVENTS.name}: {cam!r} is not mounted"))

        if self._client.services_are_ready():
            self._client.get_parameters(["cam"]).add_done_callback(on_reply)
