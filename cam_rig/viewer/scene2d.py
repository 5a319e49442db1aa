"""Moving picture of cam and follower in the plane, in mm, with y up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from cam_rig.profile import contours, shapes
from cam_rig.profile.contact import Motion
from cam_rig.profile.outlines import FollowerShape, follower_shape
from cam_rig.profile.shapes import NUMBER_RADIUS
from cam_rig.show import looks
from cam_rig.show.looks import MM
from cam_rig.simulation.scene import LoadedScene, max_contact_force
from cam_rig.simulation.schedule import CamState
from cam_rig.units import TURN, FloatArray, to_rpm
from cam_rig.viewer.timeline import Canvas, FramePace

# Scale of cam and follower: each cam fills its view, whatever its size.

#: Radius of the ring of degrees around a cam, relative to the cam's largest radius.
RING = 1.04
#: Radius of the circle that encloses the numbers on the ring of degrees, as a multiple of the
#: radius at which the numbers are placed.
AROUND = 1.09
#: Height of the space below the ring for a line of text and the bar of a force, relative to the
#: ring's radius.
TEXT_SPACE = 0.36
#: Height of the space for a follower in flight above the largest lift of the law, relative to that
#: lift.
FLIGHT = 0.3
#: Smallest height of the space for a follower in flight, relative to the follower's largest
#: distance from the cam axis.
FLIGHT_OF_REACH = 0.05
#: Height of the free space at the lower edge of the view, relative to the height of the view.
MARGIN = 0.03
#: Width of the free space at each side of the view, relative to the height of the view.
SIDE = 0.01
#: Number of follower positions between lowest and largest lift at which the program checks which
#: numbers on the ring of degrees the follower covers.
LIFTS = 13
#: Distance from the follower below which a number on the ring of degrees is left out, relative to
#: the radius of the ring.
CLEARANCE = 0.14
#: Length of the arrow of the largest force, relative to the height of the picture.
ARROW = 0.22


@dataclass(frozen=True)
class Framing:
    """Frame of the picture of a cam with its follower, in mm.

    `shape` is the geometry of the follower. `ring` is the radius of the ring of degrees around the
    cam. `low` and `high` are opposite corners of the frame, shape (2,).
    """

    shape: FollowerShape
    ring: float
    low: FloatArray
    high: FloatArray

    @property
    def max_lift(self) -> float:
        """Lift (m) at which a follower in flight reaches the edge of the picture."""
        shape = self.shape
        return shape.max_lift + max(FLIGHT * shape.max_lift, FLIGHT_OF_REACH * shape.reach)

    @property
    def height(self) -> float:
        """Height of the frame around a picture of cam and follower, mm."""
        return float(self.high[1] - self.low[1])

    def numbers(self) -> tuple[FloatArray, list[str]]:
        """Return positions (mm) and texts of the visible numbers on the ring of degrees.

        The positions have the shape (n, 2). Numbers that the follower covers at some lift are left
        out.
        """
        positions, numbers = shapes.ring_numbers(self.ring)
        covered = np.zeros(len(numbers), dtype=bool)
        for lift in np.linspace(0.0, self.shape.max_lift, LIFTS)[:, None]:
            tilt, origin = float(self.shape.turn(lift)[0]), self.shape.origin(lift)[0] * MM
            for strip in self.follower():
                distance = shapes.distances(positions, shapes.rotate(strip, tilt) + origin)
                covered |= distance < CLEARANCE * self.ring
        visible = [number for number, hidden in zip(numbers, covered, strict=True) if not hidden]
        return positions[~covered], visible

    def follower(self) -> list[FloatArray]:
        """Return the outline of the follower as polylines ``(n, 2)`` in mm.

        The stem is drawn up to a point above its bearing.
        """
        return [strip * MM for strip in self.shape.in_guide()]


def framings(loaded: LoadedScene) -> dict[str, Framing]:
    """Return the frame of the picture of each cam of a scene, by name."""
    return {name: _framing(loaded, name) for name in loaded.cams}


def force_scale(loaded: LoadedScene, speed: float) -> float:
    """Return the largest contact force (N) of all cams at a speed (rad/s)."""
    return max(max_contact_force(loaded, cam, speed) for cam in loaded.cams)


def bounds(by_cam: dict[str, Framing]) -> tuple[list[float], list[float]]:
    """Return the limits of x and y (mm, y down) of a view into which every cam fits.

    Each cam is scaled to the height of the highest cam, as in the picture.
    """
    highest = max(framing.height for framing in by_cam.values())
    corners = [
        np.stack([framing.low, framing.high]) * highest / framing.height
        for framing in by_cam.values()
    ]
    side = max(float(np.abs(corner[:, 0]).max()) for corner in corners)
    low, high = min(float(c[0, 1]) for c in corners), max(float(c[1, 1]) for c in corners)
    side += SIDE * highest
    return [-side, side], [-high, -low + MARGIN * highest]


def _framing(loaded: LoadedScene, name: str) -> Framing:
    cam, law = loaded.cams[name], loaded.laws[name]
    shape = follower_shape(cam, law)
    ring = RING * float(np.hypot(*contours(cam.follower, law, 360)[0].points).max()) * MM
    draft = Framing(shape, ring, np.zeros(2), np.zeros(2))
    points = [np.array([[-1.0, -1.0], [1.0, 1.0]]) * NUMBER_RADIUS * AROUND * ring]
    points += [strip * MM for strip in shape.support()]
    for lift in (np.zeros(1), np.array([draft.max_lift])):
        tilt, origin = float(shape.turn(lift)[0]), shape.origin(lift)[0] * MM
        points += [shapes.rotate(strip, tilt) + origin for strip in draft.follower()]
    all_points = np.concatenate(points)
    low = all_points.min(axis=0) - np.array([0.0, TEXT_SPACE * ring])
    return Framing(shape, ring, low, all_points.max(axis=0))


# Readings under the picture of cam and follower.


def readings(
    angle: FloatArray,
    rpm: float,
    lift: FloatArray,
    force: FloatArray,
    gap: FloatArray,
    pressure_angle: FloatArray,
    max_lift: float = math.inf,
) -> list[str]:
    """Return the displayed readings of n pictures as Markdown.

    Parameters
    ----------
    angle : ndarray
        Cam angle in rad, shape (n,).
    rpm : float
        Cam speed in rpm.
    lift, gap : ndarray
        Lift and gap in m, shape (n,). A gap of 0 is contact.
    force : ndarray
        Contact force in N, shape (n,).
    pressure_angle : ndarray
        Pressure angle in rad, shape (n,).
    max_lift : float
        Lift in m at which a follower above it is drawn (default: no limit).
    """
    turned = np.degrees(np.mod(angle, TURN))
    columns = turned, lift * 1e3, force, gap * 1e6, np.degrees(pressure_angle)
    return [_reading(rpm, 1e3 * max_lift, *row) for row in np.stack(columns, axis=1).tolist()]


def _reading(
    rpm: float,
    edge: float,
    theta: float,
    lift: float,
    force: float,
    gap: float,
    pressure_angle: float,
) -> str:
    in_flight = gap != 0.0
    left = f"{theta:.1f}°", f"{lift:.3f} mm", f"{force:.1f} N"
    state = f"gap {looks.four_digits(gap)} µm" if in_flight else "in contact"
    contact_text = "not touched" if in_flight else f"pressure angle {pressure_angle:.1f}°"
    if lift > edge:
        contact_text = f"drawn at {edge:.0f} mm"
    return _lines(left, (f"{rpm:.4g} rpm", state, contact_text))


def _lines(left: tuple[str, str, str], right: tuple[str, str, str]) -> str:
    names = "θ", "lift", "force"
    lines = [f"{a:<8}{b:<12}{c}".rstrip() for a, b, c in zip(names, left, right, strict=True)]
    return "\n".join(["```", *lines, "```"])


#: Entity path of the picture. Cam and follower are in a child entity, because a Rerun view ignores
#: the transform of the entity at its path.
VIEW = "scene"
#: Number of pictures per turn, chosen for smooth slow motion at every speed.
FRAMES_PER_TURN = 72
#: Radius of a line. A negative radius is in points of the screen in Rerun, instead of mm.
LINE = -1.5
#: Radius of a thin line, in points of the screen (negative for Rerun).
THIN = -0.7
#: Radius of a thick line, in points of the screen (negative for Rerun).
THICK = -2.5
#: Radius of the point that marks the shaft, in points of the screen (negative for Rerun).
SHAFT = -3.0
#: Radius of an invisible point to which a label is attached, in points of the screen (negative for
#: Rerun).
UNSEEN = -0.1


def frame_mask(angle: FloatArray, step: float) -> NDArray[np.bool_]:
    """Return a mask of the samples at which a picture is drawn, shape (n,).

    A turn has `FRAMES_PER_TURN` pictures. Each is drawn at the first sample of its part of the
    turn. `angle` is the unwrapped cam angle and `step` its increment per sample, both in rad.
    """
    frame = np.floor(np.append(angle[:1] - step, angle) * (FRAMES_PER_TURN / (2.0 * np.pi)))
    return np.asarray(np.diff(frame) > 0.0)


class Scene2D:
    """Moving picture of the mounted cam and its follower.

    All cams are drawn at the height of the largest.

    Parameters
    ----------
    canvas : Canvas
        Recording to draw into.
    loaded : LoadedScene
        Scene of the run.
    view : str
        Entity path of the view.
    pace : FramePace, optional
        Rate of the frames of a live run. None sends all frames.
    scale : float, optional
        Force in N of the longest arrow (default: the greatest in contact at each speed).
    cursor : callable, optional
        Function called with the time columns and the cam angles (rad) of the sent frames.
    """

    def __init__(
        self,
        canvas: Canvas,
        loaded: LoadedScene,
        view: str = VIEW,
        pace: FramePace | None = None,
        scale: float | None = None,
        cursor: Callable[[list[rr.TimeColumn], FloatArray], None] | None = None,
    ) -> None:
        self._canvas, self._loaded, self._pace = canvas, loaded, pace
        self._view, self._root, self._cursor = view, f"{view}/rig", cursor
        self._framings = framings(loaded)
        self._highest = max(framing.height for framing in self._framings.values())
        self._scale = scale
        self._waiting = list[FloatArray]()
        shaft = rr.Points2D([[0.0, 0.0]], colors=looks.GREY, radii=SHAFT)
        canvas.log_static(f"{self._root}/shaft", shaft)
        # The body is drawn behind all other entities.
        canvas.set_style(f"{self._root}/cam/body", rr.LineStrips2D, draw_order=19.0)
        canvas.set_style(f"{self._root}/gap", rr.LineStrips2D, colors=looks.GAP, radii=THICK)
        canvas.set_style(f"{self._root}/force", rr.Arrows2D, colors=looks.FORCE, radii=THICK)

    def mount(self, state: CamState, profile: FloatArray) -> None:
        """Replace the drawn cam at a cam state.

        ``profile`` is its contour in the cam's frame, m, shape (n, 2).
        """
        self.flush()
        framing, self._law = self._framing_of(state.cam), self._loaded.laws[state.cam]
        self._shape, self._max_lift = framing.shape, framing.max_lift
        zoom = self._highest / framing.height
        # In a plane of Rerun y points down, so y is mirrored. Rerun scales line widths by the third
        # root of the determinant, so the third axis is scaled too.
        flip = rr.Transform3D.columns(mat3x3=np.diag([zoom, -zoom, zoom])[None])
        self._canvas.rows(self._root, self._canvas.times_of(state), flip)
        outline = shapes.close_outline(profile) * MM
        base = self._loaded.cams[state.cam].follower.base_radius.si
        colour, mark = looks.of_cam(state.cam), np.stack([np.zeros(2), outline[0]])
        filled, half = shapes.body(outline)
        self._strips(state, "cam/body", filled, looks.tint(colour), half)
        self._strips(state, "cam/circle", [shapes.circle(base * MM)], looks.GREY, THIN)
        self._strips(state, "cam/contour", [outline], colour, LINE)
        self._strips(state, "cam/mark", [mark], colour, LINE)
        support = [strip * MM for strip in self._shape.support()]
        self._strips(state, "guide", support, looks.GREY, THIN)
        self._strips(state, "follower/outline", framing.follower(), looks.FOLLOWER, LINE)
        self._strips(state, "ring", shapes.ring(framing.ring), looks.GREY, THIN)
        self._strips(state, "rotation", shapes.rotation_arrow(0.4 * base * MM), looks.GREY, LINE)
        self._texts(state, "numbers", *framing.numbers(), looks.GREY)

    def _framing_of(self, cam: str) -> Framing:
        """Return the frame of a cam's picture.

        The frames are recomputed if the cam was added to the scene after this object was created.
        """
        if cam not in self._framings:
            self._framings |= framings(self._loaded)
        return self._framings[cam]

    def speed(self, state: CamState, title: str = "") -> None:
        """Draw the title and speed of the cam, and a bar with the scale of the force.

        The title and the speed are below the cam. All of them appear from a cam state on.
        """
        self.flush()
        self._rpm, framing = to_rpm(state.speed), self._framing_of(state.cam)
        longest = self._scale or max_contact_force(self._loaded, state.cam, state.speed)
        self._arrow = ARROW * framing.height / longest  # mm/N
        bar_foot, offset = framing.low + 0.015 * framing.height, np.array([0.09, 0.085])
        force = 10.0 ** math.floor(math.log10(longest))
        bar = bar_foot + np.array([[0.0, 0.0], [0.0, force * self._arrow]])
        self._strips(state, "bar", [bar], looks.FORCE, THICK)
        bar_label = (bar_foot + offset * framing.height)[None]
        self._texts(state, "bar/words", bar_label, [f"{force:g} N"], looks.FORCE)
        label_position = np.array([[0.0, framing.low[1] + 0.045 * framing.height]])
        title_text = f"{title}{self._rpm:.4g} rpm"
        self._texts(state, "label", label_position, [title_text], looks.of_cam(state.cam))
        if self._pace is not None:  # remove the last cam's frame until the first frame arrives
            times = self._canvas.times_of(state)
            self._canvas.strips(f"{self._root}/gap", times, [])
            no_force = rr.Arrows2D.columns(origins=[], vectors=[]).partition([0])
            self._canvas.rows(f"{self._root}/force", times, no_force)
            self._send_readings(times, [_lines(("", "", ""), (f"{self._rpm:.4g} rpm", "", ""))])

    def frames(
        self, time: FloatArray, angle: FloatArray, lift: FloatArray, force: FloatArray
    ) -> None:
        """Add pictures of cam and follower at rig times (s), ``(n,)``.

        ``angle`` is the unwrapped cam angle (rad), ``lift`` the follower's lift (m) and ``force``
        the contact force (N). Contact is lost if the force is zero. Then the gap is drawn as a line
        from the point of the cam that contact would touch to the matching point of the follower. A
        follower outside the view is drawn at its edge, and the readings report this.
        """
        self._waiting.append(np.stack([time, angle, lift, force]))

    def flush(self, until: float = math.inf) -> None:
        """Send the added pictures up to a rig time (s).

        Later pictures are kept.
        """
        if not self._waiting:
            return
        frames = np.concatenate(self._waiting, axis=1)
        due = frames[0] <= until
        self._waiting = [] if due.all() else [frames[:, ~due]]
        if not due.any():
            return
        frames = frames[:, due]
        if self._pace is not None:
            frames = frames[:, self._pace.chosen(frames.shape[1])]
        self._send(*frames)

    def _send(
        self, time: FloatArray, angle: FloatArray, lift: FloatArray, force: FloatArray
    ) -> None:
        """Send the poses, the gaps, the readings and the forces of n pictures.

        The parameters are those of `frames`.
        """
        times, shape = self._canvas.times(time, angle), self._shape
        motion = Motion.at(self._law, angle)
        drawn = np.minimum(lift, self._max_lift)
        origin = np.column_stack([shape.origin(drawn) * MM, np.zeros_like(angle)])
        self._canvas.rows(f"{self._root}/cam", times, _pose(angle, None))
        self._canvas.rows(f"{self._root}/follower", times, _pose(shape.turn(drawn), origin))
        point, normal = shape.contact(motion)
        in_flight = force == 0.0
        ends = np.stack([point, shape.carried(point, motion.s, drawn)], axis=1) * MM
        gaps = rr.LineStrips2D.columns(strips=list(ends[in_flight])).partition(
            in_flight.astype(int)
        )
        self._canvas.rows(f"{self._root}/gap", times, gaps)
        along = np.sum(normal * shape.upward(motion.s), axis=1)
        gap = np.where(in_flight, lift - motion.s, 0.0)
        pressure_angle = np.arccos(along.clip(-1.0, 1.0))
        # A live run is displayed at its newest time, so only the last readings are sent.
        sent = slice(None) if self._pace is None else slice(-1, None)
        reading_times, reading_angles = self._canvas.times(time[sent], angle[sent]), angle[sent]
        values = lift[sent], force[sent], gap[sent], pressure_angle[sent]
        self._send_readings(
            reading_times, readings(reading_angles, self._rpm, *values, self._max_lift)
        )
        if self._cursor is not None:
            self._cursor(reading_times, reading_angles)
        arrows = normal * (force / along * self._arrow)[:, None]
        columns = rr.Arrows2D.columns(origins=point[~in_flight] * MM, vectors=arrows[~in_flight])
        columns = columns.partition((~in_flight).astype(int))
        self._canvas.rows(f"{self._root}/force", times, columns)

    def _send_readings(self, times: list[rr.TimeColumn], texts: list[str]) -> None:
        columns = rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
        self._canvas.rows(f"{self._view}_readings", times, columns)

    def _strips(
        self, state: CamState, entity: str, strips: list[FloatArray], colour: int, radius: float
    ) -> None:
        times = self._canvas.times_of(state)
        self._canvas.strips(f"{self._root}/{entity}", times, strips, colors=colour, radii=radius)

    def _texts(
        self, state: CamState, entity: str, positions: FloatArray, texts: list[str], colour: int
    ) -> None:
        """Draw texts that appear from a cam state on.

        `positions` are the upper middles of the texts in mm, shape (n, 2).
        """
        style: dict[str, Any] = {"colors": colour, "radii": UNSEEN, "show_labels": True}
        columns: dict[str, Any] = {name: [value] * len(texts) for name, value in style.items()}
        times = self._canvas.times_of(state)
        self._canvas.points(f"{self._root}/{entity}", times, positions, labels=texts, **columns)


def _pose(angle: FloatArray, position: FloatArray | None) -> rr.ComponentColumnList:
    """Return Rerun poses that rotate by `angle` about z, then move to `position`.

    `angle` is in rad, shape (n,), and `position` in mm, shape (n, 3).
    """
    zero, half = np.zeros_like(angle), 0.5 * angle
    quaternion = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
    if position is None:
        return rr.Transform3D.columns(quaternion=quaternion)
    return rr.Transform3D.columns(quaternion=quaternion, translation=position)
