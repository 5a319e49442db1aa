"""Turns laid over each other, and cams side by side at one speed."""

from __future__ import annotations

import numpy as np
import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing.cam_looks import of_cam
from cam_rig.drawing.words import shortened
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.viewer.charts.band_chart import BandChart
from cam_rig.viewer.charts.bands import third_octaves
from cam_rig.viewer.charts.quantities import GAP, LIFT, TWIST, VELOCITY, Drawn, Ranges, drawn_of
from cam_rig.viewer.charts.text_panels import MAX_TITLE
from cam_rig.viewer.charts.turn_axes import WIDTH, TurnAxes, curve, label
from cam_rig.viewer.framing import force_scale
from cam_rig.viewer.scene2d import Scene2D, frame_mask
from cam_rig.viewer.timeline import within_turn
from cam_rig.viewer.turns import Turn

TURNS, COMPARE = "turns", "compare"
#: Height of the axes, of their width 160.
ROW = 80.0
#: Cams whose names stand in a line over the axes, and from line to line.
NAMES_IN_LINE, NAME_STEP = 2, 11.0
#: Radius of a curve on the screen.
STROKE = -0.9


def compared_of(loaded: LoadedScene) -> tuple[Drawn, ...]:
    """The quantities that are laid over each other."""
    return tuple(row for row in drawn_of(loaded.scene.model) if row not in (VELOCITY, GAP, TWIST))


def at_speed(rpm: float, quantity: str) -> str:
    """The view in which every cam has its curve of a quantity at a speed."""
    return f"{TURNS}/{rpm:.6g}_rpm/{quantity}"


def turn_axes(row: Drawn, ranges: Ranges) -> TurnAxes:
    """The axes in which all cams have their curve of one quantity."""
    return TurnAxes([row], ranges, ROW)


def names_height(loaded: LoadedScene) -> float:
    """Room for the cams' names over the axes, which no curve reaches."""
    return -(-len(loaded.cams) // NAMES_IN_LINE) * NAME_STEP


def draw_turn_axes(
    stream: rr.RecordingStream, loaded: LoadedScene, rpm: float, ranges: Ranges
) -> None:
    """Draw the axes, their cursor on the timeline of degrees, and each cam's name in its colour."""
    degrees = np.arange(360.0)
    for row in compared_of(loaded):
        view = at_speed(rpm, row.key)
        axes = turn_axes(row, ranges)
        axes.draw(stream, view, titled=False)
        axes.draw_marks(stream, view)
        turned = np.radians(degrees)
        axes.move_cursor(stream, view, within_turn(degrees, turned), turned)
    lines = names_height(loaded) / NAME_STEP
    for i, (name, cam) in enumerate(loaded.cams.items()):
        line, column = divmod(i, NAMES_IN_LINE)
        at = (column + 0.5) * WIDTH / NAMES_IN_LINE, (line - lines) * NAME_STEP
        where = f"{at_speed(rpm, LIFT.key)}/lift/names/{name}"
        label(stream, where, at, shortened(cam.title, MAX_TITLE), of_cam(name))


def draw_turn(stream: rr.RecordingStream, loaded: LoadedScene, turn: Turn, ranges: Ranges) -> None:
    """Curves of one turn over the angle within it."""
    for row in compared_of(loaded):
        values = getattr(turn, row.key) * row.line.factor
        points = curve(turn_axes(row, ranges), row.key, turn.angle, values)
        line = rr.LineStrips2D([points], colors=of_cam(turn.cam), radii=STROKE)
        stream.log(f"{at_speed(turn.rpm, row.key)}/{row.key}/{turn.cam}", line, static=True)


def draw_side_by_side(
    stream: rr.RecordingStream, loaded: LoadedScene, turn: Turn, profile: FloatArray
) -> None:
    """A cam under its follower, and third-octave bands, of one turn, in a view of its own."""
    view, rate = f"{COMPARE}/{turn.cam}", loaded.scene.sample_rate.si
    scale = force_scale(loaded, turn.speed)
    scene = Scene2D(stream, loaded, f"{view}/scene", within_turn, scale=scale)
    begin = CamState(0, 0.0, turn.speed, turn.cam)
    scene.mount(begin, profile)
    scene.speed(begin)
    frame = frame_mask(turn.angle, turn.speed / rate)
    scene.frames(turn.time[frame], turn.angle[frame], turn.lift[frame], turn.force[frame])
    scene.flush()
    bands = third_octaves(loaded.radiation, turn.force, turn.impulse, rate)
    chart = BandChart(stream, f"{view}/bands", rate, of_cam(turn.cam))
    chart.draw_once(bands)
