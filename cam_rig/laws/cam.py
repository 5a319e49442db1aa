"""Laws of cam files: segments joined into one law, and sets of cams on a rig."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws.arc_law import concave_flank_cam
from cam_rig.laws.arcs import ConcaveFlankCam
from cam_rig.laws.bernstein import Pieces, join_pieces
from cam_rig.laws.families import family_rise, mirror
from cam_rig.laws.law import Law
from cam_rig.laws.segments import segment_pieces, unit_rise
from cam_rig.laws.spline import greville
from cam_rig.laws.tasks import join_motions
from cam_rig.laws.tuned import has_end_velocity, polydyne, shape
from cam_rig.schema import CamConfig, RigConfig, motions
from cam_rig.schema.segments import Bezier, BSpline, Dwell, Rise, Segment, TangentArcs
from cam_rig.units import TURN, FloatArray

#: Largest step of the lift between two segments that counts as rounding, as a fraction of the lift.
STEP_TOLERANCE = 1e-9
#: Largest difference of the law's range from the lift of its file, as a fraction of the lift. The
#: ordinates of a Bézier curve and the points of a table give the lift to 1 % only.
LIFT_TOLERANCE = 0.02


def build_law(cam: CamConfig) -> Law:
    """Build the law of a cam file.

    Parameters
    ----------
    cam : CamConfig
        Validated cam file.

    Returns
    -------
    Law
        The law over one turn of the cam.

    Raises
    ------
    LawError
        If the segments do not join, the geometry of a segment does not exist, or the law does not
        have the lift of the file.
    """
    fixed_pieces = [segment_pieces(segment, cam) for segment in cam.segments]
    pieces, levels = list[Pieces | None](), [_start_level(cam, fixed_pieces)]
    for i, (segment, fixed) in enumerate(zip(cam.segments, fixed_pieces, strict=True)):
        if isinstance(segment, motions.JoiningMotion):
            pieces.append(None)
            levels.append(motions.level_m(segment.to, cam.lift.si))
            continue
        try:
            placed = fixed or _relative_pieces(segment, levels[-1], cam.lift.si)
        except LawError as error:
            raise LawError(f"cam {cam.name!r}: segments[{i}]: {error}") from None
        _require_no_step(cam, f"segments[{i}]", float(placed[1][0][0]) - levels[-1])
        pieces.append(placed)
        levels.append(float(placed[1][-1][-1]))
    breaks, columns = [0.0], list[FloatArray]()
    for piece_breaks, piece_columns in join_motions(cam, pieces, list(pairwise(levels))):
        breaks += [breaks[-1] + x for x in piece_breaks[1:]]
        columns += piece_columns
    _require_no_step(cam, "the end of the turn", levels[-1] - float(columns[0][0]))
    breaks[-1] = TURN
    law = Law(cam.name, np.array(breaks), join_pieces(columns))
    _require_declared_lift(cam, law)
    return law


def segment_angles(cam: CamConfig) -> list[float]:
    """Return the cam angles (rad) at which the segments start."""
    spans = [segment.span.si for segment in cam.segments]
    return [sum(spans[:i]) for i in range(len(spans))]


def _require_no_step(cam: CamConfig, where: str, gap: float) -> None:
    """Raise LawError if the lift changes by ``gap`` (m) at a joint.

    ``where`` describes the joint in the message.
    """
    if abs(gap) > STEP_TOLERANCE * cam.lift.si:
        raise LawError(
            f"cam {cam.name!r}: {where} steps by {gap / cam.lift.si:.6g} of the lift; allowed: no "
            "step, so start each segment at the end level of the segment before it"
        )


def _require_declared_lift(cam: CamConfig, law: Law) -> None:
    """Raise LawError if the range of the law is not the lift of the file.

    A forgotten fall is the usual reason.
    """
    declared = cam.lift.si
    exact = Rise | Dwell | motions.SccaRise | motions.HandbookRise
    has_levels_only = all(isinstance(segment, exact) for segment in cam.segments)
    tolerance = STEP_TOLERANCE if has_levels_only else LIFT_TOLERANCE
    if abs(law.lift - declared) <= tolerance * declared:
        return
    start, last = float(law.ordinates[0, 0]) / declared, len(cam.segments) - 1
    below = f"segments[0] starts at {start:.4g}, the end level of segments[{last}]: "
    raise LawError(
        f"cam {cam.name!r}: {below if start > STEP_TOLERANCE else ''}the law rises by "
        f"{law.lift * 1e3:.6g} mm, lift is {declared * 1e3:.6g} mm; allowed: the same within "
        f"{tolerance * 100:.6g} %, so add a segment that falls to 0, scale the segment's numbers "
        "so that the law rises to 1, give a longer span or other ends, or state this lift"
    )


def _start_level(cam: CamConfig, fixed_pieces: list[Pieces | None]) -> float:
    """Return the lift (m) of the law at cam angle 0.

    It is the level at the end of the last segment, because the turn repeats.
    """
    rise = 0.0
    for segment, pieces in zip(reversed(cam.segments), reversed(fixed_pieces), strict=True):
        if isinstance(segment, Rise) and segment.velocity is not None:
            rise += segment.velocity.si * segment.span.si
        elif isinstance(segment, Rise | motions.LevelSegment):
            return _end_level(segment, 0.0, cam.lift.si) + rise
        elif isinstance(segment, TangentArcs):
            return rise  # from the base circle, without the rounding of its pitch radius
        elif pieces is not None:
            return float(pieces[1][-1][-1]) + rise
    return 0.0


def _relative_pieces(segment: Segment, level: float, lift: float) -> Pieces:
    """Return the pieces of a dwell or named rise that starts at a lift (m).

    The lift is ``level``. ``lift`` is the lift of the cam, m.
    """
    span = float(segment.span.si)
    if isinstance(segment, Dwell):
        return [0.0, span], [np.array([level])]
    assert isinstance(segment, Rise | motions.HandbookRise | motions.SccaRise | motions.Polydyne)
    breaks, pieces = _unit_pieces(segment)
    height = _end_level(segment, level, lift) - level
    return [span * u for u in breaks], [level + height * piece for piece in pieces]


def _unit_pieces(
    segment: Rise | motions.HandbookRise | motions.SccaRise | motions.Polydyne,
) -> Pieces:
    """Return the pieces of a segment's rise from 0 to 1 over u from 0 to 1."""
    if isinstance(segment, motions.Polydyne):
        return polydyne(segment)
    if isinstance(segment, Rise):
        pieces = unit_rise(segment.law)
    else:
        pieces = family_rise(segment.law, segment.parameters)
        pieces = mirror(pieces) if segment.mirrored else pieces
    if segment.shaping is None:
        return pieces
    if has_end_velocity(pieces):
        raise LawError(f"shaping: the law is {segment.law}; allowed: a rise between rests")
    return shape(pieces, segment.span.si, segment.shaping)


