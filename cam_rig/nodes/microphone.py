"""Microphone node: computes sound pressure and level from the contact force."""

from __future__ import annotations

from pathlib import Path

from rclpy.parameter import Parameter
from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray

from cam_rig.live.queues import TickMatcher
from cam_rig.live.state_validation import StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import block_of, cam_state_of
from cam_rig.nodes.base.diagnostics import OK, WARN
from cam_rig.nodes.base.rig_node import RigNode
from cam_rig.nodes.convert import to_header
from cam_rig.nodes.parameters import WEIGHTING_PARAMETERS
from cam_rig.simulation.meter import MeterSimulator
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import tick_count
from cam_rig.simulation.simulate import MicrophoneSimulator


class Microphone(RigNode):
    """Publishes sound level (dB) and sound pressure (Pa, r.m.s.) for each tick.

    A tick is the time between two cam states.
    """

    waits_for = ("cam_drive", "follower")

    def __init__(self) -> None:
        super().__init__("microphone")
        loaded = open_scene(Path(self.settings["scene"]))
        self.total_ticks = tick_count(loaded.scene)
        self._source, self._meter = MicrophoneSimulator.of(loaded), MeterSimulator.of(loaded)
        self._meter.weigh(*(self.settings[name] for name in WEIGHTING_PARAMETERS))
        self._validator = StateValidator.of(loaded.scene)
        self._matcher = TickMatcher(self._source.sample_rate)
        self.add_post_set_parameters_callback(self._on_parameters)
        self._level_publisher = self.advertise(topics.LEVEL)
        self._pressure_publisher = self.advertise(topics.PRESSURE)
        self.subscribe(topics.FOLLOWER_SAMPLES, self._on_samples)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(f"measuring {self._meter.quantity}, {self.activity().text}")

    def _on_parameters(self, parameters: list[Parameter]) -> None:
        """Apply new weightings, which take effect with the next tick.

        A tick is the time between two cam states.
        """
        if any(parameter.name in WEIGHTING_PARAMETERS for parameter in parameters):
            self._meter.weigh(*(self.get_parameter(name).value for name in WEIGHTING_PARAMETERS))

    def _on_state(self, message: JointState) -> None:
        state = cam_state_of(message)
        self._validator.validate(state)
        self._matcher.add_state(state)
        self._process_ticks()

    def _on_samples(self, message: Float64MultiArray) -> None:
        self._matcher.add_block(block_of(message))
        self._process_ticks()

    def _process_ticks(self) -> None:
        for start, end, rows in self._matcher.complete():
            self.ticks += 1
            speed = start.until(end).mean_speed
            pressure, reading = self._source.listen(rows, speed), self._meter.read(rows, speed)
            level, text = (WARN, "overload") if reading.overload else (OK, "hears")
            values = {topics.QUANTITY: self._meter.quantity}
            text = f"{text} {self._meter.quantity}"
            self.diagnostics.report(end.time_ns, level, text, values)
            message = FluidPressure(header=to_header(end.time_ns, "microphone"))
            message.fluid_pressure = pressure
            # level first: the pressure acknowledges the tick to the drive
            self._level_publisher.publish(Float64(data=reading.level))
            self._pressure_publisher.publish(message)
