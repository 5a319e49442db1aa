"""Figures of a cam: contour, positions of the follower, curvature, and pressure angle."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from cam_rig.arguments import check_arguments
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

# The follower around a stationary cam, as in the graphical method (profile thesis §2.2.1).

#: Length by which a drawn face extends beyond the contact on each side, as a fraction of the
#: largest distance of the contour from the axis.
FACE_MARGIN = 0.08
#: Length of a drawn stem, as a fraction of the largest distance of the contour from the axis.
STEM_LENGTH = 0.22
#: Height of the elbow of a drawn L-shaped follower arm above the follower's point, as a fraction of
#: the arm's length.
ELBOW_HEIGHT = 0.25


def reach_of(element: Element, law: Law) -> float:
    """Return the largest distance of the contact from the cam's axis, m."""
    return float(np.abs(element.touch(Motion.uniform(law, 720)).contact).max())


def positions(element: Element, law: Law, angle: FloatArray) -> list[list[FloatArray]]:
    """Return the drawn follower at each cam angle (rad) in the frame of the cam.

    For each angle there is a list of polylines in mm, each of shape ``(n, 2)``.
    """
    strips = _outline(element, law, Motion.at(law, angle))
    turn = np.exp(-1j * angle)[:, None]
    turned = [strip * turn * MM for strip in strips]
    return [[plane(strip[i]).T for strip in turned] for i in range(angle.size)]


def _outline(element: Element, law: Law, motion: Motion) -> list[ComplexArray]:
    """Return the drawn follower as polylines in the frame of its guide, m.

    Each polyline has the shape ``(angles, points)``, complex x + iy. ``element`` is the roller,
    point or face of the follower, and ``motion`` its motion.
    """
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
        elbow = stand + 1j * ELBOW_HEIGHT * (pivot - stand)  # an L-shaped arm clears the cam
        return [np.hstack([stand, elbow, pivot])]
    assert isinstance(element, Guided)
    return [stand + rim, _stem(element, law, stand)]


def _stem(element: Guided, law: Law, stand: ComplexArray) -> ComplexArray:
    """Return the stem of a follower in a guide as a polyline for each cam angle, m.

    ``stand`` is the position of the follower, complex x + iy.
    """
    out = 1j * element.side * (element.roller + STEM_LENGTH * reach_of(element, law))
    return np.hstack([stand, stand + out])


def _face(element: GuidedFace, law: Law, motion: Motion) -> ComplexArray:
    """Return the part of a face that the cam touches, as a line for each cam angle, m.

    It is extended to the foot of the stem. ``element`` is the face, and ``motion`` the motion of
    the follower.
    """
    turn_motion = Motion.uniform(law, 720)
    along = element.side * np.exp(1j * element.inclination)
    contact_offset = (
        (element.touch(turn_motion).contact - element.stand(turn_motion.s)) / along
    ).real
    low, high = min(0.0, float(contact_offset.min())), max(0.0, float(contact_offset.max()))
    margin = FACE_MARGIN * reach_of(element, law)
    ends = along * np.array([low - margin, high + margin])
    return np.asarray(element.stand(motion.s)[:, None] + ends)


def _swung_face(element: SwungFace, law: Law, motion: Motion) -> list[ComplexArray]:
    """Return a face on a swinging arm, and its connection to the pivot, as lines, m.

    ``element`` is the face, and ``motion`` the motion of the follower.
    """
    turn_contact = element.touch(Motion.uniform(law, 720))
    longest = float(np.abs(turn_contact.contact - element.pivot).max()) + FACE_MARGIN * reach_of(
        element, law
    )
    along = np.exp(-1j * element.arm_angle(motion.s))[:, None]
    foot = element.pivot + 1j * element.offset * along
    pivot = np.full_like(foot, element.pivot)
    return [np.hstack([foot, foot - longest * along]), np.hstack([pivot, foot])]


