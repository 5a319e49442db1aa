"""A cam on paper: contour, follower's positions around it, curvature and pressure angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.law import Extreme, extremes
from cam_rig.profile.checks import Check, sharpest_convex
from cam_rig.profile.contact import Element, Motion, Scan, turn_angles
from cam_rig.profile.disc import Contour, contours, plane
from cam_rig.profile.faces import Guided, GuidedFace, Swung, SwungCentre, SwungFace
from cam_rig.profile.shapes import circle
from cam_rig.schema import CamConfig
from cam_rig.show.figure import CAM_ANGLE, empty, styled, turn_axis, wrapped
from cam_rig.show.looks import DISCS, LIMIT, MM, PITCH_CURVE, web
from cam_rig.show.tables import typeset_number
from cam_rig.studies.profile.contour import CamContour
from cam_rig.studies.profile.study import POSITIONS, ProfileResult
from cam_rig.units import ComplexArray, FloatArray

# The follower around a standing cam, as the graphical method draws it (profile thesis §2.2.1).

#: A face is drawn this much longer than the contact needs it, and a stem so long: of the reach.
SPARE, STEM = 0.08, 0.22
#: Height of an L-shaped arm over its point, of the arm.
SHANK = 0.25


def reach_of(element: Element, law: Law) -> float:
    """Largest distance of a contact from the cam's axis, m."""
    return float(np.abs(element.touch(Motion.uniform(law, 720)).contact).max())


def positions(element: Element, law: Law, angle: FloatArray) -> list[list[FloatArray]]:
    """For each cam angle (rad) the follower as strips, ``(n, 2)`` mm, in the cam's frame."""
    strips = _outline(element, law, Motion.at(law, angle))
    turn = np.exp(-1j * angle)[:, None]
    turned = [strip * turn * MM for strip in strips]
    return [[plane(strip[i]).T for strip in turned] for i in range(angle.size)]


def _outline(element: Element, law: Law, motion: Motion) -> list[ComplexArray]:
    """Strips ``(angles, points)`` in the guide's frame, m."""
    stand = element.stand(motion.s)[:, None]
    if isinstance(element, SwungFace):
        return _swung_face(element, law, motion)
    if isinstance(element, GuidedFace):
        return [_face(element, law, motion), _stem(element, law, stand)]
    rim = element.roller * circle(1.0).view(np.complex128)[:, 0]
    if isinstance(element, SwungCentre):
        pivot = np.full_like(stand, element.pivot)
        if element.roller > 0.0:
            return [stand + rim, np.hstack([stand, pivot])]
        elbow = stand + 1j * SHANK * (pivot - stand)  # L-shaped, to clear the cam
        return [np.hstack([stand, elbow, pivot])]
    assert isinstance(element, Guided)
    return [stand + rim, _stem(element, law, stand)]


def _stem(element: Guided, law: Law, stand: ComplexArray) -> ComplexArray:
    out = 1j * element.side * (element.roller + STEM * reach_of(element, law))
    return np.hstack([stand, stand + out])


def _face(element: GuidedFace, law: Law, motion: Motion) -> ComplexArray:
    """The part of the face that the contact passes over, and the foot of the stem."""
    every = Motion.uniform(law, 720)
    along = element.side * np.exp(1j * element.inclination)
    way = ((element.touch(every).contact - element.stand(every.s)) / along).real
    low, high = min(0.0, float(way.min())), max(0.0, float(way.max()))
    spare = SPARE * reach_of(element, law)
    ends = along * np.array([low - spare, high + spare])
    return np.asarray(element.stand(motion.s)[:, None] + ends)


def _swung_face(element: SwungFace, law: Law, motion: Motion) -> list[ComplexArray]:
    every = element.touch(Motion.uniform(law, 720))
    longest = float(np.abs(every.contact - element.pivot).max()) + SPARE * reach_of(element, law)
    along = np.exp(-1j * element.arm_angle(motion.s))[:, None]
    foot = element.pivot + 1j * element.offset * along
    pivot = np.full_like(foot, element.pivot)
    return [np.hstack([foot, foot - longest * along]), np.hstack([pivot, foot])]


