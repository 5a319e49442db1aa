"""Panel node: forwards commands of a browser page to the nodes, and messages back."""

from __future__ import annotations

import base64
from collections import deque
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray
from std_srvs.srv import Trigger

from cam_rig.live.sockets import LineSocket
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of, stamp_ns
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.parameters import ABOUT, LIVE
from cam_rig.units import to_rpm

#: Period (s, wall clock) at which commands of the page are read, and queued messages are sent to
#: it.
EXCHANGE_PERIOD_S = 0.02
#: If a node has not answered a request for its parameters, the request is repeated after this
#: number of exchanges with the page.
EXCHANGES_PER_REQUEST = 25


class Panel(RigNode):
    """Exchanges commands, answers and messages with the server of a page."""

    def __init__(self) -> None:
        super().__init__("panel")
        self._socket = LineSocket(Path(self.settings["socket"]))
        self._nodes = {name: AsyncParameterClient(self, name) for name in LIVE}
        self._drive: dict[str, Any] = {
            s: self.create_client(Trigger, f"cam_drive/{s}") for s in ABOUT["cam_drive"].services
        }
        self._unread, self._exchanges = set(LIVE), 0  # nodes whose parameters are not known yet
        self._samples_subscription: Any = None
        self.subscribe(topics.CAM_STATE, self._on_state)
        self._stamps, self._levels = deque[int](), deque[float]()
        self.subscribe(topics.PRESSURE, self._on_pressure)
        self.subscribe(topics.LEVEL, self._on_level)
        self.subscribe(topics.DIAGNOSTICS, self._on_diagnostics)
        self.subscribe(topics.PARAMETER_EVENTS, self._on_parameters)
        self.create_wall_timer(EXCHANGE_PERIOD_S, self._exchange)

    def _exchange(self) -> None:
        self._exchanges += 1
        # A request or an answer can be lost during discovery, so it is repeated until answered.
        due = self._unread if self._exchanges % EXCHANGES_PER_REQUEST == 1 else ()
        for name in [n for n in due if self._nodes[n].services_are_ready()]:
            request = self._nodes[name].get_parameters(list(LIVE[name]))
            request.add_done_callback(partial(self._on_values, name))
        for command in self._socket.receive():
            self._execute(command)
        self._socket.flush()

    def _execute(self, command: dict[str, Any]) -> None:
        if "listen" in command:
            return self._set_listening(bool(command["listen"]))
        number = command.get("number")
        if "call" in command:
            client = self._drive[command["call"]]
            if client.service_is_ready():
                call = client.call_async(Trigger.Request())
                call.add_done_callback(partial(self._on_called, number))
                return None
        elif self._nodes[command["node"]].services_are_ready():
            parameter = Parameter(command["name"], value=command["value"])
            call = self._nodes[command["node"]].set_parameters([parameter])
            call.add_done_callback(partial(self._on_set, number))
            return None
        return self._answer(number, False, f"{command.get('node', 'cam_drive')} does not answer")

    def _answer(self, number: Any, success: bool, text: str) -> None:
        self._socket.send({"answer": number, "success": success, "message": text})

    def _on_called(self, number: Any, future: Any) -> None:
        reply = future.result()
        self._answer(number, reply.success, reply.message)

    def _on_set(self, number: Any, future: Any) -> None:
        (reply,) = future.result().results
        self._answer(number, reply.successful, reply.reason)

    def _on_values(self, node: str, future: Any) -> None:
        self._unread.discard(node)
        values = map(parameter_value_to_python, future.result().values)
        self._socket.send({"node": node, "values": dict(zip(LIVE[node], values, strict=True))})

    def _on_parameters(self, event: ParameterEvent) -> None:
        node = event.node.rpartition("/")[2]
        values = {p.name: parameter_value_to_python(p.value) for p in event.changed_parameters}
        if values and event.node == self.resolve_service_name(node) and node in LIVE:
            self._socket.send({"node": node, "values": values})

    def _on_state(self, message: JointState) -> None:
        self.ticks += 1
        state = cam_state_of(message)
        self.diagnostics.newest_ns = state.time_ns
        values = {"time_ns": state.time_ns, "cam": state.cam, "rpm": to_rpm(state.speed)}
        self._socket.queue({"state": values | {"angle": state.angle}})

    def _on_pressure(self, message: FluidPressure) -> None:
        self._stamps.append(stamp_ns(message.header.stamp))
        self._send_levels()

    def _on_level(self, message: Float64) -> None:
        self._levels.append(message.data)
        self._send_levels()

    def _send_levels(self) -> None:
        """Queue each sound level for the page, with its rig time.

        A level has no stamp. The n-th level belongs to the n-th stamped pressure.
        """
        while self._stamps and self._levels:
            reading = {"time_ns": self._stamps.popleft(), "level": self._levels.popleft()}
            self._socket.queue(reading)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self._socket.queue({"health": [status.name, status.level[0], values]})

    def _on_samples(self, message: Float64MultiArray) -> None:
        rows = block_of(message)
        data = base64.b64encode(np.ascontiguousarray(rows, "<f8").tobytes()).decode("ascii")
        self._socket.queue({"samples": data, "shape": rows.shape})

    def _set_listening(self, listening: bool) -> None:
        """Subscribe to the samples, which pages need to play the sound, or unsubscribe."""
        if listening and self._samples_subscription is None:
            topic = replace(topics.FOLLOWER_SAMPLES, latched=False)  # new samples only
            self._samples_subscription = self.subscribe(topic, self._on_samples)
        elif not listening and self._samples_subscription is not None:
            self.destroy_subscription(self._samples_subscription)
            self._samples_subscription = None

    def summary(self) -> str:
        """Return the text that is logged when the node ends without an error."""
        return f"received {self.ticks} states"

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
