"""A cam on paper: contour, follower's positions around it, curvature and pressure angle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from cam_rig.drawing.colours import DISCS, LIMIT, PITCH_CURVE, web
from cam_rig.drawing.outlines import MM, circle
from cam_rig.laws import Law
from cam_rig.plots.figures import CAM_ANGLE, empty, styled, turn_axis, write
from cam_rig.plots.follower_positions import pivots, positions
from cam_rig.profile import Contour, contours, turn_angles
from cam_rig.profile.checks.check import Check
from cam_rig.schema import CamConfig

#: First and second disc; the dash tells them apart without colour.
INK = tuple(map(web, DISCS))
DASH = ("-", (0, (5, 2)))
FOLLOWER, BOLD = "0.62", "black"
POINTS, POSITIONS = 3600, 24
#: About every so many degrees a position is named; up to so many positions, each is.
NAMED, EACH_NAMED = 60.0, 12
#: Fewest and most positions: fewer are no turn, more are black.
FEWEST, MOST = 3, 720
#: Radii of curvature beyond this many times the cam's size are off the diagram.
OFF = 2.5


def draw(
    cam: CamConfig, law: Law, checks: list[Check], path: Path, follower_positions: int = POSITIONS
) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    write(figure(cam, law, checks, follower_positions), path)


@styled
def figure(
    cam: CamConfig, law: Law, checks: list[Check], follower_positions: int = POSITIONS
) -> Figure:
    """The cam with its follower around it, radius of curvature and pressure angle over a turn.

    ``follower_positions`` of the follower are drawn, at equal steps of the cam angle, as the
    graphical method divides the turn (profile thesis, §2.2.1).
    """
    discs = contours(cam.follower, law, POINTS)
    out = empty(4.9)
    panels = out.subplot_mosaic(
        [["plan", "curvature"], ["plan", "pressure"]], width_ratios=[1.45, 1.0]
    )
    _plan(panels["plan"], cam, law, discs, follower_positions)
    _curvature(panels["curvature"], cam, discs)
    _pressure(panels["pressure"], discs, checks)
    kind = cam.follower.type.replace("_", " ")
    title = [f"{cam.title} (follower: {kind}, lift {law.lift * MM:.4g} mm)"]
    for check in (check for check in checks if not check.passed):
        where = "" if check.degrees is None else f" at {check.degrees:.4g}°"
        value = check.shown(check.value).replace("-", "−")
        title.append(f"not met: {check.title} {value}{where}")
    out.suptitle("\n".join(title))
    return out


def _plan(axes: Axes, cam: CamConfig, law: Law, discs: tuple[Contour, ...], count: int) -> None:
    """The graphical method's picture: the follower goes round the standing cam."""
    for contour, colour, dash in zip(discs, INK, DASH, strict=False):
        _follower(axes, contour, law, count)
        name = f"contour, {contour.disc.name} cam" if contour.disc.name else "contour"
        outline = _closed(contour.points)
        axes.fill(*outline, color=colour, alpha=0.10, lw=0.0)
        axes.plot(*outline, color=colour, ls=dash, lw=2.0, label=name)
        if contour.pitch is not None and contour.disc.element.roller > 0.0:
            label = "pitch curve" if contour is discs[0] else None
            pitch = _closed(contour.pitch)
            axes.plot(*pitch, color=web(PITCH_CURVE), ls=(0, (7, 2, 1, 2)), lw=1.1, label=label)
    base = circle(cam.follower.base_radius.si * MM)
    axes.plot(*base.T, color="0.25", ls=":", label="base circle")
    axes.plot(0.0, 0.0, "+", color="k", ms=9)
    axes.margins(0.09)  # for the names of the angles
    axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    each = 360.0 / count
    axes.set_title(f"follower every {each:.4g}°, black at 0°; the cam turns ↺")
    _name_angles(axes, discs[0], law, count)
    axes.legend(loc="upper left", framealpha=0.9)


def _follower(axes: Axes, contour: Contour, law: Law, count: int) -> None:
    element, opposite = contour.disc.element, contour.disc.opposite
    around = positions(element, law, turn_angles(count))
    rest = [strip for strips in around[1:] for strip in strips]
    axes.add_collection(LineCollection(rest, colors=FOLLOWER, linewidths=0.6))
    first = list(around[0])
    if opposite is not None:
        first += positions(opposite, law, np.zeros(1))[0]
    axes.add_collection(LineCollection(first, colors=BOLD, linewidths=1.6, zorder=3))
    places = pivots(element, count)
    if places is not None:
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
    for degrees, strips in zip(
        angle, positions(contour.disc.element, law, np.radians(angle)), strict=True
    ):
        end = strips[-1][-1]
        place = end * (1.0 + 5.0 / np.hypot(*np.abs(end).clip(60.0)))
        axes.annotate(f"{degrees:.3g}°", place, ha="center", va="center", color="0.3")


def _curvature(axes: Axes, cam: CamConfig, discs: tuple[Contour, ...]) -> None:
    size = max(float(np.hypot(*contour.points).max()) for contour in discs) * MM
    for contour, colour, dash in zip(discs, INK, DASH, strict=False):
        radius = contour.radius * MM
        shown = np.where(np.abs(radius) < OFF * size, radius, np.nan)
        label = f"{contour.disc.name} cam" if contour.disc.name else None
        axes.plot(np.degrees(contour.angle), shown, color=colour, ls=dash, label=label)
    asked = cam.follower.least_curvature_radius
    least, roller = 0.0 if asked is None else asked.si * MM, cam.follower.roller * MM
    hollow = discs[0].pitch is not None  # a face cannot follow one, however wide
    axes.axhspan(-roller if hollow else -size, least, color=web(LIMIT), alpha=0.25, lw=0.0)
    axes.axhline(least, color=web(LIMIT), label="undercut, or below the least radius")
    axes.set(ylabel="radius of curvature ρ [mm]")
    flat = any(np.isfinite(c.radius[np.abs(c.radius) * MM >= OFF * size]).any() for c in discs)
    beyond = f"\nbeyond {OFF * size:.3g} mm not drawn" if flat else ""
    axes.set_title(f"positive where convex{beyond}")
    turn_axis(axes)
    values = np.concatenate([line.get_ydata() for line in axes.lines])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    axes.set_ylim(min(low, -roller, 0.0) - 0.08 * high, high * (1.32 + 0.18 * (len(discs) - 1)))
    axes.legend(loc="upper right")


def _pressure(axes: Axes, discs: tuple[Contour, ...], checks: list[Check]) -> None:
    for contour, colour, dash in zip(discs, INK, DASH, strict=False):
        degrees = np.degrees(contour.pressure)
        axes.plot(np.degrees(contour.angle), degrees, color=colour, ls=dash)
    limits = [np.degrees(check.limit) for check in checks if check.name == "pressure angle"]
    for limit in limits[:1]:
        axes.axhline(limit, color=web(LIMIT), ls="--", label=f"limit, ±{limit:.4g}°")
        axes.axhline(-limit, color=web(LIMIT), ls="--")
    axes.set(ylabel="pressure angle α [°]", xlabel=CAM_ANGLE)
    turn_axis(axes)
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.03 * (high - low), high + 0.14 * (high - low))
    axes.legend(loc="upper right")


def _closed(points: np.ndarray) -> np.ndarray:
    return np.append(points, points[:, :1], axis=1) * MM
