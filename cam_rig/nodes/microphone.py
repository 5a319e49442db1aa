"""The microphone: from the contact force of each tick to sound pressure and level."""

from __future__ import annotations

from pathlib import Path

from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray

from cam_rig.live.queues import TickMatcher
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of
from cam_rig.nodes.convert import OK, WARN, ResendBuffer, to_header, weightings
from cam_rig.nodes.rig_node import RigNode
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import MicrophoneSimulator
from cam_rig.simulation.sound import MeterSimulator


class Microphone(RigNode):
    """Publishes /microphone/level (dB) and /microphone/pressure (Pa, r.m.s.) for each tick."""

    waits_for = ("cam_drive", "follower")

    def __init__(self) -> None:
        super().__init__("microphone")
        loaded = open_scene(Path(self.given["scene"]))
        self._source, self._meter = MicrophoneSimulator.of(loaded), MeterSimulator.of(loaded)
        self._meter.weigh(self.given["frequency_weighting"], self.given["time_weighting"])
        begin_ns = 0
        if saved := self.restore():
            begin_ns, self._source.state, self._meter.state = saved[0]
            self.set_parameters(weightings(self._meter.quantity))
        self._save(begin_ns, -1)  # to go back to before the first tick
        self._validator = StateValidator.of(loaded.scene)
        self._ticks = TickMatcher(self._source.sample_rate, begin_ns)
        self.add_post_set_parameters_callback(self._on_parameters)
        self._level, self._pressure = map(self.publisher, (topics.LEVEL, topics.PRESSURE))
        self._sent = ResendBuffer()
        self.subscribe(topics.FOLLOWER_SAMPLES, self._on_samples)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(f"measuring {self._meter.quantity}, {self.activity().words}")

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        """Set another weighting from the next tick on."""
        if any(parameter.name.endswith("_weighting") for parameter in parameters):
            names = ("frequency_weighting", "time_weighting")
            self._meter.weigh(*(self.get_parameter(name).value for name in names))

    def _on_state(self, message: JointState) -> None:
        state = cam_state_of(message)
        if self._validator.admit(state) is Admission.SEEN:
            self._sent.resend(state.time_ns)
        else:
            self._ticks.add_state(state)
        self._listen()

    def _on_samples(self, message: Float64MultiArray) -> None:
        self._ticks.add_block(block_of(message))
        self._listen()

    def _listen(self) -> None:
        for start, end, rows in self._ticks.complete():
            self.ticks += 1
            speed = start.until(end).mean_speed
            pressure, reading = self._source.listen(rows, speed), self._meter.read(rows, speed)
            level, words = (WARN, "overload") if reading.overload else (OK, "hears")
            values = {topics.QUANTITY: self._meter.quantity}
            self.health.report(end.time_ns, level, f"{words} {self._meter.quantity}", values)
            message = FluidPressure(header=to_header(end.time_ns, "microphone"))
            message.fluid_pressure = pressure
            messages = [(self._level, Float64(data=reading.level)), (self._pressure, message)]
            self._sent.publish(end.time_ns, messages)
            self._save(end.time_ns, end.time_ns)

    def _save(self, done_ns: int, stamp_ns: int) -> None:
        if self.checkpoint.enabled:  # a meter's state is large
            self.save((done_ns, self._source.state, self._meter.state), stamp_ns)
