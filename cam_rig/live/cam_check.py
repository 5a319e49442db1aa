"""Laws and contours received from the law server, compared with those of the cam's file."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law
from cam_rig.profile import contours
from cam_rig.schema import CamConfig
from cam_rig.simulation.loaded_scene import LoadedScene

#: Points of the contour over one turn.
CONTOUR_POINTS = 180
#: Differences allowed, over the largest value: two machines that build one law from one file may
#: round differently, and a contour is published in single precision.
LAW_TOLERANCE, CONTOUR_TOLERANCE = 1e-9, 1e-6


def contour_of(cam: CamConfig, law: Law) -> FloatArray:
    """Points of the cam's contour in its own frame (m), ``(2, n)``; of conjugate cams the first."""
    return contours(cam.follower, law, CONTOUR_POINTS)[0].points


def require_own_law(loaded: LoadedScene, law: Law) -> None:
    """Refuse a law that is not that of the cam's file in the scene's library.

    Raises
    ------
    RefusedError : names the cam, and by how much its law differs
    """
    _mount(loaded, law.name)
    own = loaded.laws[law.name]
    for received, known, what in (
        (law.breaks, own.breaks, "breaks"),
        (law.ordinates, own.ordinates, "ordinates"),
    ):
        words = f"law {law.name!r}: its {what}"
        _require_same(received, known, LAW_TOLERANCE, words, loaded, law.name)


def require_own_contour(loaded: LoadedScene, cam: str, points: FloatArray) -> None:
    """Refuse a contour ``(2, n)`` (m) that is not that of the cam's file.

    Raises
    ------
    RefusedError : names the cam, and by how much its contour differs
    """
    _mount(loaded, cam)
    known = contour_of(loaded.cams[cam], loaded.laws[cam])
    _require_same(points, known, CONTOUR_TOLERANCE, f"contour of {cam!r}: its points", loaded, cam)


def _mount(loaded: LoadedScene, cam: str) -> None:
    try:
        loaded.mount(cam)
    except CamRigError as error:
        raise RefusedError(f"cam {cam[:80]!r}: not in the scene's library ({error})") from None


def _require_same(
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
