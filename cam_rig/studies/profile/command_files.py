"""``cam-rig profile --from``: the cam's follower on the contours of a file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from cam_rig.errors import ConfigError, OutputError
from cam_rig.files import writing
from cam_rig.profile.contour_files import AS_IT_IS, Placement
from cam_rig.show.command import check_outputs
from cam_rig.show.result import Column, Records, Result
from cam_rig.show.terminal import say
from cam_rig.units import TURN, rms

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.profile.contact import Element
    from cam_rig.profile.measure import Curve
    from cam_rig.profile.polyline import ContourPath
    from cam_rig.schema import CamConfig
    from cam_rig.units import FloatArray


# The files of ``cam-rig profile``: what is asked for, and contours and paths written.

DRAWINGS, TABLES = (".dxf", ".svg"), (".csv",)
READABLE = (".dxf", ".csv")
#: Share of the tolerance that the digits of an SVG may take; a DXF has them all.
SVG_ROUNDING = 0.1
#: Chord error where none is asked for, and the finest: more would be millions of points, µm.
TOLERANCE_UM, FINEST_UM = 1.0, 1e-4
#: Rows of a table where no number is asked for.
ROWS = 3600


@dataclass(frozen=True)
class Request:
    """Files that are written or read; radius in mm, tolerance in µm.

    `placement`, `layer` and `align` are of a file that is read.
    """

    out: Path | None
    pitch: bool
    cutter: float | None
    tolerance: float | None
    points: int | None
    source: Path | None
    placement: Placement = AS_IT_IS
    layer: str | None = None
    align: bool = False

    def require(self, cams: int, drawing: bool) -> None:
        """Refuse, before anything is computed, what does not go together."""
        files = self.out is not None or self.source is not None or drawing
        if files and cams != 1:
            raise ConfigError(f"{cams} cams for one file; allowed: one cam with --out or --plot")
        if (self.pitch or self.cutter is not None) and self.out is None:
            raise ConfigError("--pitch and --cutter need --out FILE: they say what is written")
        if self.pitch and self.cutter is not None:
            raise ConfigError("--pitch and --cutter are two paths; allowed: one of them")
        if self.cutter is not None and not 0.0 < self.cutter < 1e5:
            raise ConfigError(f"--cutter is {self.cutter:g} mm; allowed: more than 0 mm")
        kind = "" if self.out is None or self.source else self.out.suffix.lower()
        for name, value, of in (
            ("tolerance", self.tolerance, DRAWINGS),
            ("points", self.points, TABLES),
        ):
            if value is not None and kind not in of:
                needed = " or ".join(f"--out FILE{suffix}" for suffix in of)
                raise ConfigError(f"--{name}: is of what is written; needed: {needed}")
        if self.tolerance is not None and not self.tolerance >= FINEST_UM:
            raise ConfigError(
                f"--tolerance is {self.tolerance:g} µm; allowed: at least {FINEST_UM:g} µm"
            )
        if self.source is None and (
            self.placement != AS_IT_IS or self.layer is not None or self.align
        ):
            raise ConfigError(
                "--unit, --axis, --zero, --mirrored, --layer and --align are of a file that is "
                "read; needed: --from FILE"
            )
        if self.source is not None:
            if drawing or self.pitch or self.cutter is not None:
                raise ConfigError("--from measures; allowed with it: --out FILE.csv for the law")
            _suffix(self.source, READABLE)
        if self.out is not None:
            _suffix(self.out, TABLES if self.source is not None else (*DRAWINGS, *TABLES))
            check_outputs(str(self.out), None)


def placement(unit: str | None, axis: str, zero: float, mirrored: bool) -> Placement:
    """Return the placement of the options; `axis` is a text such as "120,80" (mm)."""
    try:
        x, y = (float(word) * 1e-3 for word in axis.split(","))
    except ValueError:
        raise ConfigError(f"--axis: is {axis!r}; allowed: two numbers, such as 120,80") from None
    if not all(map(math.isfinite, (x, y, zero))):
        raise ConfigError(f"--axis {axis} --zero {zero:g}: allowed: finite numbers")
    return Placement(unit, (x, y), math.radians(zero), mirrored)


def _suffix(path: Path, allowed: tuple[str, ...]) -> None:
    if (suffix := path.suffix.lower()) not in allowed:
        step = suffix in (".step", ".stp")
        hint = " (no STEP: import the DXF into CAD and extrude it)" if step else ""
        raise ConfigError(f"{path}: unknown kind of file; allowed: {', '.join(allowed)}{hint}")


def write(request: Request, cam: CamConfig, law: Law, force: bool) -> None:
    """Write the contour, the pitch curve or the cutter's path by the file's suffix."""
    from cam_rig.profile import drawing_files
    from cam_rig.profile.polyline import polyline

    assert request.out is not None
    curves, kind = _curves(request, cam, law, force), request.out.suffix.lower()
    rows, tolerance_um = request.points or ROWS, request.tolerance or TOLERANCE_UM
    with writing(request.out) as part:
        if kind in TABLES:
            drawing_files.write_contour(part, curves, rows)
            words = f"{rows} points"
        else:
            tolerance = tolerance_um * 1e-6
            rounding = SVG_ROUNDING * tolerance if kind == ".svg" else 0.0
            lines = {curve.name: polyline(curve, tolerance - rounding) for curve in curves}
            if kind == ".svg":
                drawing_files.write_svg(part, lines, rounding)
            else:
                drawing_files.to_document(lines).saveas(part)
            counts = " and ".join(str(line.shape[1]) for line in lines.values())
            words = f"{counts} points, chord error at most {tolerance_um:g} µm"
    names = " and ".join(curve.name for curve in curves)
    say(f"{names}: {words}: {request.out}")


def _curves(request: Request, cam: CamConfig, law: Law, force: bool) -> list[ContourPath]:
    from cam_rig.profile import polyline as path

    if request.pitch:
        return path.pitch_paths(cam.follower, law)
    if request.cutter is None:
        return path.contour_paths(cam.follower, law)
    curves = path.contour_paths(cam.follower, law, "CUTTER", request.cutter * 1e-3)
    if not force:
        for curve in curves:
            curve.require_room()
    return curves


#: Cam angles at which a follower is read on the contour of a file.
READINGS = 720


@dataclass(frozen=True)
class Measured:
    """A law read from a contour: cam angles (rad), lifts and their error (m); which disc it is."""

    cam: str
    source: str
    disc: str
    points: int
    angle: FloatArray
    lift: FloatArray
    error: FloatArray

    @property
    def largest_at(self) -> int:
        """Where the error is largest."""
        return int(np.argmax(np.abs(self.error)))


@dataclass(frozen=True, repr=False)
class MeasuredResult(Result):
    """The contours of a file, each as the cam's follower reads it."""

    schema = "cam_rig.profile_measured.1"
    columns: ClassVar = {
        "contours": (
            Column("cam"),
            Column("disc"),
            Column("points", "", "d"),
            Column("lift", "mm", ".6g", of=lambda one: float(np.ptp(one.lift))),
            Column(
                "largest_error",
                "µm",
                "+.3g",
                of=lambda one: float(one.error[one.largest_at]),
                doc="of the lift, from the law of the cam",
            ),
            Column("at", "°", "g", of=lambda one: float(one.angle[one.largest_at])),
            Column("rms_error", "µm", ".3g", "r.m.s. error", lambda one: rms(one.error)),
            Column("source", hidden=True, doc="the file"),
        )
    }

    contours: tuple[Measured, ...]

    def tables(self) -> list[Records]:
        """A row a contour."""
        caption = f"{self.contours[0].source}, from the law of {self.contours[0].cam}"
        return [self.table("contours", caption, self.contours)]


