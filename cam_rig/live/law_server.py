"""The law server without ROS: what may be mounted and why not, and which law is published when."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cam_rig.dynamics import MODELS
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.state_validation import StateValidator
from cam_rig.profile import contours
from cam_rig.schema import CamConfig
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import FloatArray


class CamMounting:
    """Cams of a scene's library, one of which is mounted (default: the first of the scene)."""

    def __init__(self, loaded: LoadedScene, cam: str = "") -> None:
        self._loaded = loaded
        self.validator = StateValidator.of(loaded.scene)
        self._last: CamState | None = None
        self.cam = ""
        self.request(cam or loaded.scene.cams[0])

    @property
    def law(self) -> Law:
        """The mounted cam's law."""
        return self._loaded.laws[self.cam]

    def request(self, cam: str) -> bool:
        """Mount a cam of the library whose law the model can turn; False where it was mounted."""
        if cam == self.cam:
            return False
        require = MODELS[self._loaded.scene.model].require
        self._loaded.mount(cam, again=True, require=require)  # its file may have changed
        self.cam = cam
        return True

    def follow(self, state: CamState) -> Law | None:
        """Take a state; the law to publish with it, None unless cam or speed are new."""
        last, self._last = self._last, state
        known = last is not None and (last.cam, last.speed) == (state.cam, state.speed)
        if known or state.speed == 0.0:
            return None
        try:
            self._loaded.mount(state.cam)
        except CamRigError as error:
            self._last = last
            raise RefusedError(f"cam state: {error}") from None
        return self._loaded.laws[state.cam]


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
    own, file = loaded.laws[law.name], loaded.cam_files[law.name]
    for of in ("breaks", "ordinates"):
        what = f"law {law.name!r}: its {of}"
        _require_near(getattr(law, of), getattr(own, of), LAW_TOLERANCE, what, file)


def require_own_contour(loaded: LoadedScene, cam: str, points: FloatArray) -> None:
    """Refuse a contour ``(2, n)`` (m) that is not that of the cam's file."""
    _mount(loaded, cam)
    known, what = contour_of(loaded.cams[cam], loaded.laws[cam]), f"contour of {cam!r}: its points"
    _require_near(points, known, CONTOUR_TOLERANCE, what, loaded.cam_files[cam])


def _mount(loaded: LoadedScene, cam: str) -> None:
    try:
        loaded.mount(cam)
    except CamRigError as error:
        raise RefusedError(f"cam {cam[:80]!r}: not in the scene's library ({error})") from None


def _require_near(
    received: FloatArray, known: FloatArray, tolerance: float, what: str, file: Path
) -> None:
    if received.shape != known.shape:
        raise RefusedError(f"{what} are {received.shape}; {file} has {known.shape}")
    difference = float(np.abs(received - known).max())
    limit = tolerance * float(np.abs(known).max())
    if not difference <= limit:
        raise RefusedError(
            f"{what} differ by {difference:.3g} from those of {file}; allowed: {limit:.3g} "
            "(was the file changed, or is a second law server at work?)"
        )
