"""What a roller does on a cam that was cut for a point: lift, jump speed, noise.

A contour drawn in polar coordinates as R_b + s (`PolarPlot[s + R_b]`, fig. 12 of the paper) is that
of a point follower (profile thesis, eq. 2.19 with R_r = 0 and ε = 0). A roller of radius R_r on it
touches beside its guide: its centre follows not s but the curve at R_r outside of the contour.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from typing import ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.two_masses import FROM_REST, find_jump_speed
from cam_rig.errors import ConfigError, ProfileError
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import Pieces, joined, turned_to_zero
from cam_rig.laws.cam import CamSet
from cam_rig.laws.law import Extreme, extremes
from cam_rig.laws.sampling import fit
from cam_rig.profile.checks import sharpest_concave
from cam_rig.profile.contact import Scan, greatest_between
from cam_rig.profile.faces import GuidedCentre
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.cam import Roller
from cam_rig.show.result import NULL_PROGRESS, Column, Progress, Records, Result
from cam_rig.show.tables import format_number
from cam_rig.simulation.asked import Cams, Rig, Scene, asked_cams, asked_scene
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import RPM, TURN, FloatArray

#: Steps of Newton's method, with bisection as its guard; the guard alone would take 53.
STEPS, CONVERGED = 60, 2e-15
#: Degree of the fitted third derivative, and its accepted relative tail: s'' is then known to
#: 1e-12 of its size. Pieces come out short, and a high degree there would lose digits of the force.
THIRD_DEGREE, TAIL = 10, 1e-10
#: Points a piece at which the fitted law is held against the closed form.
COMPARED = 33


@dataclass(frozen=True, eq=False)
class _CutPiece:
    """One piece of the law that was cut, and the roller's centre while it touches there.

    φ is the polar angle of the contour, ρ = R_b + s(φ) its radius, θ the cam angle: the polar
    angle of the roller's centre, at the distance d. ``ordinates`` ``(4, p + 1)`` are of ρ to its
    third derivative, m/rad^order.
    """

    start: float
    span: float
    ordinates: FloatArray
    roller: float

    def rows(self, polar: FloatArray) -> FloatArray:
        """``(4, n)``: ρ and its derivatives at polar angles φ, rad."""
        u = np.clip((polar - self.start) / self.span, 0.0, 1.0)
        return np.asarray(self.ordinates @ bernstein.basis(self.ordinates.shape[1] - 1, u).T)

    def cam_angle(self, polar: FloatArray) -> FloatArray:
        """θ (rad) at which the roller touches at φ."""
        rho, slope = self.rows(polar)[:2]
        share = self.roller / np.hypot(rho, slope)
        return np.asarray(polar - np.arctan2(share * slope, rho * (1.0 + share)))

    def polar(self, angle: FloatArray) -> FloatArray:
        """φ (rad) at which the roller touches at θ; θ grows with φ where the roller fits."""
        low = np.full(angle.shape, self.start)
        high = low + self.span
        at = np.clip(angle, low, high)
        for _ in range(STEPS):
            over = self.cam_angle(at) - angle
            low, high = np.where(over <= 0.0, at, low), np.where(over >= 0.0, at, high)
            newton = at - over / roller_centre(self.rows(at), self.roller)[1]
            guarded = np.where((newton >= low) & (newton <= high), newton, 0.5 * (low + high))
            moved, at = np.abs(guarded - at).max(), guarded
            if moved <= CONVERGED:
                break
        return at

    def distance(self, angle: FloatArray) -> FloatArray:
        """``(4, n)``: distance d of the roller's centre (m), and three derivatives, at θ (rad)."""
        return roller_centre(self.rows(self.polar(angle)), self.roller)[0]


def roller_centre(rows: FloatArray, roller: float) -> tuple[FloatArray, FloatArray]:
    """The centre of a roller that touches a polar contour, and its derivatives in the cam angle.

    Of ``rows`` ``(4, n)``, ρ and its first three derivatives in φ, m/rad^order, and a radius in m
    come ``(4, n)`` d and its first three derivatives in θ, m/rad^order, and ``(n,)`` dθ/dφ.

    With q² = ρ² + ρ'², t = d'/d the tangent of the pressure angle and κ_p = κ/(1 + R_r κ) the
    curvature of the pitch curve: t = ρρ'/(ρ² + R_r q), d'' = d (1 + 2t²) − κ_p d² (1 + t²)^(3/2).
    """
    rho, slope, bend, third = rows
    q = np.hypot(rho, slope)
    turned = rho**2 + 2.0 * slope**2 - rho * bend
    curvature = turned / q**3
    along = 2.0 * rho * slope + 3.0 * slope * bend - rho * third
    curving = along / q**3 - 3.0 * turned * slope * (rho + bend) / q**5
    grown = 1.0 + roller * curvature
    d = np.sqrt(rho**2 + 2.0 * roller * rho**2 / q + roller**2)
    rate = grown * (rho**2 + roller * q) / d**2
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
    return np.stack([d, d1, d2, d3]), rate


