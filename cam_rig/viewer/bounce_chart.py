"""Chart of bounces over the cam speed: gap at cam angle 0, and landing angles.

Each point has a separate time. The view shows all points up to the viewer's time cursor.
"""

from __future__ import annotations

import numpy as np
import rerun as rr

from cam_rig.dynamics import MODELS
from cam_rig.laws import Law
from cam_rig.show.chart import Axes, round_marks
from cam_rig.show.looks import of_cam
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, RPM_PER_RAD_S, TURN, FloatArray
from cam_rig.viewer.level_chart import speed_ends
from cam_rig.viewer.quantities import ZERO_GAP, Ranges
from cam_rig.viewer.timeline import Canvas
from cam_rig.viewer.turn_chart import DEGREES, WIDTH, label

VIEW = "bounce"
GAPS = f"{VIEW}/gap"
LANDINGS = f"{VIEW}/landing"
#: Height of each of the two axes, in the units of the drawing plane, whose width is `WIDTH`.
ROW = 48.0
#: Height of the space for the title above each of the two axes, in the units of the drawing plane.
HEAD = 12.0
#: Radius of a drawn point. Rerun takes a negative radius as points of the screen.
POINT = -1.6


def can_rebound(loaded: LoadedScene) -> bool:
    """Return True if the follower can leave the cam and rebounds when it lands."""
    restitution = loaded.rig.follower.restitution
    return MODELS[loaded.scene.model].lifts_off and restitution is not None and restitution.si > 0.0


def bounce_axes(loaded: LoadedScene, ranges: Ranges) -> tuple[Axes, Axes]:
    """Return the axes of the gap (mm) at cam angle 0 and of the landing angles (°).

    Both are over the cam speed in rpm.
    """
    speeds = speed_ends(loaded)
    return (
        Axes(speeds, ranges[ZERO_GAP][:2], WIDTH, ROW, top=HEAD),
        Axes(speeds, (0.0, 360.0), WIDTH, ROW, top=ROW + 2.0 * HEAD),
    )


def gaps_at_zero(law: Law, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return cam speeds (rad/s) and gaps (m) at each passage of cam angle 0.

    The lift between the samples is the cubic Hermite polynomial of both lifts and velocities. In
    flight at 4 kHz its error is a nanometre. If a landing lies between the samples, the error is a
    fraction of the follower's travel in one sample period.

    Parameters
    ----------
    law : Law
        Law of the cam.
    samples : ndarray
        Rows of time (s), cam angle (rad), cam speed (rad/s), lift (m) and velocity (m/s),
        shape (5, n).
    """
    turns = np.floor(samples[1] / TURN)
    before = np.flatnonzero(np.diff(turns) > 0.0)
    (t0, a0, speed, y0, v0), (t1, a1, _, y1, v1) = samples[:, before], samples[:, before + 1]
    u, step = (turns[before + 1] * TURN - a0) / (a1 - a0), t1 - t0
    left, right = 1.0 - u, u
    lift = left**2 * ((1.0 + 2.0 * u) * y0 + u * step * v0)
    lift += right**2 * ((1.0 + 2.0 * left) * y1 - left * step * v1)
    return speed, np.maximum(lift - float(law(0.0)), 0.0)


class BounceChart:
    """Chart of bounces: one point per turn and one point per landing.

    The points of added ticks (times between two cam states) are kept until `flush` sends them to
    the recording.
    """

    def __init__(self, canvas: Canvas, loaded: LoadedScene, ranges: Ranges) -> None:
        self._canvas, self._loaded = canvas, loaded
        self._gap, self._landing = bounce_axes(loaded, ranges)
        self._last: tuple[str, FloatArray] | None = None
        #: Points not yet sent to the recording: entity path -> list of ((time, angle), points).
        self._rows: dict[str, list[tuple[tuple[float, float], FloatArray]]] = {}
        rpm = round_marks(*self._gap.x, "rpm")
        self._gap.draw(canvas.stream, f"{GAPS}/axes", {}, round_marks(*self._gap.y, ""))
        self._landing.draw(canvas.stream, f"{LANDINGS}/axes", rpm, DEGREES)
        for entity, axes, title in (
            (GAPS, self._gap, "Gap at cam angle 0, one point per turn [mm]"),
            (LANDINGS, self._landing, "Cam angle of each landing"),
        ):
            label(canvas, f"{entity}/title", (0.5 * WIDTH, axes.top - 0.7 * HEAD), title)
        for cam in loaded.cams:
            for entity in (GAPS, LANDINGS):
                canvas.set_style(f"{entity}/{cam}", rr.Points2D, colors=of_cam(cam), radii=POINT)

    def tick(self, start: CamState, end: CamState, angle: FloatArray, rows: FloatArray) -> None:
        """Add the points of one tick, the time between two cam states, to the chart.

        `angle` contains the unwrapped cam angles of its samples in rad, shape (n,). The first six
        rows of `rows` are time (s), lift (m), velocity (m/s), acceleration (m/s²), contact force
        (N) and landing impulse (N·s).
        """
        time, lift, velocity, _, _, impulse = rows[:6]
        interval = start.until(end)
        since = time - start.time_ns / NS
        speed = interval.speed + interval.acceleration * since
        samples = np.stack([time, angle, speed, lift, velocity])
        if self._last is not None and self._last[0] == start.cam:
            samples = np.column_stack([self._last[1], samples])
        self._last = start.cam, samples[:, -1]
        time_angle, law = (float(time[-1]), float(angle[-1])), self._loaded.laws[start.cam]
        turned, gaps = gaps_at_zero(law, samples)
        self._add(
            f"{GAPS}/{start.cam}", time_angle, self._gap.place(turned * RPM_PER_RAD_S, gaps * 1e3)
        )
        landed = impulse > 0.0
        degrees, rpm = np.degrees(angle[landed] % TURN), speed[landed] * RPM_PER_RAD_S
        self._add(f"{LANDINGS}/{start.cam}", time_angle, self._landing.place(rpm, degrees))

    def flush(self) -> None:
        """Send the points that were added since the last call to the recording."""
        for entity, rows in self._rows.items():
            ends, points = zip(*rows, strict=True)
            columns = rr.Points2D.columns(positions=np.concatenate(points))
            times = self._canvas.times(*np.array(ends).T)
            self._canvas.rows(entity, times, columns.partition([*map(len, points)]))
        self._rows = {}

    def _add(self, entity: str, time_angle: tuple[float, float], points: FloatArray) -> None:
        if len(points):
            self._rows.setdefault(entity, []).append((time_angle, points))
