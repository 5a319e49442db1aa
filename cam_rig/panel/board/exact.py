"""What a law comes to, exactly: at once for every change, and what takes longer once it rests."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.acoustics.steady import steady_power
from cam_rig.api.motion import simulate
from cam_rig.api.sound import sound_level
from cam_rig.arrays import FloatArray
from cam_rig.dynamics import FollowerParameters
from cam_rig.errors import CamRigError
from cam_rig.laws import Law, build_law
from cam_rig.profile import Contour, contours
from cam_rig.profile.checks.all_checks import check_cam
from cam_rig.profile.checks.pressure_angle import greatest_allowed
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.studies.jump.any_rig import find_jump, follower_of
from cam_rig.studies.jump.contact_lost_speed import FROM_REST
from cam_rig.studies.jump.rigid import rigid_jump_speed
from cam_rig.studies.vibration.steady_state import residual_vibration
from cam_rig.units import RPM

#: Points of a contour on the page, and decimals of its lengths in mm.
POINTS, DECIMALS = 360, 4
#: Turns that are simulated for the level where contact is lost; the first settles.
TURNS = 6
#: A value for the page: a number, or the words on why there is none; empty for infinity.
Found = dict[str, float | str]
#: A contour as the page draws it.
Shape = dict[str, Any]


def at_once(cam: CamConfig, law: Law, rig: RigConfig) -> dict[str, Any]:
    """Contours with what is wrong with them, and the rigid jump speed; 3 ms.

    The contour is looked at where it is drawn; `at_rest` looks everywhere. A law that cannot be
    made has ``faults``; one that can, and should not, has ``warnings``.
    """
    jump = _found(lambda: rigid_jump_speed(law, FollowerParameters.from_rig(rig)) / RPM)
    try:
        discs = contours(cam.follower, law, POINTS)
    except CamRigError as error:
        faults: list[dict[str, Any]] = [{"key": "error", "words": str(error)}]
        return {"discs": [], "faults": faults, "warnings": [], "jump_rigid": jump}
    shown, faults, warnings = [], [], []
    for disc in discs:
        allowed = greatest_allowed(cam.follower, disc.disc.element)
        undercut, steep = disc.rate <= 0.0, np.abs(disc.pressure) > allowed
        shown.append(_shown(disc, undercut, steep))
        if undercut.any():
            at = int(np.argmin(disc.rate))
            faults.append({"key": "undercut", "angle_deg": _degrees(disc, at)})
        if steep.any():
            at = int(np.argmax(np.abs(disc.pressure)))
            value = math.degrees(abs(disc.pressure[at]))
            words = {"value_deg": value, "allowed_deg": math.degrees(allowed)}
            warnings.append({"key": "pressure", "angle_deg": _degrees(disc, at)} | words)
    return {"discs": shown, "faults": faults, "warnings": warnings, "jump_rigid": jump}


def at_rest(cam: CamConfig, law: Law, rig: RigConfig, rpm: float) -> dict[str, Any]:
    """Jump speed on the rig's own follower, residual vibration, level, and all checks; 0.2 s."""

    def residual() -> float:
        follower, speed = FollowerParameters.on_stem(rig, "the residual vibration"), rpm * RPM
        return 1e6 * float(residual_vibration(law, follower, np.array([speed]))[0])

    try:
        checks = [check for check in check_cam(cam, law) if not check.passed]
        made, failed = not any(check.vital for check in checks), [str(check) for check in checks]
    except CamRigError as error:
        made, failed = False, [str(error)]
    return {
        "jump": _found(lambda: _jump(law, rig)),
        "residual_um": _found(residual),
        "level_db": _found(lambda: level(law, rig, rpm)),
        "checks": failed,
        "made": made,
    }


def file_jump(cam: CamConfig, rig: RigConfig) -> Found:
    """Jump speed (rpm) of a file's own law, beside that of the B-splines that stand for it."""
    return _found(lambda: _jump(build_law(cam), rig))


def _jump(law: Law, rig: RigConfig) -> float:
    return find_jump(law, follower_of(rig), FROM_REST).rpm


def level(law: Law, rig: RigConfig, rpm: float) -> float:
    """Sound pressure level, dB re 20 µPa, of one rigid mass in steady state.

    Exact where the follower stays on the cam; simulated where it does not.

    Raises
    ------
    DynamicsError : a speed that cannot be simulated
    """
    follower = FollowerParameters.from_rig(rig)
    if law.velocity_jumps or rigid_jump_speed(law, follower) <= rpm * RPM:
        return sound_level(simulate(law, rig, rpm=rpm, turns=TURNS)).level_db
    power = steady_power(law, follower, RadiationParameters.from_rig(rig), rpm * RPM)
    return float(level_db(np.array([math.sqrt(power)]))[0])


def _found(compute: Callable[[], float]) -> Found:
    """A finite value, or why there is none; nothing at all for an infinite one, as in JSON."""
    try:
        value = compute()
    except CamRigError as error:
        return {"words": str(error)}
    return {"value": value} if math.isfinite(value) else {}


def _degrees(disc: Contour, at: int) -> float:
    return math.degrees(disc.angle[at]) % 360.0


def _shown(disc: Contour, undercut: NDArray[np.bool_], steep: NDArray[np.bool_]) -> Shape:
    """A contour for the page, lengths in mm; ``undercut`` and ``steep`` are indices of points."""
    return {
        "points": _millimetres(disc.points),
        "pitch": None if disc.pitch is None else _millimetres(disc.pitch),
        "undercut": np.flatnonzero(undercut).tolist(),
        "steep": np.flatnonzero(steep).tolist(),
    }


def _millimetres(points: FloatArray) -> list[list[float]]:
    found: list[list[float]] = np.round(1e3 * points, DECIMALS).tolist()
    return found