def followed_law(law: Law, base_radius: float, roller: float) -> tuple[Law, FloatArray]:
    """The law of a roller's centre on the contour R_b + s(φ) that was cut for a point; radii in m.

    It is fitted to rounding (`cam_rig.laws.sampling`), with the largest error ``(3,)`` in s (m),
    s' (m/rad) and s'' (m/rad²), at `COMPARED` points of each piece. Its lift is that of s, as the
    two curves are parallel; a dwell stays one.
    """
    _require_room(law, base_radius, roller)
    breaks: list[float] = []
    columns: list[FloatArray] = []
    errors = [np.zeros(3)]
    ordinates = np.stack([law.derivative_ordinates(order) for order in range(4)])
    ordinates[0] += base_radius
    for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
        piece = _CutPiece(float(start), float(span), ordinates[:, :, i], roller)
        (edges, fitted), error = _fit(piece, base_radius + roller)
        errors.append(error)
        breaks += edges if not breaks else edges[1:]
        columns += fitted
    breaks[-1] = breaks[0] + TURN
    edges, columns = turned_to_zero((breaks, columns), TURN)
    edges[-1] = TURN
    return Law(law.name, np.array(edges), joined(columns)), np.max(errors, axis=0)


def _fit(piece: _CutPiece, prime: float) -> tuple[Pieces, FloatArray]:
    """Pieces of the roller's lift over θ, and their largest errors ``(3,)``; a dwell exactly."""
    ends = piece.cam_angle(piece.start + np.array([0.0, piece.span])).tolist()
    if not piece.ordinates[1].any():
        height = piece.ordinates[0, 0] + piece.roller - prime
        return (ends, [np.array([height])]), np.zeros(3)

    def lift(angle: FloatArray, order: int) -> FloatArray:
        return np.asarray(piece.distance(angle)[order] - (prime if order == 0 else 0.0))

    breaks, columns = fit(lift, ends[0], ends[1], THIRD_DEGREE, TAIL)
    u = np.linspace(0.0, 1.0, COMPARED)
    error = np.zeros(3)
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        exact = piece.distance(start + (stop - start) * u)
        exact[0] -= prime
        ordinates = column
        for order in range(3):
            off = np.abs(bernstein.evaluate(ordinates, u) - exact[order]).max()
            error[order] = max(error[order], float(off))
            ordinates = bernstein.derivative(ordinates) / (stop - start)
    return (breaks, columns), error


def _require_room(law: Law, base_radius: float, roller: float) -> None:
    if not (base_radius > 0.0 and roller >= 0.0):
        raise ProfileError(
            f"base radius is {base_radius * 1e3:g} mm, roller radius {roller * 1e3:g} mm; allowed: "
            "a base radius above 0, and a roller radius of 0 (a point) or more"
        )
    if law.velocity_jumps:
        where = np.degrees(law.breaks[next(iter(law.velocity_jumps))])
        raise ProfileError(
            f"cam {law.name!r}: its contour has a corner at {where:.4g}°, where the velocity "
            "jumps; allowed: a law without such jumps, or a follower without a roller"
        )
    found = sharpest_concave(Scan(law, GuidedCentre.on_base(base_radius, 0.0, 0.0)))
    if found is not None and found.value <= roller:
        raise ProfileError(
            f"cam {law.name!r}: roller radius is {roller * 1e3:.6g} mm; allowed: less than the "
            f"contour's concave radius of curvature {found.value * 1e3:.6g} mm at "
            f"{np.degrees(found.angle):.4g}°; let the roller be smaller or the base circle larger"
        )


# What it does on a rig: the law as it was drawn, and as it was cut.


@dataclass(frozen=True, eq=False)
class CutBench:
    """Two masses for the jump speed; a scene's follower, sound and speeds (rad/s) for levels."""

    two_mass: TwoMassParameters
    follower: FollowerParameters
    acoustics: Acoustics
    speeds: FloatArray

    @classmethod
    def of(cls, rig: RigConfig, loaded: LoadedScene) -> CutBench:
        """The jump speed's rig, and a scene's follower, sound and speeds."""
        two_mass, speeds = TwoMassParameters.from_rig(rig), loaded.scene.program.speeds.si_list
        return cls(two_mass, loaded.follower, Acoustics(loaded.radiation), np.array(speeds))


