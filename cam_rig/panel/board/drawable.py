"""A cam as Bézier curves and B-splines between dwells, whose ordinates can be drawn.

A cam that is made of these alone has its own ordinates. Any other is written as B-splines in its
events: exactly where its law is made of polynomials, else as the nearest in s and s''.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline as Spline

from cam_rig.acoustics import RadiationParameters, level_db
from cam_rig.acoustics.pressure import steady_power
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.dynamics.vibration import residual_vibration
from cam_rig.errors import CamRigError, ConfigError
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import SMOOTHEST, joints
from cam_rig.profile import Contour, contours
from cam_rig.profile.cam_checks import check_cam, greatest_allowed
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import quantity, valid_cam
from cam_rig.schema.segments import MAX_B_SPLINE_DEGREE, MAX_B_SPLINE_ORDINATES, Bezier, BSpline
from cam_rig.show.looks import millimetres
from cam_rig.studies.design.result import spline_cam_data
from cam_rig.studies.design.space import LawEvent, events
from cam_rig.studies.simulate.motion import simulate
from cam_rig.studies.simulate.sound import sound_level
from cam_rig.units import RPM, TURN, FloatArray

#: Pieces of each event at least, the longest of them (rad), and their lowest degree: with it s'''
#: has no step at a knot between the law's own joints, whatever is dragged.
PIECES, LONGEST, DEGREE = 16, TURN / 30, 5
#: Joints of a start are kept up to this derivative.
KEPT = 3
#: Gauss points of a piece, at which laws are compared, and how much a difference of s (in lifts)
#: weighs against one of s'' (in its r.m.s.). By s'' alone the law of arcs, whose s'' steps, would
#: be an eighth of the lift off; by s alone the B-spline would swing between its steps.
GAUSS, WEIGHT = 16, 10.0
#: Points of a turn at which the distance is measured, and the part of the lift up to which it is
#: rounding.
COMPARED, SAME = 3600, 1e-12
#: Segments whose ordinates are drawn.
DRAWN = (Bezier, BSpline)
Drawn = Bezier | BSpline


@dataclass(frozen=True, eq=False)
class DrawableCam:
    """A cam of drawable segments and dwells alone, with its law.

    The ordinates are the file's ``own``, or B-splines stand for its law: they are nowhere farther
    from it than ``distance`` (m).
    """

    cam: CamConfig
    law: Law
    own: bool
    distance: float

    @property
    def exact(self) -> bool:
        """Whether what is drawn is the file's law, rounding aside."""
        return self.distance <= SAME * self.law.lift


def with_own_ordinates(cam: CamConfig) -> DrawableCam | None:
    """The cam itself, where its segments are drawable and dwells alone."""
    kinds = {type(segment) for segment in cam.segments if segment.law != "dwell"}
    if not kinds or not kinds <= set(DRAWN):
        return None
    return DrawableCam(cam, build_law(cam), True, 0.0)


def as_b_splines(cam: CamConfig) -> DrawableCam:
    """The cam with B-splines in its events: of polynomials its law, else the nearest."""
    law = build_law(cam)
    found = events(law, 0)
    splines = [_in_file(_nearest(law, event), cam.name) for event in found]
    drawn = valid_cam(spline_cam_data(cam, law, found, splines, cam.name, cam.title))
    drawn_law = build_law(drawn)
    angles = np.linspace(0.0, TURN, COMPARED, endpoint=False)
    distance = float(np.abs(drawn_law(angles) - law(angles)).max())
    return DrawableCam(drawn, drawn_law, False, distance)


def _in_file(spline: Spline, name: str) -> dict[str, Any]:
    """As a cam's file has it: without scipy's outermost knots."""
    return {
        "degree": int(spline.k),
        "knots": quantity(
            "assumed", spline.t[1:-1].tolist(), "1", f"joints of {name}, and between"
        ),
        "ordinates": quantity("identified", (spline.c + 0.0).tolist(), "1", f"the law of {name}"),
    }


def _nearest(law: Law, event: LawEvent) -> Spline:
    """Nearest in s and s'' by least squares, with the ends' derivatives; in lifts over [0, 1]."""
    degree = law.degree if DEGREE <= law.degree <= MAX_B_SPLINE_DEGREE else DEGREE
    knots, smooth = _knots(law, event, degree)
    count = knots.size - degree - 1
    if count > MAX_B_SPLINE_ORDINATES:
        raise ConfigError(
            f"{law.name}: its law has too many pieces from {math.degrees(event.start):.4g}° on, "
            f"for {count} ordinates; allowed: {MAX_B_SPLINE_ORDINATES}, so fit it with cam-rig fit"
        )
    unit = Spline(knots, np.eye(count), degree)
    ends = [np.arange(smooth[0] + 1), count - 1 - np.arange(smooth[1] + 1)]
    ordinates = np.zeros(count)
    for end, fixed in enumerate(ends):
        rows = [unit(float(end), k)[fixed] for k in range(fixed.size)]
        ordinates[fixed] = np.linalg.solve(np.array(rows), _at_end(law, event, end, fixed.size))
    inside, edges = 0.5 * (np.polynomial.legendre.leggauss(GAUSS)[0] + 1.0), np.unique(knots)
    at = (edges[:-1, None] + np.diff(edges)[:, None] * inside).ravel()
    lift, curvature = (law(event.start + event.span * at, k) / law.lift for k in (0, 2))
    curvature *= event.span**2
    rms = math.sqrt(float(np.mean(curvature**2))) or 1.0
    wanted = np.concatenate([curvature / rms, WEIGHT * lift])
    table = np.concatenate([unit(at, 2) / rms, WEIGHT * unit(at)])
    free = np.setdiff1d(np.arange(count), np.concatenate(ends))
    ordinates[free] = np.linalg.lstsq(table[:, free], wanted - table @ ordinates)[0]
    return Spline(knots, ordinates, degree)