#: The other side of a drawing is taken if its error is less than this fraction of the error of the
#: given side: of a symmetrical cam both are the same.
MIRRORED_IS_BETTER = 0.5


def _aligned(
    request: Request, element: Element, curves: list[Curve], law: Law
) -> tuple[list[Curve], float]:
    """Return the contours, from the other side if that fits better, and their rotation (rad)."""
    from cam_rig.profile.measure import find_rotation

    mirrored = [_mirrored(curve) for curve in curves]
    rotation, error = find_rotation(element, curves[0], law)
    other_rotation, other_error = find_rotation(element, mirrored[0], law)
    is_other = other_error < MIRRORED_IS_BETTER * error
    if is_other:
        curves, rotation = mirrored, other_rotation
    is_mirrored = request.placement.is_mirrored != is_other
    sense = 1.0 if is_mirrored else -1.0
    zero = (request.placement.zero + sense * rotation) % TURN
    option = " --mirrored" if is_mirrored else ""
    say(f"{request.source}: aligned with the law: --zero {math.degrees(zero):.6g}{option}")
    return curves, rotation


def _mirrored(curve: Curve) -> Curve:
    """Return a contour as it is seen from the other side."""
    return lambda at: -np.conj(curve(-at))


def measure(request: Request, cam: CamConfig, law: Law) -> MeasuredResult:
    """Put the cam's follower on the contours of a file; write the first one's law if asked to."""
    from cam_rig.profile import drawing_files
    from cam_rig.profile.contact import turn_angles
    from cam_rig.profile.contour_files import read_contour_table
    from cam_rig.profile.disc import discs
    from cam_rig.profile.measure import closed_curve, contour_warnings, rest
    from cam_rig.profile.read_dxf import read_dxf

    assert request.source is not None
    plates = discs(cam.follower, law)
    if request.source.suffix.lower() == ".dxf":
        file = read_dxf(request.source, request.placement, request.layer, len(plates))
    else:
        file = read_contour_table(request.source, request.placement)
    for points in file.curves:
        for warning in contour_warnings(points, file.are_points):
            say(f"warning: {request.source}: {warning}")
    if len(file.curves) != len(plates):
        raise OutputError(
            f"{request.source}: has {len(file.curves)} closed curves; allowed: {len(plates)}, one "
            f"for each contour of a {cam.follower.type} follower; --layer reads one layer"
        )
    curves = [closed_curve(points) for points in file.curves]
    for note in file.notes:
        say(f"{request.source}: {note}")
    angle, rotation = turn_angles(READINGS), 0.0
    if request.align:
        curves, rotation = _aligned(request, plates[0].element, curves, law)
    names, found = (cam.name, str(request.source)), []
    for disc, curve, points in zip(plates, curves, file.curves, strict=True):
        lift = rest(disc.element, curve, angle + rotation)
        found.append(Measured(*names, disc.name, points.shape[1], angle, lift, lift - law(angle)))
    if request.out is not None:
        with writing(request.out) as part:
            drawing_files.write_law(part, angle, found[0].lift)
        say(f"law: {request.out}")
    return MeasuredResult(tuple(found))
