"""The panel's node: passes a page's commands on to the other nodes, and what they say back."""

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

#: Wall time (s) between two looks for commands, and between what is told.
LOOK_EVERY_S = 0.02
#: Exchanges between two requests for the parameters of a node that has not answered.
EXCHANGES_PER_REQUEST = 25


class Panel(RigNode):
    """Lines for the messages that a page shows, those of a look at once; commands as lines."""

    def __init__(self) -> None:
        super().__init__("panel")
        self._line = LineSocket(Path(self.settings["socket"]))
        self._nodes = {name: AsyncParameterClient(self, name) for name in LIVE}
        self._drive: dict[str, Any] = {
            s: self.create_client(Trigger, f"cam_drive/{s}") for s in ABOUT["cam_drive"].services
        }
        self._unread, self._exchanges = set(LIVE), 0
        self._sound: Any = None
        self.subscribe(topics.CAM_STATE, self._on_state)
        self._stamps, self._levels = deque[int](), deque[float]()
        self.subscribe(topics.PRESSURE, self._on_pressure)
        self.subscribe(topics.LEVEL, self._on_level)
        self.subscribe(topics.DIAGNOSTICS, self._on_diagnostics)
        self.subscribe(topics.PARAMETER_EVENTS, self._on_parameters)
        self.create_wall_timer(LOOK_EVERY_S, self._exchange)

    def _exchange(self) -> None:
        self._exchanges += 1
        # A request or an answer can be lost during discovery, so it is repeated until answered.
        due = self._unread if self._exchanges % EXCHANGES_PER_REQUEST == 1 else ()
        for name in [n for n in due if self._nodes[n].services_are_ready()]:
            asked = self._nodes[name].get_parameters(list(LIVE[name]))
            asked.add_done_callback(partial(self._on_values, name))
        for command in self._line.receive():
            self._obey(command)
        self._line.flush()

    def _obey(self, command: dict[str, Any]) -> None:
        if "listen" in command:
            return self._listen(bool(command["listen"]))
        number = command.get("number")
        if "call" in command:
            client = self._drive[command["call"]]
            if client.service_is_ready():
                call = client.call_async(Trigger.Request())
                call.add_done_callback(partial(self._on_called, number))
                return None
        elif self._nodes[command["node"]].services_are_ready():
            wanted = Parameter(command["name"], value=command["value"])
            call = self._nodes[command["node"]].set_parameters([wanted])
            call.add_done_callback(partial(self._on_set, number))
            return None
        return self._answer(number, False, f"{command.get('node', 'cam_drive')} does not answer")

    def _answer(self, number: Any, success: bool, words: str) -> None:
        self._line.send({"answer": number, "success": success, "words": words})

    def _on_called(self, number: Any, done: Any) -> None:
        reply = done.result()
        self._answer(number, reply.success, reply.message)

    def _on_set(self, number: Any, done: Any) -> None:
        (reply,) = done.result().results
        self._answer(number, reply.successful, reply.reason)

    def _on_values(self, node: str, done: Any) -> None:
        self._unread.discard(node)
        values = map(parameter_value_to_python, done.result().values)
        self._line.send({"node": node, "values": dict(zip(LIVE[node], values, strict=True))})

    def _on_parameters(self, event: ParameterEvent) -> None:
        node = event.node.rpartition("/")[2]
        values = {p.name: parameter_value_to_python(p.value) for p in event.changed_parameters}
        if values and event.node == self.resolve_service_name(node) and node in LIVE:
            self._line.send({"node": node, "values": values})

    def _on_state(self, message: JointState) -> None:
        self.ticks += 1
        state = cam_state_of(message)
        self.diagnostics.newest_ns = state.time_ns
        turned = {"time_ns": state.time_ns, "cam": state.cam, "rpm": to_rpm(state.speed)}
        self._line.put({"state": turned | {"angle": state.angle}})

    def _on_pressure(self, message: FluidPressure) -> None:
        self._stamps.append(stamp_ns(message.header.stamp))
        self._read()

    def _on_level(self, message: Float64) -> None:
        self._levels.append(message.data)
        self._read()

    def _read(self) -> None:
        """The n-th level belongs to the stamp of the n-th pressure."""
        while self._stamps and self._levels:
            read = {"time_ns": self._stamps.popleft(), "level": self._levels.popleft()}
            self._line.put(read)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {pair.key: pair.value for pair in status.values}
            self._line.put({"health": [status.name, status.level[0], values]})

    def _on_samples(self, message: Float64MultiArray) -> None:
        rows = block_of(message)
        data = base64.b64encode(np.ascontiguousarray(rows, "<f8").tobytes()).decode("ascii")
        self._line.put({"samples": data, "shape": rows.shape})

    def _listen(self, listen: bool) -> None:
        """Subscribe to the samples while somebody listens."""
        if listen and self._sound is None:
            from_now_on = replace(topics.FOLLOWER_SAMPLES, latched=False)
            self._sound = self.subscribe(from_now_on, self._on_samples)
        elif not listen and self._sound is not None:
            self.destroy_subscription(self._sound)
            self._sound = None

    def summary(self) -> str:
        """Return the text that is logged when the node ends without an error."""
        return f"received {self.ticks} states"

    def close(self) -> None:
        """Close the socket."""
        self._line.close()
