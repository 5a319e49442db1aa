"""The law server: holds the mounted cam's law and tells it to everyone, latched."""

from __future__ import annotations

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from cam_rig.bag import topics
from cam_rig.bag.codec import encode_law
from cam_rig.errors import CamRigError
from cam_rig.experiment.program import CamState
from cam_rig.laws import build_law
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import to_array, to_cam_state
from cam_rig.nodes.law_messages import to_polygon, to_trajectory
from cam_rig.nodes.parameters import declare_scene, declare_text
from cam_rig.schema import CamConfig, Library, load_cam, load_scene


class LawServer(RigNode):
    """Publishes /cam/law_coefficients and /cam/profile for each cam, /cam/law for each speed."""

    def __init__(self) -> None:
        super().__init__("law_server")
        scene = declare_scene(self)
        self._library = Library.beside(scene)
        first = load_scene(scene).cams[0]
        cam = declare_text(self, "cam", first, "mounted cam, a file of config/cams", live=True)
        self._sampled, self._coefficients, self._profile = map(
            self.publisher, (topics.LAW, topics.LAW_COEFFICIENTS, topics.PROFILE)
        )
        self._last: CamState | None = None
        self._mount(self._load(cam))
        self.add_on_set_parameters_callback(self._on_parameters)
        self.subscribe(topics.CAM_STATE, self._on_state)

    def _load(self, cam: str) -> CamConfig:
        return load_cam(self._library.path("cams", cam))

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "cam" and parameter.value != self._law.name:
                try:
                    self._mount(self._load(str(parameter.value)))
                except CamRigError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _mount(self, cam: CamConfig) -> None:
        self._law = build_law(cam)
        self._coefficients.publish(to_array(*encode_law(self._law)))
        self._profile.publish(to_polygon(cam, self._law))

    def _on_state(self, message: JointState) -> None:
        state, last = to_cam_state(message), self._last
        known = last is not None and (last.cam, last.speed) == (state.cam, state.speed)
        if state.speed > 0.0 and state.cam == self._law.name and not known:
            self._sampled.publish(to_trajectory(self._law, state))
            self._last = state


def main() -> None:
    """Entry point of the executable."""
    run(LawServer)


if __name__ == "__main__":
    main()