def _knots(law: Law, event: LawEvent, degree: int) -> tuple[FloatArray, list[int]]:
    """Knots over [0, 1], the law's own joints and more between them; how smooth both ends are."""
    found = {joint.angle: joint.continuity for joint in joints(law)}
    ends = [np.argmin(np.abs(law.breaks - event.start - part * event.span)) for part in (0, 1)]
    edges = law.breaks[ends[0] : ends[1] + 1].tolist()
    if law.degree > MAX_B_SPLINE_DEGREE:  # pieces of a fit: smooth seams are none of the law's
        inner = [angle for angle in edges[1:-1] if found[angle] < SMOOTHEST]
        edges = [edges[0], *inner, edges[-1]]
    knots, longest = [0.0] * (degree + 1), min(LONGEST, event.span / PIECES)
    for left, right in pairwise(edges):
        parts = max(1, math.ceil((right - left) / longest * (1.0 - SAME)))
        begin, stop = ((angle - event.start) / event.span for angle in (left, right))
        steps = begin + (stop - begin) * np.arange(1, parts + 1) / parts
        own = 1 if right == edges[-1] else max(1, degree - max(0, found[right]))
        knots += [*steps[:-1].tolist(), *[float(steps[-1])] * own]
    knots[-1:] = [1.0] * (degree + 1)
    smooth = [min(KEPT, max(0, found[angle % TURN])) for angle in (edges[0], edges[-1])]
    return np.array(knots), smooth


def _at_end(law: Law, event: LawEvent, end: int, count: int) -> list[float]:
    """S and its derivatives, in lifts over the span, beyond its start (0) or end (1): a dwell's."""
    angle = event.start + end * event.span
    begins = int(np.argmin(np.abs(law.breaks - angle)))
    piece, side = (begins % law.spans.size, 0) if end else ((begins - 1) % law.spans.size, -1)
    derivatives = [law.derivative_ordinates(k)[side, piece] for k in range(count)]
    return [float(d) * event.span**k / law.lift for k, d in enumerate(derivatives)]


# What a law comes to, exactly: at once for every change, and what takes longer once it rests.

#: Points of a contour on the page.
POINTS = 360
#: Turns that are simulated for the level where contact is lost; the first settles.
TURNS = 6
#: A value for the page: a number, or the words on why there is none; empty for infinity.
Found = dict[str, float | str]


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
        return {"discs": [], "faults": faults, "warnings": [], "jump_rigid": jump, "pressure": None}
    shown, faults, warnings, pressure = [], [], [], list[dict[str, float]]()
    for disc in discs:
        allowed = greatest_allowed(cam.follower, disc.disc.element)
        undercut, steep = disc.rate <= 0.0, np.abs(disc.pressure) > allowed
        shown.append(_shown(disc, undercut, steep))
        if undercut.any():
            at = int(np.argmin(disc.rate))
            faults.append({"key": "undercut", "angle_deg": _degrees(disc, at)})
        at = int(np.argmax(np.abs(disc.pressure)))
        value = math.degrees(abs(disc.pressure[at]))
        pressure.append({"value_deg": value, "allowed_deg": math.degrees(allowed)})
        if steep.any():
            words = {"key": "pressure", "angle_deg": _degrees(disc, at)}
            warnings.append(words | pressure[-1])
    worst = max(pressure, key=lambda one: one["value_deg"] - one["allowed_deg"])
    found = {"discs": shown, "faults": faults, "warnings": warnings}
    return found | {"jump_rigid": jump, "pressure": worst}


def at_rest(cam: CamConfig, law: Law, rig: RigConfig, rpm: float) -> dict[str, Any]:
    """Jump speed on the rig's own follower, residual vibration, level, and all checks; 0.2 s."""

    def residual() -> float:
        follower, speed = FollowerParameters.on_stem(rig, "the residual vibration"), rpm * RPM
        return 1e6 * float(residual_vibration(law, follower, np.array([speed]))[0])

    vital, failed = failing(cam, law)
    return {
        "jump": _found(lambda: _jump(law, rig)),
        "residual_um": _found(residual),
        "level_db": _found(lambda: level(law, rig, rpm)),
        "checks": failed,
        "made": not vital,
    }


def failing(cam: CamConfig, law: Law) -> tuple[list[str], list[str]]:
    """What of a law on its cam cannot exist, and all checks that fail, in words."""
    try:
        failed = [check for check in check_cam(cam, law) if not check.passed]
    except CamRigError as error:
        return [str(error)], [str(error)]
    return [str(check) for check in failed if check.vital], [str(check) for check in failed]


def file_jump(cam: CamConfig, rig: RigConfig) -> Found:
    """Jump speed (rpm) of a file's own law, beside that of the B-splines that stand for it."""
    return _found(lambda: _jump(build_law(cam), rig))


def _jump(law: Law, rig: RigConfig) -> float:
    return find_jump(law, follower_of(rig), FROM_REST).rpm


def level(law: Law, rig: RigConfig, rpm: float) -> float:
    """Level (dB re 20 µPa) of one rigid mass: exact in contact, else of a simulation."""
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


def _shown(disc: Contour, undercut: NDArray[np.bool_], steep: NDArray[np.bool_]) -> dict[str, Any]:
    """A contour for the page, lengths in mm; ``undercut`` and ``steep`` are indices of points."""
    return {
        "points": millimetres(disc.points),
        "pitch": None if disc.pitch is None else millimetres(disc.pitch),
        "undercut": np.flatnonzero(undercut).tolist(),
        "steep": np.flatnonzero(steep).tolist(),
    }
