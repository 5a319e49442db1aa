"""A roller on the contour that fig. 12 of the paper draws for a point follower.

The paper plots R_b + s in polar coordinates (`PolarPlot[s + R_b]`), which is the contour for a
point follower (profile thesis, eq. 2.19 with R_r = 0 and ε = 0). A roller of radius R_r touches
this contour beside its guide. Its centre therefore follows the curve at distance R_r outside of the
contour, instead of s. Base radius and roller radius are assumed, because no source states them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from scipy.interpolate import BPoly

import cam_rig
from cam_rig.show.figure import CAM_ANGLE, empty, series, styled, turn_axis, wrapped
from cam_rig.simulation.simulate import Acoustics, simulate_steady_turns
from cam_rig.units import RPM, TURN, FloatArray
from examples.paper.common import CAMS, RIG, SCENE, Table, parser, publish, titles

#: Cam that the paper manufactured (fig. 12).
CUT = "bezier15"
#: Base radii for the comparison (m).
BASES = (0.050, 0.065, 0.100)
#: Roller radii for the comparison (m).
ROLLERS = (0.005, 0.010, 0.020)
#: Number of pieces of the roller's law per turn. With degree 7 the law is then exact to rounding.
PARTS = 360
#: Number of samples per turn for the largest difference, which is then exact to 1e-7.
SAMPLES = 20_001


def roller_centre(rows: FloatArray, roller: float) -> tuple[FloatArray, FloatArray]:
    """Return the centre of a roller on a polar contour, and its derivatives by θ.

    `rows` `(4, n)` are ρ and its first three derivatives by the polar angle φ, in m/radⁱ, and
    `roller` is the radius of the roller in m. The result is `(4, n)`, the distance d and its first
    three derivatives by the cam angle θ in m/radⁱ, and `(n,)`, φ − θ in rad.

    With q² = ρ² + ρ'², the tangent of the pressure angle t = d'/d, and the curvature of the pitch
    curve κ_p = κ/(1 + R_r κ): t = ρρ'/(ρ² + R_r q), d'' = d (1 + 2t²) − κ_p d² (1 + t²)^(3/2).
    """
    rho, slope, second, third = rows
    q = np.hypot(rho, slope)
    turned = rho**2 + 2.0 * slope**2 - rho * second
    curvature = turned / q**3
    along = 2.0 * rho * slope + 3.0 * slope * second - rho * third
    curving = along / q**3 - 3.0 * turned * slope * (rho + second) / q**5
    grown = 1.0 + roller * curvature
    d = np.sqrt(rho**2 + 2.0 * roller * rho**2 / q + roller**2)
    rate = grown * (rho**2 + roller * q) / d**2  # dθ/dφ
    t = rho * slope / (rho**2 + roller * q)
    pitch, pitch_along = curvature / grown, curving / (grown**2 * rate)
    root = np.sqrt(1.0 + t**2)
    d1 = d * t
    d2 = d * (1.0 + 2.0 * t**2) - pitch * d**2 * root**3
    turning = t * (d2 / d - t**2)  # t dt/dθ
    d3 = (
        d1 * (1.0 + 2.0 * t**2)
        + 4.0 * d * turning
        - d * root * (pitch_along * d * root**2 + 2.0 * pitch * d1 * root**2)
        - 3.0 * pitch * d**2 * root * turning
    )
    share = roller / q
    return np.stack([d, d1, d2, d3]), np.arctan2(share * slope, rho * (1.0 + share))


def followed_law(law: cam_rig.Law, base: float, roller: float) -> cam_rig.Law:
    """Return the law of a roller's centre on the contour base + s(φ).

    It is the contour of a point follower. Radii are in m. Hermite pieces of degree 7 have the lift
    and three derivatives of the centre at both ends.

    Raises ------
    ValueError
        If the contour is more concave than the roller.
    """
    columns: list[FloatArray] = []
    breaks = [0.0]
    for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
        count = max(1, math.ceil(span / TURN * PARTS))
        polar = start + span * np.linspace(0.0, 1.0, count + 1)
        piece = BPoly(law.ordinates[:, i : i + 1], [start, start + span])
        rows = np.stack([piece(polar, order) for order in range(4)])
        rows[0] += base
        centre, lead = roller_centre(rows, roller)
        angle = polar - lead
        if not (np.diff(angle) > 0.0).all():
            raise ValueError(f"{law.name}: the contour is hollower than the roller")
        centre[0] -= base + roller
        centre[np.abs(centre) < 1e-15] = 0.0  # rounding in the low dwell is removed
        hermite = BPoly.from_derivatives(angle, centre.T)
        columns += list(hermite.c.T)
        breaks += angle[1:].tolist()
    breaks[-1] = TURN
    return cam_rig.Law(law.name, np.array(breaks), np.stack(columns, axis=1))


@dataclass(frozen=True, eq=False)
class Driven:
    """Law with its jump speed (rpm) from rest, and its sound levels (dB) by speed.

    `lands_from` is the slowest speed (rpm) with a landing in each turn, or None.
    """

    law: cam_rig.Law
    jump: float
    levels: FloatArray
    lands_from: float | None


def drive(law: cam_rig.Law) -> Driven:
    """Compute the jump speed on the rig of table 2, and the levels on the scene's rig."""
    scene = cam_rig.load_scene(SCENE)
    speeds = scene.scene.schedule.speeds.si_list
    turns = simulate_steady_turns(law, "one_mass", scene.follower, speeds)
    landing = [v / RPM for v, impulse in zip(speeds, turns.impulses, strict=True) if impulse.any()]
    jump = cam_rig.jump_speed(law, cam_rig.load_rig(RIG)).rpm
    return Driven(law, jump, Acoustics(scene.radiation).levels(turns), min(landing, default=None))


