"""The law server: holds the mounted cam's law and tells it to everyone, latched."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point32, PolygonStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cam_rig.bag import topics
from cam_rig.bag.codec import encode_law
from cam_rig.errors import CamRigError
from cam_rig.experiment.program import CamState
from cam_rig.laws import Law, build_law
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import message_class, qos, to_array, to_cam_state, to_header
from cam_rig.nodes.parameters import declare_scene, declare_text
from cam_rig.profile import contour, turn_angles
from cam_rig.schema import CamConfig, Library, load_cam, load_scene

#: Points of the sampled law and of the contour, one a degree.
POINTS = 360


class LawServer(RigNode):
    """Publishes /cam/law_coefficients and /cam/profile for each cam, /cam/law for each speed."""

    def __init__(self) -> None:
        super().__init__("law_server")
        scene = declare_scene(self)
        self._library = Library.beside(scene)
        first = load_scene(scene).cams[0]
        cam = declare_text(self, "cam", first, "mounted cam, a file of config/cams", live=True)
        self._out = {
            topic: self.create_publisher(message_class(topic), topic.name, qos(topic))
            for topic in (topics.LAW, topics.LAW_COEFFICIENTS, topics.PROFILE)
        }
        self._last: CamState | None = None
        self._mount(load_cam(self._path(cam)))
        self.add_on_set_parameters_callback(self._on_parameters)
        self.create_subscription(
            JointState, topics.CAM_STATE.name, self._on_state, qos(topics.CAM_STATE)
        )

    def _path(self, cam: str) -> Path:
        return self._library.path("cams", cam)

    def _on_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == "cam" and parameter.value != self._law.name:
                try:
                    self._mount(load_cam(self._path(str(parameter.value))))
                except CamRigError as error:
                    return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _mount(self, cam: CamConfig) -> None:
        self._law = build_law(cam)
        self._out[topics.LAW_COEFFICIENTS].publish(to_array(*encode_law(self._law)))
        self._out[topics.PROFILE].publish(to_polygon(cam, self._law))

    def _on_state(self, message: JointState) -> None:
        state, last = to_cam_state(message), self._last
        known = last is not None and (last.cam, last.speed) == (state.cam, state.speed)
        if state.speed > 0.0 and state.cam == self._law.name and not known:
            self._out[topics.LAW].publish(to_trajectory(self._law, state))
            self._last = state


def to_polygon(cam: CamConfig, law: Law) -> PolygonStamped:
    """The cam's contour in its own frame."""
    pitch = cam.follower.base_radius.si + cam.follower.roller
    points = contour(law, pitch, cam.follower.roller, turn_angles(POINTS))
    message = PolygonStamped(header=to_header(0, law.name))
    message.polygon.points = [Point32(x=float(x), y=float(y), z=0.0) for x, y in points.T]
    return message


def to_trajectory(law: Law, state: CamState) -> JointTrajectory:
    """The law over one turn at the cam's present speed."""
    message = JointTrajectory(header=to_header(state.time_ns, law.name), joint_names=["follower"])
    angle = np.linspace(0.0, 2.0 * math.pi, POINTS + 1)
    motion = np.stack([law(angle, order) * state.speed**order for order in range(3)])
    message.points = [
        JointTrajectoryPoint(
            positions=[float(s)],
            velocities=[float(v)],
            accelerations=[float(a)],
            time_from_start=Duration(seconds=float(theta / state.speed)).to_msg(),
        )
        for theta, s, v, a in zip(angle, *motion, strict=True)
    ]
    return message


def main() -> None:
    """Entry point of the executable."""
    run(LawServer)


if __name__ == "__main__":
    main()