#: Colours of the first and the second disc of conjugate cams.
COLOURS = tuple(map(web, DISCS))
#: Line styles of the first and the second disc, which distinguish them without colour.
DASHES = ("-", (0, (5, 2)))
#: Fill patterns of the first and the second disc.
HATCHES = ("", "///")
#: Grey level of the follower's positions except the first (0 black, 1 white).
FOLLOWER_COLOUR = "0.62"
#: Colour of the follower's position at cam angle 0.
FIRST_COLOUR = "black"
#: Number of points of a contour in the figure, one per 0.1° of the cam angle.
CONTOUR_POINTS = 3600
#: Distance between labelled positions of the follower if not all are labelled, degrees.
LABEL_STEP_DEG = 60.0
#: Largest number of positions of the follower that are all labelled with their cam angle.
MAX_ALL_LABELLED = 12
#: Distance from the follower's end to the middle of its label, pt.
LABEL_OFFSET_PT = 11.0
#: Smallest number of positions of the follower. Two positions would not show a turn.
MIN_POSITIONS = 3
#: Largest number of positions of the follower. More positions would cover the figure.
MAX_POSITIONS = 720
#: Largest radius of curvature that is drawn, as a multiple of the largest distance of the contour
#: from the axis.
MAX_RADIUS_RATIO = 2.5
#: Height of the line that marks straight parts of the contour, as a fraction of the panel's height.
FLAT_LINE_HEIGHT = 0.66
#: Largest |s'| at which a cam angle counts as part of a dwell, as a fraction of the largest |s'| of
#: the law.
DWELL_SLOPE_RATIO = 1e-6
#: Smallest width of a rise, dwell or fall that is shaded in a panel, degrees.
MIN_SHADED_DEG = 5.0
#: Smallest width of a rise, dwell or fall that is labelled in a panel, degrees.
MIN_LABELLED_DEG = 48.0


@styled
def figure(
    cam: CamConfig, law: Law, checks: list[Check], follower_positions: int = POSITIONS
) -> Figure:
    """Return the figure of a cam with its follower, curvature and pressure angle.

    ``follower_positions`` is the number of positions of the follower around the cam.
    """
    discs = contours(cam.follower, law, CONTOUR_POINTS)
    page = empty(5.2)
    panels = page.subplot_mosaic(
        [["plan", "curvature"], ["plan", "pressure"]], width_ratios=[1.45, 1.0]
    )
    _plan(panels["plan"], cam, law, discs, follower_positions)
    _curvature(panels["curvature"], cam, law, discs)
    _pressure(panels["pressure"], law, discs, checks)
    names = panels["plan"].get_legend_handles_labels()
    page.legend(*names, loc="outside lower center", ncols=3, frameon=False)
    kind = cam.follower.type.replace("_", " ")
    title = [f"{cam.title} (follower: {kind}, lift {law.lift * MM:.4g} mm)"]
    for check in (check for check in checks if not check.passed):
        position = "" if check.degrees is None else f" at {check.degrees:.4g}°"
        value = check.format_value(check.value).replace("-", "−")
        title.append(f"not met: {check.title} {value}{position}")
    page.suptitle(wrapped("\n".join(title)))
    return page


def profile_figure(result: ProfileResult) -> Figure:
    """Return the figure of a check of contours that contains a single cam."""
    (checked,) = result.cams
    return figure(checked.cam, checked.law, checked.checks, result.positions)


@check_arguments
def contour_figure(contour: CamContour, positions: int = POSITIONS) -> Figure:
    """Return the figure of a contour, with 3 to 720 positions of the follower."""
    if not MIN_POSITIONS <= positions <= MAX_POSITIONS:
        raise ConfigError(
            f"positions must be between {MIN_POSITIONS} and {MAX_POSITIONS}, got {positions}"
        )
    return figure(contour.cam, contour.law, contour.checks, positions)