def _end_level(segment: Rise | motions.LevelSegment, level: float, lift: float) -> float:
    """Return the level (m) at which a segment ends that starts at ``level`` (m).

    ``lift`` is the lift of the cam, m.
    """
    if isinstance(segment, Rise) and segment.velocity is not None:
        return level + segment.velocity.si * segment.span.si
    assert segment.to is not None
    return motions.level_m(segment.to, lift)


def arc_cam(cam: CamConfig) -> ConcaveFlankCam:
    """Return the circles of a cam with a segment of tangent arcs, on its pitch curve.

    Raises
    ------
    LawError
        If the cam has no such segment.
    """
    for segment in cam.segments:
        if isinstance(segment, TangentArcs):
            return concave_flank_cam(segment, cam)
    raise LawError(f"cam {cam.name!r} has no tangent_arcs segment")


# Control polygons of the Bézier and B-spline segments of a cam.


def control_polygons(cam: CamConfig) -> list[tuple[FloatArray, FloatArray]]:
    """Return the control polygon of each Bézier and B-spline segment.

    A polygon is a pair of cam angles (rad) and ordinates (m). The angles of a B-spline are its
    Greville abscissae.
    """
    polygons = []
    for segment, start in zip(cam.segments, segment_angles(cam), strict=True):
        if isinstance(segment, Bezier | BSpline):
            ordinates = cam.lift.si * np.array(segment.ordinates.numbers)
            polygons.append((start + segment.span.si * abscissae(segment), ordinates))
    return polygons


def abscissae(segment: Bezier | BSpline) -> FloatArray:
    """Return the abscissae of a segment's ordinates, from 0 to 1.

    Those of a B-spline are its Greville abscissae.
    """
    if isinstance(segment, Bezier):
        return np.linspace(0.0, 1.0, len(segment.ordinates.numbers))
    knots = np.array(segment.knots.numbers)
    return np.asarray((greville(knots, segment.degree) - knots[0]) / (knots[-1] - knots[0]))


# Cams on a rig: their laws, and the check that the dynamic models support their followers.


def require_sprung(path: Path | str, cam: CamConfig) -> None:
    """Raise ConfigError if the dynamic models do not support the follower of a cam.

    ``path`` is named in the error.
    """
    if not cam.follower.sprung:
        raise ConfigError(
            f"{path}: follower.type is {cam.follower.type!r}; allowed on a rig: a follower "
            "that only a closing spring keeps on the cam (the dynamic models have one contact)"
        )


def law_of(path: Path | str, cam: CamConfig) -> Law:
    """Build the law of a cam, and name ``path`` in errors.

    Raises
    ------
    LawError
        As `build_law`.
    """
    try:
        return build_law(cam)
    except LawError as error:
        raise LawError(f"{path}: {error}") from None


# Cams that are compared on one rig, all checked before any computation.


@dataclass(frozen=True)
class CamSet:
    """Set of cams by name, in order, with their laws and the rig that turns them."""

    cams: dict[str, CamConfig]
    laws: dict[str, Law]
    rig: RigConfig

    @property
    def titles(self) -> dict[str, str]:
        """Title of each cam, by its name."""
        return {name: cam.title for name, cam in self.cams.items()}

    @property
    def pairs(self) -> list[tuple[CamConfig, Law]]:
        """Each cam with its law."""
        return [(self.cams[name], law) for name, law in self.laws.items()]

    def select(self, names: Iterable[str]) -> CamSet:
        """Return the set with the named cams only."""
        laws = {name: self.laws[name] for name in names}
        return CamSet({name: self.cams[name] for name in laws}, laws, self.rig)


def build_laws(
    cams: Iterable[tuple[Path | str, CamConfig]],
) -> tuple[dict[str, CamConfig], dict[str, Law]]:
    """Build the laws of several cams.

    Parameters
    ----------
    cams : iterable of (Path or str, CamConfig)
        Pairs of the file or name that errors report, and the cam.

    Returns
    -------
    dict of str to CamConfig, dict of str to Law
        The cams and their laws by the name of the cam, in order.

    Raises
    ------
    ConfigError
        If two cams have the same name, or a follower is not supported.
    LawError
        As `build_law`.
    """
    named: dict[str, CamConfig] = {}
    laws = {}
    for path, cam in cams:
        if cam.name in named:
            raise ConfigError(f"{path}: cam {cam.name!r} is named twice; allowed: each once")
        require_sprung(path, cam)
        named[cam.name], laws[cam.name] = cam, law_of(path, cam)
    return named, laws