@dataclass(frozen=True, eq=False)
class DrawnCam:
    """A law with its jump speed and levels (dB).

    ``lands_from_rpm``: slowest speed with a landing in each turn; None in contact throughout.
    """

    law: Law
    jump_rpm: float
    levels: FloatArray
    lands_from_rpm: float | None

    @property
    def least_s2(self) -> float:
        """Smallest s'' of the law, m/rad²."""
        return extremes(self.law, 2)[0].value

    @classmethod
    def run(cls, law: Law, bench: CutBench) -> DrawnCam:
        """Run a law."""
        turns = settled_turns(law, "one_mass", bench.follower, bench.speeds)
        lands = [v / RPM for v, i in zip(turns.speeds, turns.impulses, strict=True) if i.any()]
        jump = find_jump_speed(law, bench.two_mass, FROM_REST) / RPM
        return cls(law, jump, bench.acoustics.levels(turns), min(map(float, lands), default=None))


@dataclass(frozen=True, eq=False)
class AsCut:
    """A law, and the one that a roller follows on its contour R_b + s; radii in m.

    ``error`` ``(3,)`` is of the roller's law: m, m/rad, m/rad²; ``too_high`` (m) where it stands
    farthest above s.
    """

    cam: str
    drawn: DrawnCam
    cut: DrawnCam
    base_radius: float
    roller: float
    error: FloatArray
    too_high: Extreme

    @property
    def change(self) -> FloatArray:
        """By how much the cam becomes louder at each speed, dB."""
        return self.cut.levels - self.drawn.levels


