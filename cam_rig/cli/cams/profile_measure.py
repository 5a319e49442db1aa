"""``cam-rig profile --from``: the cam's follower on the contours of a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cam_rig.arrays import rms
from cam_rig.cli.common.console import console
from cam_rig.cli.common.outputs import write_json, writing
from cam_rig.errors import OutputError

if TYPE_CHECKING:
    from cam_rig.arrays import FloatArray
    from cam_rig.cli.cams.profile_files import Request
    from cam_rig.laws import Law
    from cam_rig.schema import CamConfig

#: Cam angles at which a follower is read on the contour of a file.
READINGS = 720


@dataclass(frozen=True)
class Measured:
    """A law read from a contour: cam angles (rad), lifts and their error (m); which disc it is."""

    disc: str
    points: int
    angle: FloatArray
    lift: FloatArray
    error: FloatArray

    def figures(self) -> dict[str, float]:
        """Lift in mm, the largest error and the RMS of all in µm, where in degrees."""
        import numpy as np

        worst = int(np.argmax(np.abs(self.error)))
        return {
            "points": self.points,
            "lift_mm": float(np.ptp(self.lift)) * 1e3,
            "largest_error_um": float(self.error[worst]) * 1e6,
            "at_deg": float(np.degrees(self.angle[worst])),
            "rms_error_um": rms(self.error) * 1e6,
        }


def run(request: Request, cam: CamConfig, law: Law, json_target: str | None) -> None:
    """Measure the contours of a file, say what was found, write what is asked for."""
    found = measure(request, cam, law)
    show(request, cam, found)
    if json_target is not None:
        discs = [{"disc": one.disc, **one.figures()} for one in found]
        write_json({cam.name: {"from": str(request.source), "contours": discs}}, json_target)


def measure(request: Request, cam: CamConfig, law: Law) -> list[Measured]:
    """Put the cam's follower on the contours of a file, and compare with the cam's law."""
    from cam_rig.profile import turn_angles
    from cam_rig.profile.curves.measure import closed_curve, rest
    from cam_rig.profile.disc import discs

    assert request.source is not None
    contours = _read(request.source)
    for doubt in (doubt for points in contours for doubt in _doubts(request.source, points)):
        console.print(f"warning: {request.source}: {doubt}", markup=False, soft_wrap=True)
    plates = discs(cam.follower, law)
    if len(contours) != len(plates):
        raise OutputError(
            f"{request.source}: has {len(contours)} closed curves; allowed: {len(plates)}, one "
            f"for each contour of a {cam.follower.type} follower"
        )
    angle = turn_angles(READINGS)
    return [
        Measured(disc.name, points.shape[1], angle, lift, lift - law(angle))
        for disc, points in zip(plates, contours, strict=True)
        for lift in [rest(disc.element, closed_curve(points), angle)]
    ]


def show(request: Request, cam: CamConfig, found: list[Measured]) -> None:
    """Say how far the contours are from the law; write the first one's law if asked to."""
    from cam_rig.cad import contour_csv

    for one in found:
        figures = one.figures()
        name = f"{one.disc} cam: " if one.disc else ""
        console.print(
            f"{name}{one.points} points, lift {figures['lift_mm']:.6g} mm; from the law of "
            f"{cam.name}: {figures['largest_error_um']:+.3g} µm at {figures['at_deg']:g}°, "
            f"{figures['rms_error_um']:.3g} µm RMS",
            markup=False,
            soft_wrap=True,
        )
    if request.out is not None:
        with writing(request.out) as part:
            contour_csv.write_law(part, found[0].angle, found[0].lift)
        console.print(f"law: {request.out}", soft_wrap=True)


def _doubts(source: Path, points: FloatArray) -> list[str]:
    """What a contour should not be; the edges of a drawing are meant, of a table they are gaps."""
    from cam_rig.profile.curves.closed_contour import crossing, gap, sparse

    found = [crossing(points)]
    if source.suffix.lower() == ".csv":
        found += [gap(points), sparse(points)]
    return [doubt for doubt in found if doubt is not None]


def _read(source: Path) -> list[FloatArray]:
    from cam_rig.cad import contour_csv, dxf

    return (
        dxf.read_dxf(source)
        if source.suffix.lower() == ".dxf"
        else contour_csv.read_contour(source)
    )
