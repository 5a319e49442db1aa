"""Files of ``cam-rig profile``: contours that it writes, and contours that it measures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from cam_rig.errors import ConfigError, OutputError, ProfileError
from cam_rig.files import atomic_write
from cam_rig.profile.contour_files import UNPLACED, Placement
from cam_rig.show.command import check_outputs
from cam_rig.show.result import Column, Records, Result
from cam_rig.show.tables import pluralize
from cam_rig.show.terminal import say
from cam_rig.units import TURN, rms

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.profile.contact import Element
    from cam_rig.profile.measure import Curve
    from cam_rig.profile.polyline import ContourPath
    from cam_rig.schema import CamConfig
    from cam_rig.units import FloatArray


#: Suffixes of the drawing files that ``cam-rig profile`` can write.
DRAWINGS = (".dxf", ".svg")
#: Suffixes of the table files that ``cam-rig profile`` can write.
TABLES = (".csv",)
#: Suffixes of the contour files that ``cam-rig profile`` can read.
READABLE = (".dxf", ".csv")
#: Fraction of the allowed chord error that is reserved for the rounding of coordinates in an SVG
#: drawing. A DXF drawing has all digits.
SVG_ROUNDING = 0.1
#: Default of the largest allowed distance of a drawn polyline from the exact contour (chord error),
#: µm.
DEFAULT_TOLERANCE_UM = 1.0
#: Smallest chord error that can be requested, µm. Smaller values would require millions of points.
MIN_TOLERANCE_UM = 1e-4
#: Default number of points of a contour in a written table.
DEFAULT_ROWS = 3600


@dataclass(frozen=True)
class Request:
    """Options of ``cam-rig profile`` on files to write or to read.

    Parameters
    ----------
    out : Path, optional
        File to write.
    pitch : bool
        True if the pitch curve is written instead of the contour.
    cutter : float, optional
        Radius in mm of the cutter whose path is written.
    tolerance : float, optional
        Chord error in µm.
    points : int, optional
        Rows of a table.
    source : Path, optional
        File to read.
    placement : Placement
        Placement of the contour in `source`.
    layer : str, optional
        Layer of the drawing `source`.
    align : bool
        True if the zero direction and the side of `source` are fitted to the law.
    """

    out: Path | None
    pitch: bool
    cutter: float | None
    tolerance: float | None
    points: int | None
    source: Path | None
    placement: Placement = UNPLACED
    layer: str | None = None
    align: bool = False

    def validate(self, cams: int, drawing: bool) -> None:
        """Raise a `ConfigError` for options that cannot be combined.

        ``cams`` is the number of cams, ``drawing`` is True if a figure is requested.
        """
        files = self.out is not None or self.source is not None or drawing
        if files and cams != 1:
            raise ConfigError(f"--out and --plot require one cam, got {cams}")
        if (self.pitch or self.cutter is not None) and self.out is None:
            raise ConfigError("--pitch and --cutter need --out FILE, the file to write")
        if self.pitch and self.cutter is not None:
            raise ConfigError("--pitch cannot be combined with --cutter")
        if self.cutter is not None and not 0.0 < self.cutter < 1e5:
            raise ConfigError(f"--cutter must be above 0 mm, got {self.cutter:g}")
        kind = "" if self.out is None or self.source else self.out.suffix.lower()
        for name, value, suffixes in (
            ("tolerance", self.tolerance, DRAWINGS),
            ("points", self.points, TABLES),
        ):
            if value is not None and kind not in suffixes:
                needed = " or ".join(f"--out FILE{suffix}" for suffix in suffixes)
                raise ConfigError(f"--{name} requires {needed}")
        if self.tolerance is not None and not self.tolerance >= MIN_TOLERANCE_UM:
            raise ConfigError(
                f"--tolerance must be at least {MIN_TOLERANCE_UM:g} µm, got {self.tolerance:g}"
            )
        if self.source is None and (
            self.placement != UNPLACED or self.layer is not None or self.align
        ):
            raise ConfigError(
                "--unit, --axis, --zero, --mirrored, --layer and --align require --from FILE"
            )
        if self.source is not None:
            if drawing or self.pitch or self.cutter is not None:
                raise ConfigError("--from cannot be combined with --plot, --pitch or --cutter")
            _check_suffix(self.source, READABLE)
        if self.out is not None:
            _check_suffix(self.out, TABLES if self.source is not None else (*DRAWINGS, *TABLES))
            check_outputs(str(self.out), None)


def make_placement(unit: str | None, axis: str, zero: float, mirrored: bool) -> Placement:
    """Return the placement of a contour in a file, from the options of the command.

    `axis` is the position of the cam's axis in mm as text, such as "120,80". `zero` is the
    direction of cam angle 0 in degrees.
    """
    try:
        x, y = (float(word) * 1e-3 for word in axis.split(","))
    except ValueError:
        raise ConfigError(f"--axis must be two numbers, such as 120,80, got {axis!r}") from None
    if not all(map(math.isfinite, (x, y, zero))):
        raise ConfigError(f"--axis and --zero must be finite, got {axis} and {zero:g}")
    return Placement(unit, (x, y), math.radians(zero), mirrored)


def _check_suffix(path: Path, suffixes: tuple[str, ...]) -> None:
    """Raise a `ConfigError` if the suffix of a path is not one of ``suffixes``."""
    if (suffix := path.suffix.lower()) not in suffixes:
        step = suffix in (".step", ".stp")
        hint = " (no STEP: import the DXF into CAD and extrude it)" if step else ""
        raise ConfigError(f"{path} must end in {' or '.join(suffixes)}{hint}")


def write(request: Request, cam: CamConfig, law: Law, force: bool) -> None:
    """Write the contour, the pitch curve or the cutter path of a cam to a file.

    The suffix of the file determines its format. If ``force`` is True, a cutter that does not fit
    into the contour is allowed.
    """
    from cam_rig.profile import drawing_files
    from cam_rig.profile.polyline import polyline

    assert request.out is not None
    curves, kind = _curves(request, cam, law, force), request.out.suffix.lower()
    rows, tolerance_um = request.points or DEFAULT_ROWS, request.tolerance or DEFAULT_TOLERANCE_UM
    with atomic_write(request.out) as part:
        if kind in TABLES:
            drawing_files.write_contour(part, curves, rows)
            summary = f"{rows} points"
        else:
            tolerance = tolerance_um * 1e-6
            rounding = SVG_ROUNDING * tolerance if kind == ".svg" else 0.0
            lines = {curve.name: polyline(curve, tolerance - rounding) for curve in curves}
            if kind == ".svg":
                drawing_files.write_svg(part, lines, rounding)
            else:
                drawing_files.to_document(lines).saveas(part)
            counts = " and ".join(str(line.shape[1]) for line in lines.values())
            summary = f"{counts} points, chord error at most {tolerance_um:g} µm"
    names = " and ".join(curve.name for curve in curves)
    say(f"{names}: {summary}: {request.out}")


def _curves(request: Request, cam: CamConfig, law: Law, force: bool) -> list[ContourPath]:
    """Return the curves to write: contours, pitch curves or cutter paths.

    Raises an error if the cutter does not fit into the contour, unless ``force`` is True.
    """
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


#: Number of equally spaced cam angles at which the lift on a contour from a file is computed.
READINGS = 720


@dataclass(frozen=True)
class MeasuredContour:
    """Lift of a follower on a contour from a file, compared with the cam's law.

    Parameters
    ----------
    cam, source, disc : str
        Names of the cam, of the file, and of the disc of conjugate cams.
    points : int
        Points of the contour in the file.
    angle : FloatArray
        Cam angles in rad.
    lift : FloatArray
        Lifts in m.
    error : FloatArray
        Differences of the lifts from the law in m.
    """

    cam: str
    source: str
    disc: str
    points: int
    angle: FloatArray
    lift: FloatArray
    error: FloatArray

    @property
    def worst_index(self) -> int:
        """Index of the cam angle at which the lift on a contour differs most from the law."""
        return int(np.argmax(np.abs(self.error)))


@dataclass(frozen=True, repr=False)
class MeasuredResult(Result):
    """Lifts of a cam's follower that were computed on the contours of a file."""

    schema = "cam_rig.profile_measured.1"
    columns: ClassVar = {
        "contours": (
            Column("cam"),
            Column("disc"),
            Column("points", "", "d"),
            Column("lift", "mm", ".6g", of=lambda contour: float(np.ptp(contour.lift))),
            Column(
                "largest_error",
                "µm",
                "+.3g",
                of=lambda contour: float(contour.error[contour.worst_index]),
                doc="largest error of the lift, compared with the law of the cam",
            ),
            Column("at", "°", "g", of=lambda contour: float(contour.angle[contour.worst_index])),
            Column("rms_error", "µm", ".3g", "r.m.s. error", lambda contour: rms(contour.error)),
            Column("source", hidden=True, doc="name of the file"),
        )
    }

    contours: tuple[MeasuredContour, ...]

    def tables(self) -> list[Records]:
        """Return the table `contours` with errors of the lift, one row per contour."""
        caption = f"{self.contours[0].source}, from the law of {self.contours[0].cam}"
        return [self.table("contours", caption, self.contours)]