#: First and second disc; the dash tells them apart without colour.
INK = tuple(map(web, DISCS))
DASH, HATCH = ("-", (0, (5, 2))), ("", "///")
FOLLOWER, BOLD = "0.62", "black"
POINTS = 3600
#: About every so many degrees a position is named; up to so many positions, each is.
NAMED, EACH_NAMED = 60.0, 12
#: Its middle is so far outside the follower's end, pt.
OUTSIDE_PT = 11.0
#: Fewest and most positions: fewer are no turn, more are black.
FEWEST, MOST = 3, 720
#: Radii of curvature beyond this many times the cam's size are off the diagram.
OFF = 2.5
#: Height of the line where the contour is straight, of the panel's.
FLAT = 0.66
#: Slope of a dwell, of the greatest slope; a stage narrower than these (°) has no shade, no name.
STILL, NARROW, NAMED_STAGE = 1e-6, 5.0, 48.0


@styled
def figure(
    cam: CamConfig, law: Law, checks: list[Check], follower_positions: int = POSITIONS
) -> Figure:
    """The cam with its follower around it, radius of curvature and pressure angle over a turn."""
    discs = contours(cam.follower, law, POINTS)
    out = empty(5.2)
    panels = out.subplot_mosaic(
        [["plan", "curvature"], ["plan", "pressure"]], width_ratios=[1.45, 1.0]
    )
    _plan(panels["plan"], cam, law, discs, follower_positions)
    _curvature(panels["curvature"], cam, law, discs)
    _pressure(panels["pressure"], law, discs, checks)
    names = panels["plan"].get_legend_handles_labels()
    out.legend(*names, loc="outside lower center", ncols=3, frameon=False)
    kind = cam.follower.type.replace("_", " ")
    title = [f"{cam.title} (follower: {kind}, lift {law.lift * MM:.4g} mm)"]
    for check in (check for check in checks if not check.passed):
        where = "" if check.degrees is None else f" at {check.degrees:.4g}°"
        value = check.shown(check.value).replace("-", "−")
        title.append(f"not met: {check.title} {value}{where}")
    out.suptitle(wrapped("\n".join(title)))
    return out


def profile_figure(found: ProfileResult) -> Figure:
    """Of the one cam that was asked for."""
    (one,) = found.cams
    return figure(one.cam, one.law, one.checks, found.positions)


def contour_figure(found: CamContour, positions: int = POSITIONS) -> Figure:
    """Of a contour, with 3 to 720 positions of the follower."""
    if not FEWEST <= positions <= MOST:
        raise ConfigError(f"positions: is {positions}; allowed: {FEWEST} to {MOST}")
    return figure(found.cam, found.law, found.checks, positions)


def _plan(axes: Axes, cam: CamConfig, law: Law, discs: tuple[Contour, ...], count: int) -> None:
    """The graphical method's picture: the follower goes round the standing cam."""
    for contour, colour, dash, hatch in zip(discs, INK, DASH, HATCH, strict=False):
        _follower(axes, contour, law, count)
        name = f"contour, {contour.disc.name} cam" if contour.disc.name else "contour"
        outline = _closed(contour.points)
        axes.fill(*outline, fc=to_rgba(colour, 0.10), ec=to_rgba(colour, 0.35), hatch=hatch, lw=0.0)
        axes.plot(*outline, color=colour, ls=dash, lw=2.0, label=name)
        if contour.pitch is not None and contour.disc.element.roller > 0.0:
            roller = f"pitch curve, $R_r$ = {contour.disc.element.roller * MM:.4g} mm"
            label = roller if contour is discs[0] else None
            pitch = _closed(contour.pitch)
            axes.plot(*pitch, color=web(PITCH_CURVE), ls=(0, (7, 2, 1, 2)), lw=1.1, label=label)
    radius = cam.follower.base_radius.si * MM
    base = circle(radius)
    axes.plot(*base.T, color="0.25", ls=":", label=f"base circle, $R_b$ = {radius:.4g} mm")
    axes.plot(0.0, 0.0, "+", color="k", ms=9)
    axes.margins(0.13)  # for the names of the angles
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    each = 360.0 / count
    axes.set_title("the cam turns ↺")
    axes.plot([], [], color=BOLD, lw=1.6, label="follower at 0°")
    axes.plot([], [], color=FOLLOWER, lw=0.6, label=f"follower every {each:.4g}°")
    _name_angles(axes, discs[0], law, count)


