"""The law server without ROS: what may be mounted and why not, and which law is published when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.dynamics import MODELS
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law, build_law
from cam_rig.laws.cam import law_of, require_sprung
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.profile import contours
from cam_rig.schema import CamConfig, Library, load_cam, load_scene
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import FloatArray


@dataclass(frozen=True)
class MountReply:
    """The answer to a request for a cam: its refusal, empty where it is mounted now.

    ``is_new`` is False where it was mounted before; then its law did not reach the drive.
    """

    refusal: str = ""
    is_new: bool = False


@dataclass(frozen=True)
class MountingCheckpoint:
    """What a law server's successor must know: the mounted cam, and the last state received."""

    cam: str
    last: CamState | None


class CamMounting:
    """The cams of a scene's library, one of which is mounted.

    First is ``cam``, empty for the scene's first; ``checkpoints`` are of a predecessor, the oldest
    first.
    """

    def __init__(
        self, scene_file: Path, cam: str = "", checkpoints: Sequence[MountingCheckpoint] = ()
    ) -> None:
        scene, self._library = load_scene(scene_file), Library.beside(scene_file)
        self._model = MODELS[scene.model]
        self._laws: dict[str, Law] = {}
        oldest = checkpoints[0].last if checkpoints else None  # None before the first state
        since = -1 if oldest is None else oldest.time_ns
        # The history may begin later than that: whatever state comes first is admitted.
        self._validator = StateValidator.of(scene, since=since)
        self._last: CamState | None = None
        first = checkpoints[-1].cam if checkpoints else cam
        self._mount(first or scene.cams[0])

    @property
    def law(self) -> Law:
        """The mounted cam's law."""
        return self._laws[self.cam]

    @property
    def checkpoint(self) -> MountingCheckpoint:
        """To be saved after each request and each state."""
        return MountingCheckpoint(self.cam, self._last)

    def request(self, cam: str) -> MountReply:
        """Mount a cam, if its file is in the library and the scene's model can turn its law."""
        if cam == self.cam:
            return MountReply()
        try:
            self._mount(cam)
        except CamRigError as error:
            return MountReply(str(error))
        return MountReply(is_new=True)

    def admit(self, state: CamState) -> Admission:
        """How a state relates to those before; see `StateValidator.admit`."""
        return self._validator.admit(state)

    def is_newest(self, state: CamState) -> bool:
        """Whether no state has come after this one."""
        return state == self._last

    def resume(self, checkpoint: MountingCheckpoint) -> None:
        """Go on from what a predecessor knew."""
        self._last = checkpoint.last

    def follow(self, state: CamState) -> Law | None:
        """Take a state; the law to publish with it, None unless cam or speed are new."""
        last = self._last
        known = last is not None and (last.cam, last.speed) == (state.cam, state.speed)
        law = self._law_of(state.cam) if state.speed > 0.0 and not known else None
        self._last = state
        return law

    def _mount(self, cam: str) -> None:
        path = self._library.path("cams", cam)
        config = load_cam(path)
        require_sprung(path, config)
        law = law_of(path, config)
        self._model.require(law)
        self._laws[cam], self.cam, self.config = law, cam, config

    def _law_of(self, cam: str) -> Law:
        if cam not in self._laws:
            try:
                self._laws[cam] = build_law(load_cam(self._library.path("cams", cam)))
            except CamRigError as error:
                raise RefusedError(f"cam state: {error}") from None
        return self._laws[cam]


# Laws and contours received from the law server, compared with those of the cam's file.

#: Points of the contour over one turn.
CONTOUR_POINTS = 180
#: Differences allowed, over the largest value: two machines that build one law from one file may
#: round differently, and a contour is published in single precision.
LAW_TOLERANCE, CONTOUR_TOLERANCE = 1e-9, 1e-6


def contour_of(cam: CamConfig, law: Law) -> FloatArray:
    """Points of the cam's contour in its own frame (m), ``(2, n)``; of conjugate cams the first."""
    return contours(cam.follower, law, CONTOUR_POINTS)[0].points


def require_own_law(loaded: LoadedScene, law: Law) -> None:
    """Refuse a law that is not that of the cam's file in the scene's library."""
    _mount(loaded, law.name)
    own, words = loaded.laws[law.name], f"law {law.name!r}: its"
    _require_near(law.breaks, own.breaks, LAW_TOLERANCE, f"{words} breaks", loaded, law.name)
    _require_near(
        law.ordinates, own.ordinates, LAW_TOLERANCE, f"{words} ordinates", loaded, law.name
    )


def require_own_contour(loaded: LoadedScene, cam: str, points: FloatArray) -> None:
    """Refuse a contour ``(2, n)`` (m) that is not that of the cam's file."""
    _mount(loaded, cam)
    known = contour_of(loaded.cams[cam], loaded.laws[cam])
    _require_near(points, known, CONTOUR_TOLERANCE, f"contour of {cam!r}: its points", loaded, cam)


def _mount(loaded: LoadedScene, cam: str) -> None:
    try:
        loaded.mount(cam)
    except CamRigError as error:
        raise RefusedError(f"cam {cam[:80]!r}: not in the scene's library ({error})") from None


def _require_near(
    received: FloatArray,
    known: FloatArray,
    tolerance: float,
    what: str,
    loaded: LoadedScene,
    cam: str,
) -> None:
    file = loaded.cam_files[cam]
    if received.shape != known.shape:
        raise RefusedError(f"{what} are {received.shape}; {file} has {known.shape}")
    difference = float(np.abs(received - known).max())
    limit = tolerance * float(np.abs(known).max())
    if not difference <= limit:
        raise RefusedError(
            f"{what} differ by {difference:.3g} from those of {file}; allowed: {limit:.3g} "
            "(was the file changed, or is a second law server at work?)"
        )
