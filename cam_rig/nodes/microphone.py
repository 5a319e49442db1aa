"""The microphone: hears the contact force of each tick."""

from __future__ import annotations

from sensor_msgs.msg import FluidPressure, JointState
from std_msgs.msg import Float64, Float64MultiArray

from cam_rig.acoustics import level_db
from cam_rig.bag import topics
from cam_rig.bag.codec import array_of, decode_block
from cam_rig.errors import CamRigError
from cam_rig.experiment.pairing import TickPairing
from cam_rig.experiment.stage import open_stage
from cam_rig.experiment.sweep import MicrophoneBench
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import to_cam_state, to_header
from cam_rig.nodes.parameters import declare_scene


class Microphone(RigNode):
    """Publishes /microphone/level (dB) and /microphone/pressure (Pa, r.m.s.) for each tick."""

    def __init__(self) -> None:
        super().__init__("microphone")
        self._bench = MicrophoneBench.of(open_stage(declare_scene(self)))
        self._ticks = TickPairing()
        self._level, self._pressure = map(self.publisher, (topics.LEVEL, topics.PRESSURE))
        self.subscribe(topics.FOLLOWER_SAMPLES, self._on_samples)
        self.subscribe(topics.CAM_STATE, self._on_state)

    def _on_state(self, message: JointState) -> None:
        self._ticks.add_state(to_cam_state(message))
        self._listen()

    def _on_samples(self, message: Float64MultiArray) -> None:
        try:
            self._ticks.add_block(decode_block(*array_of(message)))
        except CamRigError as error:
            self.get_logger().warning(str(error), throttle_duration_sec=1.0)
        self._listen()

    def _listen(self) -> None:
        for start, end, rows in self._ticks.complete():
            pressure = self._bench.listen(rows, start.speed)
            self._level.publish(Float64(data=float(level_db(pressure))))
            heard = FluidPressure(header=to_header(end.time_ns, "microphone"))
            heard.fluid_pressure = pressure
            self._pressure.publish(heard)


def main() -> None:
    """Entry point of the executable."""
    run(Microphone)


if __name__ == "__main__":
    main()