@dataclass(frozen=True, eq=False)
class AsCut:
    """Law, and law of a roller on the contour that is drawn from it. Radii are in m."""

    cam: str
    drawn: Driven
    cut: Driven
    base: float
    roller: float

    @property
    def above(self) -> tuple[float, float]:
        """Largest height (m) of the roller above the law, and its cam angle (rad)."""
        angle = np.linspace(0.0, TURN, SAMPLES)
        height = self.cut.law(angle) - self.drawn.law(angle)
        return float(height.max()), float(angle[height.argmax()])

    @property
    def change(self) -> FloatArray:
        """Change of the sound level (dB) at each speed."""
        return self.cut.levels - self.drawn.levels


def cut_at(cam: str, drawn: Driven, base: float, roller: float) -> AsCut:
    """Compute a cam with the contour of a point follower and a roller. Radii are in m."""
    return AsCut(cam, drawn, drive(followed_law(drawn.law, base, roller)), base, roller)


def study(cams: Sequence[str] = CAMS) -> list[AsCut]:
    """Compute each cam with the radii of its file."""
    result = []
    for cam in map(cam_rig.load_cam, cams):
        base, roller = cam.follower.base_radius.si, cam.follower.roller
        result.append(cut_at(cam.name, drive(cam_rig.build_law(cam)), base, roller))
    return result


def over_sizes(result: AsCut) -> list[AsCut]:
    """Compute the same cam with all `BASES` and `ROLLERS`."""
    return [cut_at(result.cam, result.drawn, *size) for size in product(BASES, ROLLERS)]


def table(rows: Sequence[AsCut], caption: str) -> Table:
    """Return a table with a row per cam and pair of radii."""
    names = titles(dict.fromkeys(row.cam for row in rows))
    return Table(
        caption,
        "cam | base radius [mm] :g | roller radius [mm] :g | roller above s by [mm] :.3f | "
        "smallest s″ [mm/rad²] :.2f | of the roller [mm/rad²] :.2f | jump speed of s [rpm] :.2f | "
        "as cut [rpm] :.2f | level changes from [dB] :+.3f | to [dB] :+.3f | "
        "s lands from [rpm] | cut lands from [rpm]",
        [
            (
                names[row.cam],
                1e3 * row.base,
                1e3 * row.roller,
                1e3 * row.above[0],
                *(1e3 * _least_second(law_study.law) for law_study in (row.drawn, row.cut)),
                *(law_study.jump for law_study in (row.drawn, row.cut)),
                float(row.change.min()),
                float(row.change.max()),
                *(
                    "–" if law_study.lands_from is None else f"{law_study.lands_from:.0f}"
                    for law_study in (row.drawn, row.cut)
                ),
            )
            for row in rows
        ],
        "Jump speeds are those of two masses, from rest; levels and landings those of the scene's "
        "own rig.",
    )