@dataclass(frozen=True, eq=False, repr=False)
class AsCutResult(Result):
    """Cams on their contours as they were cut, or one over its radii; ``speeds`` in rad/s."""

    schema = "cam_rig.as_cut.1"
    plot_function = "cam_rig.paper.as_cut.figures:figure"
    columns: ClassVar = {
        "as_cut": (
            Column("cam"),
            Column("base_radius", "mm", "g"),
            Column("roller_radius", "mm", "g", of="roller"),
            Column("above_law", "mm", ".3f", "roller above s by", "too_high.value"),
            Column("above_law_at", "°", of="too_high.angle", hidden=True),
            Column("least_s2", "mm/rad²", ".2f", "smallest s″", "drawn.least_s2"),
            Column("least_s2_cut", "mm/rad²", ".2f", "of the roller", "cut.least_s2"),
            Column("jump", "rpm", ".2f", "jump speed of s", "drawn.jump_rpm"),
            Column("jump_cut", "rpm", ".2f", "as cut", "cut.jump_rpm"),
            Column("change_from", "dB", "+.3f", "level changes from", lambda r: r.change.min()),
            Column("change_to", "dB", "+.3f", "to", lambda row: row.change.max()),
            Column("lands_from", "rpm", ".0f", "s lands from", "drawn.lands_from_rpm", missing="–"),
            Column("lands_from_cut", "rpm", ".0f", "as cut", "cut.lands_from_rpm", missing="–"),
            *(Column(f"error_s{i}", of=f"error.{i}", hidden=True) for i in range(3)),
        ),
        "levels": (
            Column("cam", of="0.cam"),
            Column("base_radius", "mm", of="0.base_radius"),
            Column("roller_radius", "mm", of="0.roller"),
            Column("rpm", "rpm", of="1"),
            Column("change", "dB", of="2"),
        ),
    }

    rows: tuple[AsCut, ...]
    speeds: FloatArray
    titles: dict[str, str]
    caption: str = "A roller on the contour that a polar plot of s + R_b gives"

    def tables(self) -> list[Records]:
        """``as_cut``, a row a cam or a pair of radii, and by how much each becomes louder."""
        errors = max((float(row.error[0]) for row in self.rows), default=0.0)
        speeds = [speed / RPM for speed in self.speeds.tolist()]
        levels = (
            (row, *one)
            for row in self.rows
            for one in zip(speeds, row.change.tolist(), strict=True)
        )
        return [
            self.table(
                "as_cut",
                self.caption,
                self.rows,
                "Jump speeds are those of two masses, from rest; levels and landings those of the "
                "scene's own rig.",
                "The roller's law is fitted to its closed form within "
                f"{format_number(errors, '.0e')} m.",
            ),
            self.table("levels", "Change of the level", levels, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Of the first cam: how far off lift and noise are."""
        first = self.rows[0]
        change = max(map(abs, first.change))
        high = 1e3 * first.too_high.value
        return [f"{first.cam}: {high:.3f} mm too high, noise within {change:.3f} dB"]

    def of(self, cam: str) -> AsCut | None:
        """A cam's row, if it has one."""
        return next((row for row in self.rows if row.cam == cam), None)


def has_central_roller(cam: CamConfig) -> bool:
    """Whether the follower is a roller whose guide passes through the cam's axis."""
    follower = cam.follower
    return isinstance(follower, Roller) and (
        follower.eccentricity is None or follower.eccentricity.si == 0.0
    )


def radii(cam: CamConfig) -> tuple[float, float]:
    """Base and roller radius (m) of a cam with a central roller."""
    if not has_central_roller(cam):
        beside = " beside the cam's axis" if isinstance(cam.follower, Roller) else ""
        raise ConfigError(
            f"cam {cam.name!r}: its follower is {cam.follower.type!r}{beside}; allowed: a roller "
            "in a guide without eccentricity, as R_b + s is then what a point would need"
        )
    return cam.follower.base_radius.si, cam.follower.roller


def cut_at(cam: str, drawn: DrawnCam, bench: CutBench, base_radius: float, roller: float) -> AsCut:
    """Cut a cam as drawn for a point, and drive it with a roller."""
    law, error = followed_law(drawn.law, base_radius, roller)
    edges = np.unique(np.concatenate([drawn.law.breaks, law.breaks]))
    high = greatest_between(lambda angle: law(angle) - drawn.law(angle), edges)
    return AsCut(cam, drawn, DrawnCam.run(law, bench), base_radius, roller, error, high)


def cut_all(
    chosen: CamSet,
    bench: CutBench,
    base: float | None = None,
    roller: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> AsCutResult:
    """Each cam at its own radii, or at those (m) that are given."""
    own = {cam: radii(config) for cam, config in chosen.cams.items()}
    rows = []
    for cam in progress.track(own):
        sizes = [a if b is None else b for a, b in zip(own[cam], (base, roller), strict=True)]
        rows.append(cut_at(cam, DrawnCam.run(chosen.laws[cam], bench), bench, *sizes))
    return AsCutResult(tuple(rows), bench.speeds, chosen.titles)


@checked
def as_cut(
    cams: Cams = None,
    rig: Rig = None,
    scene: Scene = "tm21_sweep",
    *,
    base: float | None = None,
    roller: float | None = None,
    progress: Progress = NULL_PROGRESS,
) -> AsCutResult:
    """A roller on the contour that was drawn for a point, as fig. 12 of the paper draws it.

    Its lift, jump speed and noise beside those of the law itself.

    The command is ``cam-rig as-cut``.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; None: the paper's Table 2
    rig : of the jump speeds: a name, a path or a rig; None: the only one beside the cams, else
        ``paper_table2``
    scene : gives follower, sound and speeds of the noise
    base, roller : radii in m, instead of the cam's own
    progress : told how far it is

    Raises
    ------
    ConfigError : an unknown cam, rig or scene, or a radius that is none

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.as_cut("bezier15", base=0.08, roller=0.02)
    >>> found.to_pandas().cam.tolist()
    ['bezier15']
    """
    for name, radius in (("base", base), ("roller", roller)):
        if radius is not None and not radius > 0.0:
            raise ConfigError(f"{name}: is {radius * 1e3:g} mm; allowed: greater than 0 mm")
    chosen = asked_cams(cams, rig)
    bench = CutBench.of(chosen.rig, asked_scene(scene))
    return cut_all(chosen, bench, base, roller, progress)


def over_sizes(
    found: AsCut, bench: CutBench, bases: Iterable[float], rollers: Iterable[float], title: str
) -> AsCutResult:
    """A cam over base and roller radii (m), the rollers of one base circle together."""
    sizes = product(bases, rollers)
    rows = tuple(cut_at(found.cam, found.drawn, bench, *size) for size in sizes)
    caption = f"{title} as cut, over base and roller radius"
    return AsCutResult(rows, bench.speeds, {found.cam: title}, caption)


#: The law that the paper cut a cam for (fig. 12), and radii (m) that it is cut with here.
CUT, BASES, ROLLERS = "bezier15", (0.050, 0.065, 0.100), (0.005, 0.010, 0.020)
