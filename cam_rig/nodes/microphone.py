"""The microphone: hears the contact force of each tick."""

from __future__ import annotations

from pathlib import Path

from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray

from cam_rig.live.admission import Admission, StateValidator
from cam_rig.live.tick_matching import TickPairing
from cam_rig.messages import topics
from cam_rig.messages.codec import array_of, cam_state_of, decode_block
from cam_rig.nodes.common.base import RigNode
from cam_rig.nodes.common.convert import to_header
from cam_rig.nodes.common.diagnostics import OK, WARN
from cam_rig.nodes.common.resend import Repeats
from cam_rig.nodes.common.weightings import weightings
from cam_rig.simulation.audio import MeterSimulator
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.simulate import MicrophoneSimulator


class Microphone(RigNode):
    """Publishes /microphone/level (dB) and /microphone/pressure (Pa, r.m.s.) for each tick."""

    def __init__(self) -> None:
        super().__init__("microphone")
        loaded = open_scene(Path(self.given["scene"]))
        self._bench, self._meter = MicrophoneSimulator.of(loaded), MeterSimulator.of(loaded)
        self._meter.weigh(self.given["frequency_weighting"], self.given["time_weighting"])
        begun = 0
        if left := self.handover.oldest():
            last, self._bench.memory, self.health.said, meter = left
            begun, self._meter.memory = last.time_ns, meter
            self.set_parameters(weightings(self._meter.quantity))
        self._gate = StateValidator.of(loaded.scene)
        self._ticks = TickPairing(self._bench.sample_rate, begun)
        self.add_post_set_parameters_callback(self._on_parameters)
        self._level, self._pressure = map(self.publisher, (topics.LEVEL, topics.PRESSURE))
        self._repeats = Repeats()
        self.subscribe(topics.FOLLOWER_SAMPLES, self._on_samples)
        self.subscribe(topics.CAM_STATE, self._on_state)

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        """Another weighting from the next tick on."""
        if any(parameter.name.endswith("_weighting") for parameter in parameters):
            names = ("frequency_weighting", "time_weighting")
            self._meter.weigh(*(self.get_parameter(name).value for name in names))

    def _on_state(self, message: JointState) -> None:
        state = cam_state_of(message)
        if self._gate.admit(state) is Admission.SEEN:
            self._repeats.again(state.time_ns)
        else:
            self._ticks.add_state(state)
        self._listen()

    def _on_samples(self, message: Float64MultiArray) -> None:
        self._ticks.add_block(decode_block(*array_of(message)))
        self._listen()

    def _listen(self) -> None:
        for start, end, rows in self._ticks.complete():
            speed = start.until(end).mean_speed
            pressure, reading = self._bench.listen(rows, speed), self._meter.read(rows, speed)
            level, words = (WARN, "overload") if reading.overload else (OK, "hears")
            self.health.report(end.time_ns, level, f"{words} {self._meter.quantity}")
            heard = FluidPressure(header=to_header(end.time_ns, "microphone"))
            heard.fluid_pressure = pressure
            said = [(self._level, Float64(data=reading.level)), (self._pressure, heard)]
            self._repeats.publish(end.time_ns, said)
            if self.handover.kept:
                mine = (end, self._bench.memory, self.health.said, self._meter.memory)
                self.handover.keep(mine, end.time_ns)