def _follower(axes: Axes, contour: Contour, law: Law, count: int) -> None:
    element, opposite = contour.disc.element, contour.disc.opposite
    around = positions(element, law, turn_angles(count))
    rest = [strip for strips in around[1:] for strip in strips]
    axes.add_collection(LineCollection(rest, colors=FOLLOWER, linewidths=0.6))
    first = list(around[0])
    if opposite is not None:
        first += positions(opposite, law, np.zeros(1))[0]
    axes.add_collection(LineCollection(first, colors=BOLD, linewidths=1.6, zorder=3))
    if isinstance(element, Swung):  # the pivot goes around the cam
        places = plane(element.pivot * MM * np.exp(-1j * turn_angles(count))).T
        axes.plot(*places[1:].T, "o", color=FOLLOWER, ms=2.5)
        axes.plot(*places[0], "o", color=BOLD, ms=5)
        ring = circle(float(np.hypot(*places[0])))
        name = "path of the pivot about the cam"
        label = None if name in axes.get_legend_handles_labels()[1] else name
        axes.plot(*ring.T, color=FOLLOWER, ls=":", lw=0.8, label=label)


def _name_angles(axes: Axes, contour: Contour, law: Law, count: int) -> None:
    """Cam angles at the outer ends of the follower's positions: of few at each, else at some."""
    step = 360.0 / count
    every = max(1, round(NAMED / step)) if count > EACH_NAMED else 1
    angle = np.degrees(turn_angles(count))[::every]
    angle = angle[angle < 360.0 - 0.5 * every * step]  # no name on that of 0°
    around = positions(contour.disc.element, law, np.radians(angle))
    style: dict[str, Any] = {"ha": "center", "va": "center", "color": "0.3"}
    for degrees, strips in zip(angle, around, strict=True):
        end = strips[-1][-1]
        beyond = OUTSIDE_PT * end / np.hypot(*end)
        axes.annotate(f"{degrees:.3g}°", end, beyond, textcoords="offset points", **style)


def _curvature(axes: Axes, cam: CamConfig, law: Law, discs: tuple[Contour, ...]) -> None:
    size = max(float(np.hypot(*contour.points).max()) for contour in discs) * MM
    for contour, colour, dash in zip(discs, INK, DASH, strict=False):
        radius = contour.radius * MM
        shown = np.where(np.abs(radius) < OFF * size, radius, np.nan)
        name = f"{contour.disc.name}: " if contour.disc.name else ""
        degrees = np.degrees(contour.angle)
        sharpest = sharpest_convex(Scan(law, contour.disc.element))
        smallest = typeset_number(sharpest.value * MM, ".4g")
        number = f"$ρ_{{min}}$ = {smallest} mm at {_degrees(sharpest):.4g}°"
        axes.plot(degrees, shown, color=colour, ls=dash, label=f"{name}{number}")
        axes.plot(_degrees(sharpest), sharpest.value * MM, "o", color=colour, clip_on=False)
        _flats(axes, degrees, np.isinf(radius), colour)
    asked = cam.follower.least_curvature_radius
    least, roller = 0.0 if asked is None else asked.si * MM, cam.follower.roller * MM
    hollow = discs[0].pitch is not None  # a face cannot follow one, however wide
    axes.axhspan(-roller if hollow else -size, least, color=web(LIMIT), alpha=0.25, lw=0.0)
    axes.axhline(least, color=web(LIMIT), label="limit: undercut, least radius")
    axes.set(ylabel="radius of curvature ρ [mm]")
    off = any(np.isfinite(c.radius[np.abs(c.radius) * MM >= OFF * size]).any() for c in discs)
    beyond = f"\nbeyond {OFF * size:.3g} mm not drawn" if off else ""
    axes.set_title(f"positive where convex{beyond}")
    turn_axis(axes)
    _stages(axes, law, named=False)
    values = np.concatenate(
        [line.get_ydata() for line in axes.lines if line.get_transform() == axes.transData]
    )
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    axes.set_ylim(min(low, -roller, 0.0) - 0.08 * high, high * (1.42 + 0.18 * (len(discs) - 1)))
    axes.legend(loc="upper right", handlelength=1.8)