def _least_second(law: cam_rig.Law) -> float:
    """Return the smallest s'' (m/rad²) of the samples of a turn."""
    return float(law(np.linspace(0.0, TURN, SAMPLES), 2).min())


@styled
def figure(result: AsCut) -> Figure:
    """Draw the polar plot of a cam, and lift and acceleration of the roller and of s."""
    angle = np.linspace(0.0, TURN, 1441)
    degrees, drawn, cut = np.degrees(angle), result.drawn.law, result.cut.law
    out = empty(4.0)
    grid = out.add_gridspec(2, 2, width_ratios=[1.15, 1.0])
    polar = out.add_subplot(grid[:, 0], projection="polar")
    assert isinstance(polar, PolarAxes)
    _contours(polar, result, angle)
    out.legend(*polar.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    lift = out.add_subplot(grid[0, 1])
    lift.plot(degrees, 1e3 * (cut(angle) - drawn(angle)), **series(0))
    lift.set(ylabel="roller above s [mm]", title="roller on s + $R_b$, less s")
    second: Axes = out.add_subplot(grid[1, 1], sharex=lift)
    for i, (law_study, name) in enumerate(
        ((result.drawn, "s"), (result.cut, "roller on s + $R_b$"))
    ):
        label = f"{name}: jump speed {law_study.jump:.1f} rpm"
        second.plot(degrees, 1e3 * law_study.law(angle, 2), label=label, **series(i))
    second.set(ylabel="s″ [mm/rad²]", xlabel=CAM_ANGLE)
    for axes in (lift, second):
        turn_axis(axes)
    second.set_ylim(top=1.7 * second.get_ylim()[1])
    second.legend(loc="upper center")
    radii = f"base radius {1e3 * result.base:g} mm, roller radius {1e3 * result.roller:g} mm"
    out.suptitle(wrapped(f"{titles([result.cam])[result.cam]}, {radii}"))
    return out


def _contours(axes: PolarAxes, result: AsCut, angle: FloatArray) -> None:
    """Draw the contour of fig. 12, and the contour that gives s with the roller (mm)."""
    drawn = 1e3 * (result.base + result.drawn.law(angle))
    axes.plot(angle, drawn, lw=2.0, label="s + $R_b$, as fig. 12", **series(0))
    axes.fill(angle, drawn, color=series(0)["color"], alpha=0.10, lw=0.0)
    centre = result.base + result.roller + result.drawn.law(angle)
    tilt = np.arctan2(result.drawn.law(angle, 1), centre)  # pressure angle
    inside = centre * np.exp(1j * angle) - result.roller * np.exp(1j * (angle - tilt))
    axes.plot(np.angle(inside), 1e3 * np.abs(inside), label="cut for the roller", **series(1))
    axes.plot(angle, 0.0 * angle + 1e3 * result.base, color="0.25", ls=":", label="base circle")
    axes.set(rmin=0.0, title="contour, radius in mm")
    axes.set_rlabel_position(68.0)


def summary(result: AsCut) -> str:
    """Return the errors of lift and noise, and the jump speeds, of a cam as text."""
    return (
        f"{result.cam}: {1e3 * result.above[0]:.3f} mm too high, noise within "
        f"{np.abs(result.change).max():.3f} dB, jump speed {result.cut.jump:.2f} instead of "
        f"{result.drawn.jump:.2f} rpm"
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, print its tables and write its figure."""
    out = parser(__doc__).parse_args(argv).out
    result = study()
    first = result[CAMS.index(CUT)]
    captions = "A roller on the contour that a polar plot of s + R_b gives", f"{CUT} over its radii"
    tables = [table(result, captions[0]), table(over_sizes(first), captions[1])]
    publish(out, tables, {"as_cut": figure(first)}, map(summary, result))


if __name__ == "__main__":
    main()
