"""The files of ``cam-rig profile``: what is asked for, and contours and paths written."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.cli.common.console import console
from cam_rig.cli.common.outputs import check_outputs, writing
from cam_rig.errors import ConfigError

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.profile.curves.path import ContourPath
    from cam_rig.schema import CamConfig

DRAWINGS, TABLES = (".dxf", ".svg"), (".csv",)
READABLE = (".dxf", ".csv")
#: Share of the tolerance that the digits of an SVG may take; a DXF has them all.
SVG_ROUNDING = 0.1
#: A finer tolerance would ask for millions of points, µm.
FINEST_UM = 1e-4


@dataclass(frozen=True)
class Request:
    """What is to be written or read; radius in mm, tolerance in µm."""

    out: Path | None
    pitch: bool
    cutter: float | None
    tolerance: float
    points: int
    source: Path | None

    def require(self, cams: int, drawing: bool) -> None:
        """Refuse, before anything is computed, what does not go together.

        Raises
        ------
        ConfigError : several cams for one file, an unknown kind of file, no file at all, a radius
            or a tolerance that is none
        OutputError : no file can be written there
        """
        files = self.out is not None or self.source is not None or drawing
        if files and cams != 1:
            raise ConfigError(f"{cams} cams for one file; allowed: one cam with --out or --plot")
        if (self.pitch or self.cutter is not None) and self.out is None:
            raise ConfigError("--pitch and --cutter need --out FILE: they say what is written")
        if self.pitch and self.cutter is not None:
            raise ConfigError("--pitch and --cutter are two paths; allowed: one of them")
        if self.cutter is not None and not 0.0 < self.cutter < 1e5:
            raise ConfigError(f"--cutter is {self.cutter:g} mm; allowed: more than 0 mm")
        if not self.tolerance >= FINEST_UM:
            raise ConfigError(
                f"--tolerance is {self.tolerance:g} µm; allowed: at least {FINEST_UM:g} µm"
            )
        if self.source is not None:
            if drawing or self.pitch or self.cutter is not None:
                raise ConfigError("--from measures; allowed with it: --out FILE.csv for the law")
            _suffix(self.source, READABLE)
        if self.out is not None:
            _suffix(self.out, TABLES if self.source is not None else (*DRAWINGS, *TABLES))
            check_outputs(str(self.out), None)


def _suffix(path: Path, allowed: tuple[str, ...]) -> None:
    if path.suffix.lower() not in allowed:
        hint = ""
        if path.suffix.lower() in (".step", ".stp"):
            hint = " (no STEP: import the DXF into CAD and extrude it)"
        raise ConfigError(f"{path}: unknown kind of file; allowed: {', '.join(allowed)}{hint}")


def write(request: Request, cam: CamConfig, law: Law, force: bool) -> None:
    """Write the contour, the pitch curve or the cutter's path by the file's suffix."""
    from cam_rig.cad import contour_csv, dxf, svg
    from cam_rig.profile.curves.polyline import polyline

    assert request.out is not None
    curves, tolerance = _curves(request, cam, law, force), request.tolerance * 1e-6
    kind = request.out.suffix.lower()
    with writing(request.out) as part:
        if kind in TABLES:
            contour_csv.write_contour(part, curves, request.points)
            words = f"{request.points} points"
        else:
            rounding = SVG_ROUNDING * tolerance if kind == ".svg" else 0.0
            lines = {curve.name: polyline(curve, tolerance - rounding) for curve in curves}
            if kind == ".svg":
                svg.write_svg(part, lines, rounding)
            else:
                dxf.write_dxf(part, lines)
            counts = " and ".join(str(line.shape[1]) for line in lines.values())
            words = f"{counts} points, chord error at most {request.tolerance:g} µm"
    names = " and ".join(curve.name for curve in curves)
    console.print(f"{names}: {words}: {request.out}", markup=False, soft_wrap=True)


def _curves(request: Request, cam: CamConfig, law: Law, force: bool) -> list[ContourPath]:
    from cam_rig.profile.curves import path

    if request.pitch:
        return path.pitch_paths(cam.follower, law)
    if request.cutter is None:
        return path.contour_paths(cam.follower, law)
    curves = path.cutter_paths(cam.follower, law, request.cutter * 1e-3)
    if not force:
        for curve in curves:
            curve.require_room()
    return curves
