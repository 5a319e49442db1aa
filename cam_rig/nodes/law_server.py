"""The law server: holds the mounted cam's law and tells it to everyone, latched."""

from __future__ import annotations

from pathlib import Path

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from cam_rig.dynamics import MODELS
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law, build_law
from cam_rig.live.admission import Admission, StateValidator
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of, encode_law
from cam_rig.nodes.common.base import RigNode
from cam_rig.nodes.common.convert import to_array, to_header
from cam_rig.nodes.common.diagnostics import OK
from cam_rig.nodes.common.law_messages import to_polygon, to_trajectory
from cam_rig.nodes.common.resend import Repeats
from cam_rig.schema import Library, load_cam, load_scene
from cam_rig.simulation.cam_files import law_of, require_sprung
from cam_rig.simulation.schedule import CamState


class LawServer(RigNode):
    """Publishes /cam/law_coefficients and /cam/profile for each cam, /cam/law for each speed."""

    def __init__(self) -> None:
        super().__init__("law_server")
        path = Path(self.given["scene"])
        scene, self._library = load_scene(path), Library.beside(path)
        self._model = MODELS[scene.model]
        self._sampled, self._coefficients, self._profile = map(
            self.publisher, (topics.LAW, topics.LAW_COEFFICIENTS, topics.PROFILE)
        )
        self._followed = self.publisher(topics.FOLLOWED)
        self._laws: dict[str, Law] = {}
        self._repeats, self._told = Repeats(), Repeats()
        self._last: CamState | None = None
        self._left = self.handover.all()
        begun = next((last.time_ns for _, last, _ in self._left if last), -1)
        # Nobody waits for the law server, so the drive may have gone far while it was away.
        self._gate = StateValidator.of(scene, since=begun)
        mounted = self._left[-1][0] if self._left else self.given["cam"]
        self._mount(mounted or scene.cams[0])
        self.add_on_set_parameters_callback(self._on_parameters)
        self.subscribe(topics.CAM_STATE, self._on_state)

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "cam" and parameter.value == self._mounted:
                self._told.again(0)  # who asks for what is there did not hear of it
            elif parameter.name == "cam":
                try:
                    self._mount(str(parameter.value))
                except CamRigError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _mount(self, name: str) -> None:
        path = self._library.path("cams", name)
        cam = load_cam(path)
        require_sprung(path, cam)
        law = law_of(path, cam)
        self._model.require(law)
        self._laws[name], self._mounted = law, name
        self._keep()
        coefficients = (self._coefficients, to_array(*encode_law(law)))
        self._told = Repeats()
        self._told.publish(0, [coefficients, (self._profile, to_polygon(cam, law))])

    def _on_state(self, message: JointState) -> None:
        state = cam_state_of(message)
        if self._gate.admit(state) is Admission.SEEN:
            self._told.again(0)
            self._repeats.again(state.time_ns)
        else:
            self._follow(state)
        self._followed.publish(to_header(state.time_ns, "law_server"))

    def _follow(self, state: CamState) -> None:
        while self._left:  # where the predecessor was before this state
            _, last, said = self._left.pop(0)
            if last is not None and last.time_ns < state.time_ns:
                self._last, self.health.said = last, said
        last = self._last
        known = last is not None and (last.cam, last.speed) == (state.cam, state.speed)
        if state.speed > 0.0 and not known:
            sampled = to_trajectory(self._law_of(state.cam), state)
            self._repeats.publish(state.time_ns, [(self._sampled, sampled)])
        self._last = state
        self.health.report(state.time_ns, OK, f"{state.cam} is mounted")
        self._keep()

    def _keep(self) -> None:
        stamp = self._last.time_ns if self._last else -1
        self.handover.keep((self._mounted, self._last, self.health.said), stamp)

    def _law_of(self, cam: str) -> Law:
        if cam not in self._laws:
            try:
                self._laws[cam] = build_law(load_cam(self._library.path("cams", cam)))
            except CamRigError as error:
                raise RefusedError(f"cam state: {error}") from None
        return self._laws[cam]
