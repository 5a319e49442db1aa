"""Law server without ROS: mounted cam, and checks of laws and contours."""

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
    """Mounting of cams: the mounted cam of a scene's library, and its law.

    At first the first cam of the scene is mounted, unless `cam` names another.
    """

    def __init__(self, loaded: LoadedScene, cam: str = "") -> None:
        self._loaded = loaded
        self.validator = StateValidator.of(loaded.scene)
        self._last: CamState | None = None
        self.cam = ""
        self.request(cam or loaded.scene.cams[0])

    @property
    def law(self) -> Law:
        """Law of the mounted cam."""
        return self._loaded.laws[self.cam]

    def request(self, cam: str) -> bool:
        """Mount a cam of the library, or return False if it is mounted already.

        Raises
        ------
        CamRigError
            If the library has no such cam, or the scene's model rejects its law. The mounted cam
            stays.
        """
        if cam == self.cam:
            return False
        require = MODELS[self._loaded.scene.model].require
        self._loaded.mount(cam, again=True, require=require)  # its file may have changed
        self.cam = cam
        return True

    def follow(self, state: CamState) -> Law | None:
        """Return the law to publish for a cam state.

        Returns None if the cam is stopped, or if cam and speed are those of the previous state.
        """
        last, self._last = self._last, state
        is_same = last is not None and (last.cam, last.speed) == (state.cam, state.speed)
        if is_same or state.speed == 0.0:
            return None
        try:
            self._loaded.mount(state.cam)
        except CamRigError as error:
            self._last = last
            raise RefusedError(f"cam state: {error}") from None
        return self._loaded.laws[state.cam]


# Comparison of received laws and contours with those of the cam's file.

#: Number of points of the published contour of a cam, over one turn.
CONTOUR_POINTS = 180
#: Tolerance of a received law, relative to the largest value. Two machines may round the law of the
#: same file differently.
LAW_RTOL = 1e-9
#: Tolerance of a received contour, relative to the largest value, for its single precision.
CONTOUR_RTOL = 1e-6


def contour_of(cam: CamConfig, law: Law) -> FloatArray:
    """Return the contour of a cam in the frame of the cam (m), shape (2, n).

    For conjugate cams this is the contour of the first cam.
    """
    return contours(cam.follower, law, CONTOUR_POINTS)[0].points


def require_own_law(loaded: LoadedScene, law: Law) -> None:
    """Raise RefusedError if a received law differs from that of the cam's file."""
    _mount(loaded, law.name)
    expected, file = loaded.laws[law.name], loaded.cam_files[law.name]
    for field in ("breaks", "ordinates"):
        text = f"law {law.name!r}: its {field}"
        _require_near(getattr(law, field), getattr(expected, field), LAW_RTOL, text, file)


def require_own_contour(loaded: LoadedScene, cam: str, points: FloatArray) -> None:
    """Raise RefusedError if a received contour differs from that of the cam's file.

    `points` are in m, shape (2, n).
    """
    _mount(loaded, cam)
    expected = contour_of(loaded.cams[cam], loaded.laws[cam])
    text = f"contour of {cam!r}: its points"
    _require_near(points, expected, CONTOUR_RTOL, text, loaded.cam_files[cam])


def _mount(loaded: LoadedScene, cam: str) -> None:
    try:
        loaded.mount(cam)
    except CamRigError as error:
        raise RefusedError(f"cam {cam[:80]!r}: not in the scene's library ({error})") from None


def _require_near(
    received: FloatArray, expected: FloatArray, rtol: float, text: str, file: Path
) -> None:
    if received.shape != expected.shape:
        raise RefusedError(f"{text} must be {expected.shape} as in {file}, got {received.shape}")
    difference = float(np.abs(received - expected).max())
    limit = rtol * float(np.abs(expected).max())
    if not difference <= limit:
        raise RefusedError(
            f"{text} differ by {difference:.3g} from those of {file}, more than {limit:.3g}; check "
            "if the file was changed, and for a second law server"
        )
