"""Player node: publishes the cam states and laws of a bag to live nodes."""

from __future__ import annotations

from pathlib import Path

from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient

from cam_rig.bag.replay import REPLAYED_TOPICS, ReplayStep, replay_steps
from cam_rig.live.flow_control import FlowControl
from cam_rig.messages import topics
from cam_rig.nodes.clock_source import ClockSource
from cam_rig.nodes.parameters import ESSENTIAL, WEIGHTING_PARAMETERS
from cam_rig.runner.node_table import blocking_text


class Player(ClockSource):
    """Publishes recorded cam states and laws, at the pace of the consumers.

    The published messages are byte for byte those of the bag. If a tick was recorded with other
    frequency and time weightings, the microphone's parameters are set before the tick. A tick is
    the time between two cam states.
    """

    def __init__(self) -> None:
        super().__init__("player")
        self._messages = replay_steps(Path(self.settings["input_uri"]))
        self._next: ReplayStep | None = next(self._messages, None)
        self._sent = 0
        #: Sound level quantity (such as LAF) that the microphone measures, and the quantity that
        #: was requested last.
        self._quantity = self._requested_quantity = ""
        self._microphone = AsyncParameterClient(self, "microphone")
        self._publishers_by_topic = {
            topics.CLOCK: self._clock_publisher,
            topics.CAM_STATE: self._state_publisher,
        }
        for topic in REPLAYED_TOPICS:
            if topic not in self._publishers_by_topic:
                self._publishers_by_topic[topic] = self.advertise(topic)
        self.publish_factor(None)
        consumers = list(ESSENTIAL)
        self.start_flow(consumers, FlowControl(consumers))

    def send_next(self) -> bool:
        """Publish the next cam state and its messages, or return False if it must wait."""
        step = self._next
        if step is None or not self._flow.may_send() or not self._is_weighted(step):
            return False
        self._flow.record_sent(step.state.time_ns)
        for topic, cdr in step.messages:
            self._publishers_by_topic[topic].publish(cdr)
        self.report_sent(step.state, self._sent)
        self._sent += 1
        self._next = next(self._messages, None)
        return True

    def _is_weighted(self, step: ReplayStep) -> bool:
        """Return True if the microphone measures the quantity that a step recorded.

        The quantity is a sound level such as LAF. If it differs, the weightings of the microphone
        are set as soon as no tick is being processed.
        """
        quantity = step.quantity or self._quantity
        if quantity == self._quantity:
            return True
        # between two ticks only, because weightings apply to whole ticks
        if self._flow.in_flight or not self._microphone.services_are_ready():
            return False
        if quantity != self._requested_quantity:
            self._requested_quantity = quantity

            def on_reply(_future: object) -> None:
                self._quantity = quantity
                self.send_due()

            # a quantity such as LAF contains both weightings
            weightings = zip(WEIGHTING_PARAMETERS, quantity[1:3], strict=True)
            parameters = [Parameter(name, value=value) for name, value in weightings]
            self._microphone.set_parameters(parameters).add_done_callback(on_reply)
        return False

    def is_done(self) -> bool:
        """Return True if every recorded cam state is published and its tick acknowledged.

        A tick is the time between two states.
        """
        return self._next is None and self._flow.in_flight == 0

    def pending_text(self) -> str:
        """Return the progress, and the nodes that are waited for, for an error text."""
        return f"{self._sent} states from: {blocking_text(self._flow.behind())}"