#: The mirrored contour is used if its error is below this fraction of the error of the contour as
#: read. For a symmetrical cam the two errors are equal.
MIRRORED_IS_BETTER = 0.5


def _align(
    request: Request, element: Element, curves: list[Curve], law: Law
) -> tuple[list[Curve], float]:
    """Return the contours, and the rotation (rad) with which they fit the law best.

    The contours are mirrored if that fits better. The command-line options for the resulting
    placement are printed. ``request`` contains the options, ``element`` is the roller, point or
    face of the follower, and ``curves`` are the contours.
    """
    from cam_rig.profile.measure import find_rotation

    mirrored = [_mirror(curve) for curve in curves]
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


def _mirror(curve: Curve) -> Curve:
    """Return a contour mirrored at the y axis, as if the cam were viewed from behind."""
    return lambda parameter: -np.conj(curve(-parameter))


def _read_curves(
    request: Request, cam: CamConfig, count: int
) -> tuple[list[FloatArray], list[Curve]]:
    """Return the contours in a file as points and as closed curves.

    ``count`` is the required number of contours. Notes and warnings on the file are printed.
    """
    from cam_rig.profile.contour_files import read_contour_table
    from cam_rig.profile.measure import closed_curve, contour_warnings, require_axis_inside
    from cam_rig.profile.read_dxf import read_dxf

    assert request.source is not None
    if request.source.suffix.lower() == ".dxf":
        file = read_dxf(request.source, request.placement, request.layer, count)
    else:
        file = read_contour_table(request.source, request.placement)
    if len(file.curves) != count:
        raise OutputError(
            f"{request.source}: the file must have {pluralize(count, 'closed curve')}, one "
            f"for each contour of a {cam.follower.type} follower, got {len(file.curves)}; --layer "
            "reads one layer"
        )
    try:
        curves = [closed_curve(points) for points in file.curves]
        for points in file.curves:
            for warning in contour_warnings(points, file.are_points):
                say(f"warning: {request.source}: {warning}")
            require_axis_inside(points, request.placement)
    except ProfileError as error:
        raise ProfileError(f"{request.source}: {error}") from None
    for note in file.notes:
        say(f"{request.source}: {note}")
    return list(file.curves), curves


def measure(request: Request, cam: CamConfig, law: Law) -> MeasuredResult:
    """Compute the lift of the cam's follower on the contours of a file.

    The lift on the first contour is written as a table if the request has an output file.
    """
    from cam_rig.profile import drawing_files
    from cam_rig.profile.contact import turn_angles
    from cam_rig.profile.disc import discs
    from cam_rig.profile.measure import rest_on_contour

    plates = discs(cam.follower, law)
    contours, curves = _read_curves(request, cam, len(plates))
    angle, rotation = turn_angles(READINGS), 0.0
    if request.align:
        curves, rotation = _align(request, plates[0].element, curves, law)
    names, measured = (cam.name, str(request.source)), []
    for disc, curve, points in zip(plates, curves, contours, strict=True):
        lift = rest_on_contour(disc.element, curve, angle + rotation)
        measured.append(
            MeasuredContour(*names, disc.name, points.shape[1], angle, lift, lift - law(angle))
        )
    if request.out is not None:
        with atomic_write(request.out) as part:
            drawing_files.write_law(part, angle, measured[0].lift)
        say(f"law: {request.out}")
    return MeasuredResult(tuple(measured))
