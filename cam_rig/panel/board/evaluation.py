"""Evaluation of a drawn law: fast results for every change, and slow results after a pause."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.acoustics.pressure import steady_power
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.dynamics.torsional import model as torsional
from cam_rig.dynamics.vibration import residual_vibration, shaft_vibration
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law
from cam_rig.panel.bench.drawing import follower_picture
from cam_rig.profile import Contour, contours
from cam_rig.profile.cam_checks import check_cam, max_pressure_angle
from cam_rig.profile.checks import FACTORS, Check
from cam_rig.profile.outlines import follower_shape
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.show.looks import millimetres
from cam_rig.studies.simulate.motion import simulate
from cam_rig.studies.simulate.sound import sound_level
from cam_rig.units import RPM

#: Number of points of a contour on the page.
CONTOUR_POINTS = 360
#: Number of turns that are simulated for the sound level if contact is lost. The first is left out
#: as transient.
LEVEL_TURNS = 6
#: Lowest speed (rpm) at which the vibration of a shaft is computed. At lower speeds a turn has so
#: many vibrations of the shaft that its steady state takes more than a second.
MIN_SHAFT_RPM = 20.0
#: Value that is sent to the page: the number as `value`, or the reason for a missing number as
#: `message`. It is empty for infinity, which JSON cannot contain.
PageValue = dict[str, float | str]


def evaluate_fast(cam: CamConfig, law: Law, rig: RigConfig) -> dict[str, Any]:
    """Return those results for a drawn law that are computed in about 3 ms.

    They are the contours, their faults, the follower, and the jump speed (rpm) of one rigid mass.
    The contours are checked only at the drawn points. `evaluate_full` runs all checks. A law that
    cannot be made has `faults`. A law that can be made but violates a limit has `warnings`. A
    follower that does not reach the cam is None.
    """
    jump = _page_value(lambda: rigid_jump_speed(law, FollowerParameters.from_rig(rig)) / RPM)
    try:
        discs = contours(cam.follower, law, CONTOUR_POINTS)
        follower = follower_picture(cam, law, follower_shape(cam, law))
    except CamRigError as error:
        faults: list[dict[str, Any]] = [{"key": "error", "message": str(error)}]
        none: dict[str, Any] = {"discs": [], "follower": None, "faults": faults, "warnings": []}
        return none | {"jump_rigid": jump, "pressure": None}
    discs_data, faults, warnings, pressure = [], [], [], list[dict[str, float]]()
    for disc in discs:
        allowed = max_pressure_angle(cam.follower, disc.disc.element)
        undercut, steep = disc.rate <= 0.0, np.abs(disc.pressure) > allowed
        discs_data.append(
            {
                "points": millimetres(disc.points),
                "pitch": None if disc.pitch is None else millimetres(disc.pitch),
                "undercut": np.flatnonzero(undercut).tolist(),
                "steep": np.flatnonzero(steep).tolist(),
            }
        )
        if undercut.any():
            worst = int(np.argmin(disc.rate))
            faults.append({"key": "undercut", "angle_deg": _angle_deg(disc, worst)})
        worst = int(np.argmax(np.abs(disc.pressure)))
        value = math.degrees(abs(disc.pressure[worst]))
        pressure.append({"value_deg": value, "allowed_deg": math.degrees(allowed)})
        if steep.any():
            warning = {"key": "pressure", "angle_deg": _angle_deg(disc, worst)}
            warnings.append(warning | pressure[-1])
    worst_pressure = max(pressure, key=lambda p: p["value_deg"] - p["allowed_deg"])
    results = {"discs": discs_data, "follower": follower, "faults": faults, "warnings": warnings}
    return results | {"jump_rigid": jump, "pressure": worst_pressure}


def evaluate_full(cam: CamConfig, law: Law, rig: RigConfig, rpm: float) -> dict[str, Any]:
    """Return those results for a drawn law that take about 0.2 s.

    They are the jump speed, the residual vibration, the sound level, the vibration of the shaft and
    all checks of the contour. The jump speed is that of the rig's follower. The residual vibration
    is in µm and the level in dB, both at the cam speed `rpm`. A cam that cannot be checked has a
    `check_error`.
    """

    def residual() -> float:
        follower, speed = FollowerParameters.on_stem(rig, "the residual vibration"), rpm * RPM
        return 1e6 * float(residual_vibration(law, follower, np.array([speed]))[0])

    checks, error = list[Check](), ""
    try:
        checks = check_cam(cam, law)
    except CamRigError as caught:
        error = str(caught)
    return {
        "jump": _page_value(lambda: find_jump(law, follower_of(rig), REST_DURATION_S).rpm),
        "residual_um": _page_value(residual),
        "level_db": _page_value(lambda: level(law, rig, rpm)),
        "shaft": _shaft_results(law, rig, rpm),
        "checks": [_check_data(check) for check in checks],
        "check_error": error,
        "can_be_made": not error and all(check.passed or not check.is_fatal for check in checks),
    }


def _shaft_results(law: Law, rig: RigConfig, rpm: float) -> dict[str, PageValue] | None:
    """Return twist (deg, peak to peak) and speed fluctuation (%) of a shaft at a speed (rpm).

    A flywheel at constant speed has no fluctuation. The result is None for a rig without a shaft.
    """
    if rig.shaft is None:
        return None
    try:
        if rpm < MIN_SHAFT_RPM:
            raise RefusedError(f"rpm: is {rpm:g}; allowed: from {MIN_SHAFT_RPM:g} on")
        twist, fluctuation = shaft_vibration(law, torsional.from_rig(rig), rpm * RPM)
    except CamRigError as error:
        keys = ("twist_deg", "fluctuation_percent")[: 1 + has_flywheel(rig)]
        return {key: {"message": str(error)} for key in keys}
    results: dict[str, PageValue] = {"twist_deg": {"value": math.degrees(twist)}}
    if fluctuation is not None:
        results["fluctuation_percent"] = {"value": 100.0 * fluctuation}
    return results


def has_flywheel(rig: RigConfig) -> bool:
    """Return True if the shaft of a rig has a flywheel of finite inertia."""
    return rig.shaft is not None and rig.shaft.flywheel_inertia is not None


def _check_data(check: Check) -> dict[str, Any]:
    """Return a check of the contour for a page, with value and limit in its display unit.

    A value that is not finite is None.
    """
    factor = FACTORS[check.unit]
    return {
        "title": check.title,
        "value": check.value * factor if math.isfinite(check.value) else None,
        "angle_deg": check.degrees,
        "relation": check.relation,
        "limit": check.limit * factor,
        "unit": check.unit,
        "passed": check.passed,
        "message": str(check),
    }


def fatal_reasons(cam: CamConfig, law: Law) -> list[str]:
    """Return the reasons why a cam with a law cannot exist, empty if it can."""
    try:
        checks = check_cam(cam, law)
    except CamRigError as error:
        return [str(error)]
    return [str(check) for check in checks if check.is_fatal and not check.passed]


def level(law: Law, rig: RigConfig, rpm: float) -> float:
    """Return the sound level (dB re 20 µPa) of one rigid mass at a speed (rpm).

    It is exact if contact is kept, else it is that of a simulation.
    """
    follower = FollowerParameters.from_rig(rig)
    if law.velocity_jumps or rigid_jump_speed(law, follower) <= rpm * RPM:
        return sound_level(simulate(law, rig, rpm=rpm, turns=LEVEL_TURNS)).level_db
    power = steady_power(law, follower, RadiationParameters.from_rig(rig), rpm * RPM)
    return float(level_db(np.array([math.sqrt(power)]))[0])


def _page_value(compute: Callable[[], float]) -> PageValue:
    """Return a computed value for a page, or the reason why it cannot be computed.

    A value that is not finite is left out.
    """
    try:
        value = compute()
    except CamRigError as error:
        return {"message": str(error)}
    return {"value": value} if math.isfinite(value) else {}


def _angle_deg(disc: Contour, index: int) -> float:
    return math.degrees(disc.angle[index]) % 360.0
