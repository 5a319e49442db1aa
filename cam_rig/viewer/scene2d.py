"""The cam turning under its follower, in the plane, mm, y up."""

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
from cam_rig.profile.shapes import NUMBER
from cam_rig.show import looks
from cam_rig.show.looks import MM
from cam_rig.simulation.scene import LoadedScene, max_contact_force
from cam_rig.simulation.schedule import CamState
from cam_rig.units import TURN, FloatArray, to_rpm
from cam_rig.viewer.timeline import Canvas, FramePace

# How large cam and follower are drawn: each fills its view, whatever its size.

#: The ring of degrees around a cam, over the cam's greatest radius; what its numbers need.
RING, AROUND = 1.04, 1.09
#: Room below the ring for a line of words and the bar of a force, over its radius.
WORDS = 0.36
#: Room for a follower in flight above the law's greatest lift: a share of that, and of the
#: follower's reach, where that is more.
FLIGHT, FLIGHT_OF_REACH = 0.3, 0.05
#: Room at the lower edge and at either side of the view, over its height.
MARGIN, SIDE = 0.03, 0.01
#: Lifts at which the follower is looked at for what it covers, and its distance from a number
#: that it leaves free, over the ring's radius.
PLACES, CLEAR = 13, 0.14
#: The arrow of the greatest force, as a share of the picture's height.
ARROW = 0.22


@dataclass(frozen=True)
class Framing:
    """A cam with its follower in its view, mm: radius of the ring of degrees, ``(2,)`` corners."""

    shape: FollowerShape
    ring: float
    low: FloatArray
    high: FloatArray

    @property
    def max_lift(self) -> float:
        """The lift (m) at which a follower in flight has reached the edge of its view."""
        shape = self.shape
        return shape.max_lift + max(FLIGHT * shape.max_lift, FLIGHT_OF_REACH * shape.reach)

    @property
    def height(self) -> float:
        """Of all that is drawn."""
        return float(self.high[1] - self.low[1])

    def numbers(self) -> tuple[FloatArray, list[str]]:
        """``(n, 2)`` places of the ring's numbers, and the numbers that no follower runs over."""
        places, numbers = shapes.ring_numbers(self.ring)
        covered = np.zeros(len(numbers), dtype=bool)
        for lift in np.linspace(0.0, self.shape.max_lift, PLACES)[:, None]:
            tilt, origin = float(self.shape.turn(lift)[0]), self.shape.origin(lift)[0] * MM
            for strip in self.follower():
                away = shapes.distances(places, shapes.turned(strip, tilt) + origin)
                covered |= away < CLEAR * self.ring
        free = [one for one, hidden in zip(numbers, covered, strict=True) if not hidden]
        return places[~covered], free

    def follower(self) -> list[FloatArray]:
        """Strips of the follower, whose stem ends over its bearing."""
        return [strip * MM for strip in self.shape.in_guide()]


def framings(loaded: LoadedScene) -> dict[str, Framing]:
    """The framing of each cam of a scene."""
    return {name: _framing(loaded, name) for name in loaded.cams}


def force_scale(loaded: LoadedScene, speed: float) -> float:
    """The force (N) of the longest arrow: over all cams in contact at a speed (rad/s)."""
    return max(max_contact_force(loaded, cam, speed) for cam in loaded.cams)


def bounds(framed: dict[str, Framing]) -> tuple[list[float], list[float]]:
    """Range of x and y (mm, y down) of a view in which every cam is as high as the highest."""
    highest = max(one.height for one in framed.values())
    corners = [np.stack([one.low, one.high]) * highest / one.height for one in framed.values()]
    side = max(float(np.abs(two[:, 0]).max()) for two in corners)
    low, high = min(float(c[0, 1]) for c in corners), max(float(c[1, 1]) for c in corners)
    side += SIDE * highest
    return [-side, side], [-high, -low + MARGIN * highest]


def _framing(loaded: LoadedScene, name: str) -> Framing:
    cam, law = loaded.cams[name], loaded.laws[name]
    shape = follower_shape(cam, law)
    ring = RING * float(np.hypot(*contours(cam.follower, law, 360)[0].points).max()) * MM
    draft = Framing(shape, ring, np.zeros(2), np.zeros(2))
    points = [np.array([[-1.0, -1.0], [1.0, 1.0]]) * NUMBER * AROUND * ring]
    points += [strip * MM for strip in shape.support()]
    for lift in (np.zeros(1), np.array([draft.max_lift])):
        tilt, place = float(shape.turn(lift)[0]), shape.origin(lift)[0] * MM
        points += [shapes.turned(strip, tilt) + place for strip in draft.follower()]
    every = np.concatenate(points)
    low = every.min(axis=0) - np.array([0.0, WORDS * ring])
    return Framing(shape, ring, low, every.max(axis=0))


# Numbers under the picture of cam and follower, as an instrument shows them.


