"""The recorder: every message of the rig, as it came, into a rosbag2 MCAP bag."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from cam_rig.bag import topics
from cam_rig.bag.session import RecordingSession
from cam_rig.bag.writer import BagWriter
from cam_rig.errors import CamRigError
from cam_rig.experiment.stage import open_stage
from cam_rig.nodes.app import RigNode, run
from cam_rig.nodes.convert import to_header
from cam_rig.nodes.parameters import declare_scene, declare_text


class Recorder(RigNode):
    """Subscribes to all of the rig's topics; /recorder/written tells how far it is."""

    def __init__(self) -> None:
        super().__init__("recorder")
        stage = open_stage(declare_scene(self))
        default = time.strftime(f"bags/{stage.scene.name}_%Y-%m-%d_%H-%M-%S")
        bag = declare_text(self, "bag", default, "folder to record into; must not exist yet")
        self._writer = BagWriter(Path(bag))
        for path in stage.files:
            self._writer.attach(f"{path.parent.name}/{path.name}", path.read_bytes())
        self._session = RecordingSession(self._writer)
        self._written = self.publisher(topics.RECORDED)
        for topic in topics.RECORDING:
            self.subscribe(topic, self._on(topic), raw=True)

    def _on(self, topic: topics.Topic) -> Callable[[bytes], None]:
        def take(cdr: bytes) -> None:
            try:
                stamp = self._session.take(topic, cdr)
            except CamRigError as error:
                return self.fail(error)
            if stamp is not None:
                self._written.publish(to_header(stamp, "recorder"))

        return take

    def drain(self, spin_once: Callable[..., None]) -> None:
        """Record what has arrived but was not taken yet."""
        before = -1
        while before < (now := sum(self._writer.counts.values())):
            before = now
            for _ in topics.RECORDING:
                spin_once(timeout_sec=0.02)

    def close(self) -> None:
        """Close the bag."""
        self._writer.close()


def main() -> None:
    """Entry point of the executable."""
    run(Recorder)


if __name__ == "__main__":
    main()