def _plan(axes: Axes, cam: CamConfig, law: Law, discs: tuple[Contour, ...], count: int) -> None:
    """Draw the contour with the follower at several positions around the fixed cam.

    This is the graphical method (profile thesis §2.2.1). ``count`` is the number of positions.
    """
    for contour, colour, dash, hatch in zip(discs, COLOURS, DASHES, HATCHES, strict=False):
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
    axes.margins(0.13)  # for the labels of the angles
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    axes.set_title("the cam turns ↺")
    axes.plot([], [], color=FIRST_COLOUR, lw=1.6, label="follower at 0°")
    axes.plot([], [], color=FOLLOWER_COLOUR, lw=0.6, label=f"follower every {360.0 / count:.4g}°")
    _name_angles(axes, discs[0], law, count)


def _follower(axes: Axes, contour: Contour, law: Law, count: int) -> None:
    """Draw the positions of the follower around the cam, the first in bold.

    ``count`` is their number.
    """
    element, opposite = contour.disc.element, contour.disc.opposite
    around = positions(element, law, turn_angles(count))
    others = [strip for strips in around[1:] for strip in strips]
    axes.add_collection(LineCollection(others, colors=FOLLOWER_COLOUR, linewidths=0.6))
    first = list(around[0])
    if opposite is not None:
        first += positions(opposite, law, np.zeros(1))[0]
    axes.add_collection(LineCollection(first, colors=FIRST_COLOUR, linewidths=1.6, zorder=3))
    if isinstance(element, Swung):  # the pivot goes around the cam
        pivots = plane(element.pivot * MM * np.exp(-1j * turn_angles(count))).T
        axes.plot(*pivots[1:].T, "o", color=FOLLOWER_COLOUR, ms=2.5)
        axes.plot(*pivots[0], "o", color=FIRST_COLOUR, ms=5)
        ring = circle(float(np.hypot(*pivots[0])))
        name = "path of the pivot about the cam"
        label = None if name in axes.get_legend_handles_labels()[1] else name
        axes.plot(*ring.T, color=FOLLOWER_COLOUR, ls=":", lw=0.8, label=label)


def _name_angles(axes: Axes, contour: Contour, law: Law, count: int) -> None:
    """Label the drawn positions of the follower with their cam angle.

    The labels are at the outer ends of the follower. Up to `MAX_ALL_LABELLED` positions are all
    labelled. Of a larger number, about one every `LABEL_STEP_DEG` is labelled.
    """
    step = 360.0 / count
    label_step = max(1, round(LABEL_STEP_DEG / step)) if count > MAX_ALL_LABELLED else 1
    angle = np.degrees(turn_angles(count))[::label_step]
    angle = angle[angle < 360.0 - 0.5 * label_step * step]  # no label on the position at 0°
    around = positions(contour.disc.element, law, np.radians(angle))
    style: dict[str, Any] = {"ha": "center", "va": "center", "color": "0.3"}
    for degrees, strips in zip(angle, around, strict=True):
        end = strips[-1][-1]
        beyond = LABEL_OFFSET_PT * end / np.hypot(*end)
        axes.annotate(f"{degrees:.3g}°", end, beyond, textcoords="offset points", **style)