def readings(
    angle: FloatArray,
    rpm: float,
    lift: FloatArray,
    force: FloatArray,
    gap: FloatArray,
    pressure_angle: FloatArray,
    max_lift: float = math.inf,
) -> list[str]:
    """Markdown of each of n frames: rad, m and N ``(n,)``; a gap of 0 is contact.

    ``max_lift`` (m) is that of the picture: a follower above it is drawn there.
    """
    turned = np.degrees(np.mod(angle, TURN))
    columns = turned, lift * 1e3, force, gap * 1e6, np.degrees(pressure_angle)
    return [_words(rpm, 1e3 * max_lift, *row) for row in np.stack(columns, axis=1).tolist()]


def _words(
    rpm: float, edge: float, theta: float, lift: float, force: float, gap: float, lean: float
) -> str:
    off = gap != 0.0
    left = f"{theta:.1f}°", f"{lift:.3f} mm", f"{force:.1f} N"
    state = f"gap {looks.four_digits(gap)} µm" if off else "in contact"
    angle = "not touched" if off else f"pressure angle {lean:.1f}°"
    if lift > edge:
        angle = f"drawn at {edge:.0f} mm"
    return _lines(left, (f"{rpm:.4g} rpm", state, angle))


def _lines(left: tuple[str, str, str], right: tuple[str, str, str]) -> str:
    names = "θ", "lift", "force"
    lines = [f"{a:<8}{b:<12}{c}".rstrip() for a, b, c in zip(names, left, right, strict=True)]
    return "\n".join(["```", *lines, "```"])


#: What the view shows; the rig hangs below, for a view is not moved by its own transform.
VIEW = "scene"
#: Frames per turn, so that slow motion is smooth at every speed.
FRAMES_PER_TURN = 72
#: Radii on the screen: Rerun takes a negative one as points, not as mm.
LINE, THIN, THICK, SHAFT, UNSEEN = -1.5, -0.7, -2.5, -3.0, -0.1


def frame_mask(angle: FloatArray, step: float) -> NDArray[np.bool_]:
    """True for the first sample in each frame; unwrapped ``angle`` and its ``step`` in rad."""
    frame = np.floor(np.append(angle[:1] - step, angle) * (FRAMES_PER_TURN / (2.0 * np.pi)))
    return np.asarray(np.diff(frame) > 0.0)


