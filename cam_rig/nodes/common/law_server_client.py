"""The law server as the drive sees it: asked for cams, heard when one is mounted."""

from __future__ import annotations

from collections.abc import Callable

from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

from cam_rig.errors import RefusedError
from cam_rig.messages.topics import PARAMETER_EVENTS
from cam_rig.nodes.common.base import RigNode

#: Of the drive's own namespace.
LAW_SERVER = "law_server"


class LawServerClient:
    """Speaks to the law server for a node.

    Parameters
    ----------
    refused : told of a cam that the law server does not have, and of the reason
    """

    def __init__(self, node: RigNode, refused: Callable[[str, str], None]) -> None:
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

    def tell(self, expected: Callable[[str], bool], mounted: Callable[[str], None]) -> None:
        """From now on tell of each cam that is mounted, by an operator or as asked.

        Anybody can publish a parameter event. One that nobody ``expected`` is told of only when the
        law server itself says the same.
        """
        server = f"{self._node.get_namespace().rstrip('/')}/{LAW_SERVER}"

        def heard(event: ParameterEvent) -> None:
            if event.node == server:
                for changed in (p for p in event.changed_parameters if p.name == "cam"):
                    cam = str(parameter_value_to_python(changed.value))
                    if expected(cam):
                        mounted(cam)
                    else:
                        self._verify(cam, mounted)

        self._node.subscribe(PARAMETER_EVENTS, heard)

    def _verify(self, cam: str, mounted: Callable[[str], None]) -> None:
        def answered(future: Future) -> None:
            response = future.result()
            values = [] if response is None else [value.string_value for value in response.values]
            if values == [cam]:
                mounted(cam)
            else:
                self._node.refuse(RefusedError(f"{PARAMETER_EVENTS.name}: {cam!r} is not mounted"))

        if self._client.services_are_ready():
            self._client.get_parameters(["cam"]).add_done_callback(answered)
