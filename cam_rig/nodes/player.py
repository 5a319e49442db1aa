"""The player: publishes a recorded drive's and law server's messages to live nodes."""

from __future__ import annotations

from pathlib import Path

from rclpy.parameter_client import AsyncParameterClient

from cam_rig.bag.replay import PLAYED, Played, played
from cam_rig.live.flow_control import FlowControl
from cam_rig.messages import topics
from cam_rig.nodes.clock_source import ClockSource
from cam_rig.nodes.convert import weightings
from cam_rig.nodes.parameters import ESSENTIAL
from cam_rig.runner.node_table import held_by


class Player(ClockSource):
    """Publishes the recorded cam states and laws, byte by byte, as fast as they are answered."""

    def __init__(self) -> None:
        super().__init__("player")
        self._messages = played(Path(self.given["bag"]))
        self._next: Played | None = next(self._messages, None)
        self._sent, self._quantity, self._asked = 0, "", ""
        self._microphone = AsyncParameterClient(self, "microphone")
        known = {topics.CLOCK: self._clock_out, topics.CAM_STATE: self._state_out}
        self._out = {t: known.get(t) or self.publisher(t) for t in PLAYED}
        self.publish_factor(None)
        consumers = list(ESSENTIAL)
        self._flow = FlowControl(consumers)
        self.begin(consumers, self._flow)

    def send_next(self) -> bool:
        """Send the next state and the messages that belong to it, if it may go out."""
        if (now := self._next) is None or not self._flow.may_send() or not self._weighed(now):
            return False
        self._flow.sent(now.state.time_ns)
        for topic, cdr in now.messages:
            self._out[topic].publish(cdr)
        self.note_sent(now.state, self._sent)
        self._sent += 1
        self._next = next(self._messages, None)
        return True

    def _weighed(self, now: Played) -> bool:
        """Whether the microphone is set as it was for this tick; sets it between two ticks."""
        wanted = now.quantity or self._quantity
        if wanted == self._quantity:
            return True
        if self._flow.in_flight or not self._microphone.services_are_ready():
            return False
        if wanted != self._asked:
            self._asked = wanted
            answer = self._microphone.set_parameters(weightings(wanted))
            answer.add_done_callback(lambda _: self._set_to(wanted))
        return False

    def _set_to(self, quantity: str) -> None:
        self._quantity = quantity
        self.turn()

    def is_done(self) -> bool:
        """Whether every state is sent and every tick acknowledged."""
        return self._next is None and self._flow.in_flight == 0

    def stuck(self) -> str:
        """What is missing, in words."""
        return f"{self._sent} states from: {held_by(self._flow.behind())}"