class Scene2D:
    """Draws a cam when it is mounted, as large as the scene's largest; then frames of both.

    ``view`` is the entity that the view shows; ``pace`` says of a live run how many frames may be
    sent, None sends all; ``scale`` is the force (N) of the longest arrow, by default the greatest
    in contact at each speed; ``cursor`` is told the timelines' columns and the cam angles of the
    frames sent.
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
        self._framed = framings(loaded)
        self._highest = max(one.height for one in self._framed.values())
        self._scale = scale
        self._waiting = list[FloatArray]()
        shaft = rr.Points2D([[0.0, 0.0]], colors=looks.GREY, radii=SHAFT)
        canvas.always(f"{self._root}/shaft", shaft)
        canvas.look(f"{self._root}/cam/body", rr.LineStrips2D, draw_order=19.0)  # behind all others
        canvas.look(f"{self._root}/gap", rr.LineStrips2D, colors=looks.GAP, radii=THICK)
        canvas.look(f"{self._root}/force", rr.Arrows2D, colors=looks.FORCE, radii=THICK)

    def mount(self, state: CamState, profile: FloatArray) -> None:
        """Put a cam in place of the one before; ``profile`` ``(n, 2)`` in its own frame, m."""
        self.flush()
        framing, self._law = self._framing_of(state.cam), self._loaded.laws[state.cam]
        self._shape, self._max_lift = framing.shape, framing.max_lift
        zoom = self._highest / framing.height
        # A plane in Rerun has y down; widths grow as the third root of the determinant.
        flip = rr.Transform3D.columns(mat3x3=np.diag([zoom, -zoom, zoom])[None])
        self._canvas.rows(self._root, self._canvas.state(state), flip)
        outline = shapes.closed(profile) * MM
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
        self._strips(state, "rotation", shapes.rotation(0.4 * base * MM), looks.GREY, LINE)
        self._words(state, "numbers", *framing.numbers(), looks.GREY)

    def _framing_of(self, cam: str) -> Framing:
        """Of a cam of the scene, or of one that was mounted since."""
        if cam not in self._framed:
            self._framed |= framings(self._loaded)
        return self._framed[cam]

    def speed(self, state: CamState, title: str = "") -> None:
        """Say under the cam which it is and how fast it turns; a bar shows the force's scale."""
        self.flush()
        self._rpm, framing = to_rpm(state.speed), self._framing_of(state.cam)
        longest = self._scale or max_contact_force(self._loaded, state.cam, state.speed)
        self._arrow = ARROW * framing.height / longest  # mm/N
        foot, across = framing.low + 0.015 * framing.height, np.array([0.09, 0.085])
        force = 10.0 ** math.floor(math.log10(longest))
        bar = foot + np.array([[0.0, 0.0], [0.0, force * self._arrow]])
        self._strips(state, "bar", [bar], looks.FORCE, THICK)
        beside = (foot + across * framing.height)[None]
        self._words(state, "bar/words", beside, [f"{force:g} N"], looks.FORCE)
        under = np.array([[0.0, framing.low[1] + 0.045 * framing.height]])
        words = f"{title}{self._rpm:.4g} rpm"
        self._words(state, "label", under, [words], looks.of_cam(state.cam))
        if self._pace is not None:  # until its first frame comes, nothing of the one before
            at = self._canvas.state(state)
            self._canvas.strips(f"{self._root}/gap", at, [])
            no_force = rr.Arrows2D.columns(origins=[], vectors=[]).partition([0])
            self._canvas.rows(f"{self._root}/force", at, no_force)
            self._read(at, [_lines(("", "", ""), (f"{self._rpm:.4g} rpm", "", ""))])

    def frames(
        self, time: FloatArray, angle: FloatArray, lift: FloatArray, force: FloatArray
    ) -> None:
        """Take cam and follower at ``time`` (s), unwrapped cam ``angle`` (rad), ``lift`` (m).

        Where the contact ``force`` (N) is zero, contact is lost, and the gap is drawn: from the
        point of the cam that would be touched to where the follower has carried it. One that flies
        out of its view is drawn at the edge, which the readings say.
        """
        self._waiting.append(np.stack([time, angle, lift, force]))

    def flush(self, until: float = math.inf) -> None:
        """Send what was taken, up to a rig time (s); the rest waits."""
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
        time, angle, lift, force = frames
        times, shape = self._canvas.times(time, angle), self._shape
        motion = Motion.at(self._law, angle)
        drawn = np.minimum(lift, self._max_lift)
        origin = np.column_stack([shape.origin(drawn) * MM, np.zeros_like(angle)])
        self._canvas.rows(f"{self._root}/cam", times, _pose(angle, None))
        self._canvas.rows(f"{self._root}/follower", times, _pose(shape.turn(drawn), origin))
        point, normal = shape.contact(motion)
        off = force == 0.0
        ends = np.stack([point, shape.carried(point, motion.s, drawn)], axis=1) * MM
        gaps = rr.LineStrips2D.columns(strips=list(ends[off])).partition(off.astype(int))
        self._canvas.rows(f"{self._root}/gap", times, gaps)
        along = np.sum(normal * shape.upward(motion.s), axis=1)
        gap, lean = np.where(off, lift - motion.s, 0.0), np.arccos(along.clip(-1.0, 1.0))
        # of a live run, which is seen at its newest time, only the last is sent
        seen = slice(None) if self._pace is None else slice(-1, None)
        at, turned = self._canvas.times(time[seen], angle[seen]), angle[seen]
        moved = lift[seen], force[seen], gap[seen], lean[seen]
        self._read(at, readings(turned, self._rpm, *moved, self._max_lift))
        if self._cursor is not None:
            self._cursor(at, turned)
        arrows = normal * (force / along * self._arrow)[:, None]
        columns = rr.Arrows2D.columns(origins=point[~off] * MM, vectors=arrows[~off])
        columns = columns.partition((~off).astype(int))
        self._canvas.rows(f"{self._root}/force", times, columns)

    def _read(self, at: list[rr.TimeColumn], words: list[str]) -> None:
        columns = rr.TextDocument.columns(text=words, media_type=["text/markdown"] * len(words))
        self._canvas.rows(f"{self._view}_readings", at, columns)

    def _strips(
        self, state: CamState, entity: str, strips: list[FloatArray], colour: int, radius: float
    ) -> None:
        at = self._canvas.state(state)
        self._canvas.strips(f"{self._root}/{entity}", at, strips, colors=colour, radii=radius)

    def _words(
        self, state: CamState, entity: str, at: FloatArray, words: list[str], colour: int
    ) -> None:
        """Words whose middles hang from places ``(n, 2)``."""
        each: dict[str, Any] = {"colors": colour, "radii": UNSEEN, "show_labels": True}
        columns: dict[str, Any] = {name: [value] * len(words) for name, value in each.items()}
        times = self._canvas.state(state)
        self._canvas.points(f"{self._root}/{entity}", times, at, labels=words, **columns)


def _pose(turn: FloatArray, place: FloatArray | None) -> rr.ComponentColumnList:
    """Turned by ``(n,)`` rad about z, then moved to ``(n, 3)`` mm."""
    zero, half = np.zeros_like(turn), 0.5 * turn
    quaternion = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
    if place is None:
        return rr.Transform3D.columns(quaternion=quaternion)
    return rr.Transform3D.columns(quaternion=quaternion, translation=place)
