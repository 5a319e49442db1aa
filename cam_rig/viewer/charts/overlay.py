"""Turns laid over each other, and cams side by side at one speed."""

from __future__ import annotations

import rerun as rr

from cam_rig.arrays import FloatArray
from cam_rig.drawing.cam_looks import of_cam
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.viewer.charts.band_chart import BandChart
from cam_rig.viewer.charts.bands import third_octaves
from cam_rig.viewer.charts.series import SeriesLine, SeriesWriter
from cam_rig.viewer.scene2d import Scene2D, frame_mask
from cam_rig.viewer.timeline import within_turn
from cam_rig.viewer.turns import Turn

TURNS, COMPARE = "turns", "compare"
#: Quantity of a turn that is shown over it: factor to the unit shown, title.
QUANTITIES = {
    "lift": (1e3, "Lift [mm]"),
    "acceleration": (1.0, "Acceleration [m/s²]"),
    "force": (1.0, "Contact force [N]"),
}


def at_speed(rpm: float, quantity: str) -> str:
    """The entity below which every cam has its curve of a quantity at a speed."""
    return f"{TURNS}/{rpm:.6g}_rpm/{quantity}"


def draw_turn(stream: rr.RecordingStream, loaded: LoadedScene, turn: Turn) -> None:
    """Curves of one turn over the angle within it."""
    for quantity, (factor, _) in QUANTITIES.items():
        entity, colour = (
            f"{at_speed(turn.rpm, quantity)}/{turn.cam}",
            of_cam(turn.cam),
        )
        line = SeriesLine(entity, loaded.cams[turn.cam].title, colour, factor=factor)
        writer = SeriesWriter(stream, line, times=within_turn)
        writer.add(turn.time, turn.angle, getattr(turn, quantity))
        writer.flush()


def draw_side_by_side(
    stream: rr.RecordingStream, loaded: LoadedScene, turn: Turn, profile: FloatArray
) -> None:
    """A cam under its follower, and third-octave bands, of one turn, in a view of its own."""
    view, rate = f"{COMPARE}/{turn.cam}", loaded.scene.sample_rate.si
    scene = Scene2D(stream, loaded, f"{view}/scene", within_turn)
    begin = CamState(0, 0.0, turn.speed, turn.cam)
    scene.mount(begin, profile)
    scene.speed(begin)
    frame = frame_mask(turn.angle, turn.speed / rate)
    scene.frames(turn.time[frame], turn.angle[frame], turn.lift[frame], turn.force[frame])
    scene.flush()
    bands = third_octaves(loaded.radiation, turn.force, turn.impulse, rate)
    chart = BandChart(stream, f"{view}/bands", rate, of_cam(turn.cam))
    chart.draw_once(bands)
