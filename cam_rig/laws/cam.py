"""Segments joined into one cam's law."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws.arc_law import circles
from cam_rig.laws.arcs import ConcaveFlankCam
from cam_rig.laws.bernstein import Pieces, joined
from cam_rig.laws.law import Law
from cam_rig.laws.segments import own_pieces, unit_rise
from cam_rig.laws.spline import greville
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.segments import Bezier, BSpline, Rise, Segment, TangentArcs
from cam_rig.units import TURN, FloatArray

#: A step between two segments smaller than this fraction of the lift is rounding.
STEP_TOLERANCE = 1e-9
#: Largest difference of the law's range from the lift of its file, as a fraction of the lift. The
#: ordinates of a Bézier curve and the points of a table give the lift to 1 % only.
LIFT_TOLERANCE = 0.02


def build_law(cam: CamConfig) -> Law:
    """The law of a cam file.

    Raises
    ------
    LawError : the segments do not join, a segment's geometry does not exist, or the law does not
        have the lift of the file

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> round(law.lift, 6), float(law(0.0, 2))  # m, and m/rad² at cam angle 0
    (0.05, 0.0)
    """
    own = [own_pieces(segment, cam) for segment in cam.segments]
    breaks, columns, level = [0.0], [], _start_level(cam, own)
    for i, (segment, pieces) in enumerate(zip(cam.segments, own, strict=True)):
        steps, parts = pieces or _relative(segment, level, cam.lift.si)
        _require_no_step(cam, f"segments[{i}]", float(parts[0][0]) - level)
        breaks += [breaks[-1] + step for step in steps[1:]]
        columns += parts
        level = float(parts[-1][-1])
    _require_no_step(cam, "the end of the turn", level - float(columns[0][0]))
    breaks[-1] = TURN
    law = Law(cam.name, np.array(breaks), joined(columns))
    _require_declared_lift(cam, law)
    return law


def segment_angles(cam: CamConfig) -> list[float]:
    """Cam angles (rad) at which the segments begin."""
    spans = [segment.span.si for segment in cam.segments]
    return [sum(spans[:i]) for i in range(len(spans))]


def _require_no_step(cam: CamConfig, where: str, gap: float) -> None:
    if abs(gap) > STEP_TOLERANCE * cam.lift.si:
        raise LawError(
            f"cam {cam.name!r}: {where} steps by {gap / cam.lift.si:.6g} of the lift; allowed: no "
            "step, so let each segment begin where the one before it ends"
        )


def _require_declared_lift(cam: CamConfig, law: Law) -> None:
    """Refuse a law whose range is not the lift of the file, as if a fall was forgotten."""
    declared = cam.lift.si
    if abs(law.lift - declared) <= LIFT_TOLERANCE * declared:
        return
    start, last = float(law.ordinates[0, 0]) / declared, len(cam.segments) - 1
    below = f"segments[0] starts at {start:.4g}, the end level of segments[{last}]: "
    raise LawError(
        f"cam {cam.name!r}: {below if start > STEP_TOLERANCE else ''}the law rises by "
        f"{law.lift * 1e3:.6g} mm, lift is {declared * 1e3:.6g} mm; allowed: the same within "
        f"{LIFT_TOLERANCE:.0%}, so add a segment that falls to 0, or scale the segment's numbers "
        "so that the law rises to 1"
    )


def _start_level(cam: CamConfig, own: list[Pieces | None]) -> float:
    """Level (m) at θ = 0: the one the last segment leaves the turn with."""
    for segment, pieces in zip(reversed(cam.segments), reversed(own), strict=True):
        if isinstance(segment, Rise):
            return segment.to * cam.lift.si
        if isinstance(segment, TangentArcs):
            return 0.0  # the base circle, without the rounding of its pitch radius
        if pieces is not None:
            return float(pieces[1][-1][-1])
    return 0.0


def _relative(segment: Segment, level: float, lift: float) -> Pieces:
    """A dwell or a named rise, from the level (m) reached so far."""
    span = float(segment.span.si)
    if not isinstance(segment, Rise):
        return [0.0, span], [np.array([level])]
    breaks, pieces = unit_rise(segment.law)
    height = segment.to * lift - level
    return [span * u for u in breaks], [level + height * piece for piece in pieces]


def arc_cam(cam: CamConfig) -> ConcaveFlankCam:
    """The circles of a cam that has a segment of tangent arcs, on its pitch curve."""
    for segment in cam.segments:
        if isinstance(segment, TangentArcs):
            return circles(segment, cam)
    raise LawError(f"cam {cam.name!r} has no tangent_arcs segment")


# The control polygons of a cam's Bézier and B-spline segments.


def control_polygons(cam: CamConfig) -> list[tuple[FloatArray, FloatArray]]:
    """Cam angles (rad; Greville's of a B-spline) and ordinates (m), a pair a segment with any."""
    found = []
    for segment, start in zip(cam.segments, segment_angles(cam), strict=True):
        if isinstance(segment, Bezier | BSpline):
            ordinates = cam.lift.si * np.array(segment.ordinates.numbers)
            found.append((start + segment.span.si * abscissae(segment), ordinates))
    return found


def abscissae(segment: Bezier | BSpline) -> FloatArray:
    """Where the ordinates of a segment stand, from 0 to 1; Greville's of a B-spline."""
    if isinstance(segment, Bezier):
        return np.linspace(0.0, 1.0, len(segment.ordinates.numbers))
    knots = np.array(segment.knots.numbers)
    return np.asarray((greville(knots, segment.degree) - knots[0]) / (knots[-1] - knots[0]))


# A cam file as a rig can use it: its law, and the refusal of a follower no model knows.


def require_sprung(path: Path | str, cam: CamConfig) -> None:
    """Refuse a cam whose follower the dynamic models do not know."""
    if not cam.follower.sprung:
        raise ConfigError(
            f"{path}: follower.type is {cam.follower.type!r}; allowed on a rig: one that a closing "
            "spring alone holds on the cam (the dynamic models know no second contact)"
        )


def law_of(path: Path | str, cam: CamConfig) -> Law:
    """The law of a cam, its errors with the name of its file."""
    try:
        return build_law(cam)
    except LawError as error:
        raise LawError(f"{path}: {error}") from None


# Cams to compare on one rig: read and checked before anything runs.


@dataclass(frozen=True)
class CamSet:
    """Cams by name in order, their laws, and the rig they turn on."""

    cams: dict[str, CamConfig]
    laws: dict[str, Law]
    rig: RigConfig

    @property
    def titles(self) -> dict[str, str]:
        """What each cam is called."""
        return {name: cam.title for name, cam in self.cams.items()}

    @property
    def pairs(self) -> list[tuple[CamConfig, Law]]:
        """Each cam with its law."""
        return [(self.cams[name], law) for name, law in self.laws.items()]

    def only(self, names: Iterable[str]) -> CamSet:
        """The set of some of the cams."""
        laws = {name: self.laws[name] for name in names}
        return CamSet({name: self.cams[name] for name in laws}, laws, self.rig)


def cam_set(cams: Iterable[tuple[Path | str, CamConfig]], rig: RigConfig) -> CamSet:
    """Cams, each with the file or the name that an error tells, on a rig."""
    found: dict[str, CamConfig] = {}
    laws = {}
    for path, cam in cams:
        if cam.name in found:
            raise ConfigError(f"{path}: cam {cam.name!r} is named twice; allowed: each once")
        require_sprung(path, cam)
        found[cam.name], laws[cam.name] = cam, law_of(path, cam)
    return CamSet(found, laws, rig)
