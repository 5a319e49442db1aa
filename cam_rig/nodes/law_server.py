"""The law server: holds the mounted cam and publishes its law and its looks, latched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sensor_msgs.msg import JointState

from cam_rig.live.law_server import CamMounting
from cam_rig.live.state_validation import Admission
from cam_rig.messages import topics
from cam_rig.messages.codec import cam_state_of, encode_law
from cam_rig.messages.motion import OF_LAW_SERVER, MotionMessages
from cam_rig.nodes.convert import OK, ResendBuffer, to_array, to_header, to_polygon, to_trajectory
from cam_rig.nodes.rig_node import RigNode
from cam_rig.simulation.scene import open_scene
from cam_rig.simulation.schedule import CamState


class LawServer(RigNode):
    """Publishes law, contour and looks of each cam, and /cam/law for each speed."""

    def __init__(self) -> None:
        super().__init__("law_server")
        self._sampled, self._coefficients, self._profile = map(
            self.publisher, (topics.LAW, topics.LAW_COEFFICIENTS, topics.PROFILE)
        )
        self._followed = self.publisher(topics.FOLLOWED)
        self._loaded = open_scene(Path(self.given["scene"]))
        self._robot = MotionMessages(self._loaded, topics=OF_LAW_SERVER)
        self._robot_out = {topic: self.publisher(topic) for topic in self._robot.topics}
        self._predecessor = self.checkpoint.all()
        left = [checkpoint for checkpoint, _ in self._predecessor]
        self._cams = CamMounting(self._loaded, self.given["cam"], left)
        self._samples, self._laws, self._mounted = ResendBuffer(), ResendBuffer(), 0
        self._publish_law()
        self.check(cam=self._mount)
        self.subscribe(topics.CAM_STATE, self._on_state)
        self.get_logger().info(self.activity().words)

    def _mount(self, cam: Any) -> None:
        if self._cams.request(str(cam)):
            self._publish_law()
        else:  # its law did not reach the drive
            self._laws.resend(self._mounted)

    def summary(self) -> str:
        """What the node has done, in words, when it ends."""
        return f"done with {self.ticks} states"

    def _publish_law(self) -> None:
        self.get_logger().info(f"{self._cams.cam} is mounted")
        self._save()
        law = self._cams.law
        self._mounted += 1
        contour = (self._profile, to_polygon(self._loaded.cams[law.name], law))
        looks = [(self._robot_out[topic], cdr) for topic, _, cdr in self._robot.mounted(law.name)]
        coefficients = (self._coefficients, to_array(*encode_law(law)))
        self._laws.publish(self._mounted, [coefficients, contour, *looks])

    def _on_state(self, message: JointState) -> None:
        state = cam_state_of(message)
        if self._cams.validator.admit(state) is Admission.SEEN:
            if state == self._cams.last:  # once for all the states that are sent again
                self._laws.resend(self._mounted)
            self._samples.resend(state.time_ns)
        else:
            self._follow(state)
        self._followed.publish(to_header(state.time_ns))

    def _follow(self, state: CamState) -> None:
        while self._predecessor:  # as far as it was before the first state that comes
            checkpoint, reported = self._predecessor.pop(0)
            if checkpoint.last is not None and checkpoint.last.time_ns < state.time_ns:
                self._cams.last = checkpoint.last
                self.health.reported = reported
        if (law := self._cams.follow(state)) is not None:
            self._samples.publish(state.time_ns, [(self._sampled, to_trajectory(law, state))])
        self.ticks += 1
        self.health.report(state.time_ns, OK, f"{state.cam} is mounted")
        self._save()

    def _save(self) -> None:
        checkpoint = self._cams.checkpoint
        self.save(checkpoint, checkpoint.last.time_ns if checkpoint.last else -1)