def _curvature(axes: Axes, cam: CamConfig, law: Law, discs: tuple[Contour, ...]) -> None:
    """Draw the radius of curvature over the turn with its limit.

    The smallest convex radius of each disc is marked. Large radii are not drawn.
    """
    size = max(float(np.hypot(*contour.points).max()) for contour in discs) * MM
    max_radius = MAX_RADIUS_RATIO * size
    for contour, colour, dash in zip(discs, COLOURS, DASHES, strict=False):
        radius = contour.radius * MM
        drawn = np.where(np.abs(radius) < max_radius, radius, np.nan)
        name = f"{contour.disc.name}: " if contour.disc.name else ""
        degrees = np.degrees(contour.angle)
        sharpest = sharpest_convex(Scan(law, contour.disc.element))
        smallest = typeset_number(sharpest.value * MM, ".4g")
        number = f"$ρ_{{min}}$ = {smallest} mm at {_degrees(sharpest):.4g}°"
        axes.plot(degrees, drawn, color=colour, ls=dash, label=f"{name}{number}")
        axes.plot(_degrees(sharpest), sharpest.value * MM, "o", color=colour, clip_on=False)
        _flats(axes, degrees, np.isinf(radius), colour)
    required = cam.follower.least_curvature_radius
    least, roller = 0.0 if required is None else required.si * MM, cam.follower.roller * MM
    hollow = discs[0].pitch is not None  # a face cannot follow a concave part of any radius
    axes.axhspan(-roller if hollow else -size, least, color=web(LIMIT), alpha=0.25, lw=0.0)
    axes.axhline(least, color=web(LIMIT), label="limit: undercut, least radius")
    axes.set(ylabel="radius of curvature ρ [mm]")
    is_cut = any(np.isfinite(c.radius[np.abs(c.radius) * MM >= max_radius]).any() for c in discs)
    beyond = f"\nbeyond {max_radius:.3g} mm not drawn" if is_cut else ""
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
    """Draw the pressure angle over the turn, with its limit and its largest value.

    ``discs`` are the contours of the cam, and ``checks`` contain the limit.
    """
    for contour, colour, dash in zip(discs, COLOURS, DASHES, strict=False):
        degrees = np.degrees(contour.pressure)
        steepest = Scan(law, contour.disc.element).greatest(lambda touch: np.abs(touch.pressure))
        label = f"$|α|_{{max}}$ = {np.degrees(steepest.value):.4g}° at {_degrees(steepest):.4g}°"
        axes.plot(np.degrees(contour.angle), degrees, color=colour, ls=dash, label=label)
        value = np.interp(_degrees(steepest), np.degrees(contour.angle), degrees)
        axes.plot(_degrees(steepest), value, "o", color=colour)
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
    """Shade rises and dwells in a panel over the cam angle.

    They are distinguished by the sign of s'. If ``named`` is True, rise, dwell and fall are
    labelled.
    """
    angle = turn_angles(CONTOUR_POINTS)
    slope, steepest = law(angle, 1), max(float(np.abs(e.value)) for e in extremes(law, 1))
    least = DWELL_SLOPE_RATIO * steepest
    stages = (slope > least, "0.85", "rise"), (abs(slope) <= least, "0.95", "dwell")
    for mask, shade, name in (*stages, (slope < -least, None, "fall")):
        for start, stop in _runs(mask):
            first, last = start * 360.0 / CONTOUR_POINTS, stop * 360.0 / CONTOUR_POINTS
            if shade and last - first >= MIN_SHADED_DEG:
                axes.axvspan(first, last, color=shade, lw=0.0, zorder=0)
            if named and last - first >= MIN_LABELLED_DEG:
                _note(axes, 0.5 * (first + last), 0.02, name, "bottom")


def _flats(axes: Axes, degrees: np.ndarray, flat: np.ndarray, colour: str) -> None:
    """Mark straight parts of the contour with a line in the curvature panel.

    ``flat`` is the mask of the cam angles ``degrees`` at which the contour is straight.
    """
    for start, stop in _runs(flat):
        ends = degrees[[start, stop - 1]]
        foot = axes.get_xaxis_transform()
        axes.plot(ends, [FLAT_LINE_HEIGHT, FLAT_LINE_HEIGHT], color=colour, lw=2.0, transform=foot)
        _note(axes, float(ends.mean()), FLAT_LINE_HEIGHT - 0.02, "flat:\nρ = ∞", "top")


def _note(axes: Axes, x: float, height: float, text: str, side: str) -> None:
    """Write a centred text at a cam angle ``x`` in degrees.

    ``height`` is a fraction of the panel's height, ``side`` the vertical alignment.
    """
    axes.text(
        x, height, text, ha="center", va=side, color="0.3", transform=axes.get_xaxis_transform()
    )


def _runs(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return start and end index of each sequence of True values in a mask.

    The end is exclusive.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _degrees(extreme: Extreme) -> float:
    return float(np.degrees(extreme.angle)) % 360.0


def _closed(points: np.ndarray) -> np.ndarray:
    return np.append(points, points[:, :1], axis=1) * MM