def _pressure(axes: Axes, law: Law, discs: tuple[Contour, ...], checks: list[Check]) -> None:
    for contour, colour, dash in zip(discs, INK, DASH, strict=False):
        degrees = np.degrees(contour.pressure)
        steepest = Scan(law, contour.disc.element).greatest(lambda touch: np.abs(touch.pressure))
        most = f"$|α|_{{max}}$ = {np.degrees(steepest.value):.4g}° at {_degrees(steepest):.4g}°"
        axes.plot(np.degrees(contour.angle), degrees, color=colour, ls=dash, label=most)
        at = np.interp(_degrees(steepest), np.degrees(contour.angle), degrees)
        axes.plot(_degrees(steepest), at, "o", color=colour)
    limits = [np.degrees(check.limit) for check in checks if check.name == "pressure angle"]
    for limit in limits[:1]:
        axes.axhline(limit, color=web(LIMIT), ls="--", label=f"limit, ±{limit:.4g}°")
        axes.axhline(-limit, color=web(LIMIT), ls="--")
    axes.set(ylabel="pressure angle α [°]", xlabel=CAM_ANGLE)
    turn_axis(axes)
    _stages(axes, law, named=True)
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.16 * (high - low), high + (0.36 + 0.1 * len(discs)) * (high - low))
    axes.legend(loc="upper right", handlelength=1.8)


def _stages(axes: Axes, law: Law, named: bool) -> None:
    """Rise, dwell and fall by the sign of s', the first two shaded over the whole height."""
    angle = turn_angles(POINTS)
    slope, steepest = law(angle, 1), max(float(np.abs(e.value)) for e in extremes(law, 1))
    least = STILL * steepest
    stages = (slope > least, "0.85", "rise"), (abs(slope) <= least, "0.95", "dwell")
    for where, shade, name in (*stages, (slope < -least, None, "fall")):
        for start, stop in _runs(where):
            first, last = start * 360.0 / POINTS, stop * 360.0 / POINTS
            if shade and last - first >= NARROW:
                axes.axvspan(first, last, color=shade, lw=0.0, zorder=0)
            if named and last - first >= NAMED_STAGE:
                _note(axes, 0.5 * (first + last), 0.02, name, "bottom")


def _flats(axes: Axes, degrees: np.ndarray, flat: np.ndarray, colour: str) -> None:
    """Where the contour is straight: a line along the top in place of a hole in the curve."""
    for start, stop in _runs(flat):
        ends = degrees[[start, stop - 1]]
        foot = axes.get_xaxis_transform()
        axes.plot(ends, [FLAT, FLAT], color=colour, lw=2.0, transform=foot)
        _note(axes, float(ends.mean()), FLAT - 0.02, "flat:\nρ = ∞", "top")


def _note(axes: Axes, at: float, height: float, words: str, side: str) -> None:
    axes.text(
        at, height, words, ha="center", va=side, color="0.3", transform=axes.get_xaxis_transform()
    )


def _runs(where: np.ndarray) -> list[tuple[int, int]]:
    """First and one past the last index of each run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _degrees(extreme: Extreme) -> float:
    return float(np.degrees(extreme.angle)) % 360.0


def _closed(points: np.ndarray) -> np.ndarray:
    return np.append(points, points[:, :1], axis=1) * MM
