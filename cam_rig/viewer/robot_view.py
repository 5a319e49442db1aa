"""Rig in three dimensions from its URDF, lanes of contact, and sound of a recorded run.

Rerun calls the archetypes of lanes and sound unstable. A test checks each of them.
"""

from __future__ import annotations

import io
import wave

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree

from cam_rig.acoustics import SoundSource
from cam_rig.acoustics.sound_level_meter import full_scale, pcm
from cam_rig.files import temporary_folder
from cam_rig.messages.frames import BASE, Robot
from cam_rig.messages.urdf import urdf
from cam_rig.show import looks as colours
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import FloatArray
from cam_rig.viewer.timeline import Canvas

#: Name of the frame that the robots are in, one robot per cam.
ROBOT = "robot"
#: Entity path of the lane of contact and flight.
CONTACT = "contact"
#: Entity path of the sound of the run.
SOUND = "sound"
#: States of the lane of contact, with their colours.
STATES = {"contact": colours.GREEN, "flight": colours.GAP}
#: Scale of the robot of a cam that is not mounted. A scale of 0 would have no inverse.
HIDDEN_SCALE = 1e-6
#: Largest number of samples of the sound of a run. They take 80 MB in memory.
MAX_SOUND_SAMPLES = 10_000_000


def robot_root(cam: str) -> str:
    """Return the entity path of the robot of a cam. Rerun accepts no path of several parts."""
    return f"{ROBOT}_{cam}"


class RobotView:
    """Robots of the cams of a scene, of which that of the mounted cam is visible."""

    def __init__(self, canvas: Canvas, loaded: LoadedScene) -> None:
        self._canvas, self._trees, self._mounted = canvas, dict[str, UrdfTree](), ""
        with temporary_folder("cam_rig-urdf-") as folder:
            for cam in loaded.cams:
                (path := folder / "rig.urdf").write_text(urdf(Robot.of(loaded, cam)), "utf-8")
                root = robot_root(cam)
                self._trees[cam] = UrdfTree.from_file_path(
                    path, root, frame_prefix=f"{cam}/", static_transform_entity_path=f"{root}/fixed"
                )
                self._trees[cam].log_urdf_to_recording(canvas.stream)
                self._paint(cam)

    def _paint(self, cam: str) -> None:
        """Give the boxes, the base circle and the shaft of a cam its colour."""
        hue = colours.of_cam(cam)
        boxes, cylinders = (kind.from_fields(colors=hue) for kind in (rr.Boxes3D, rr.Cylinders3D))
        for link, shape in ((cam, boxes), ("cam", cylinders)):
            for path in self._trees[cam].get_visual_geometry_paths(link):
                self._canvas.log_static(path, shape)

    def mount(self, state: CamState) -> None:
        """Show the robot of the cam of a state, and hide the others."""
        self._mounted = state.cam
        for cam in self._trees:
            columns = rr.Transform3D.columns(
                scale=[[1.0 if cam == state.cam else HIDDEN_SCALE] * 3],
                parent_frame=[ROBOT],
                child_frame=[f"{cam}/{BASE}"],
            )
            self._canvas.rows(f"{robot_root(cam)}/mounted", self._canvas.times_of(state), columns)

    def frames(self, time: FloatArray, angle: FloatArray, lift: FloatArray) -> None:
        """Draw the mounted cam at times (s) and angles (rad) under the follower at its lift (m)."""
        times, values = self._canvas.times(time, angle), {"cam": angle, "follower": lift}
        for joint in self._trees[self._mounted].joints():
            mimic = joint.mimic
            position = values.get(joint.name if mimic is None else mimic.joint)
            if position is None:
                continue
            factor = 1.0 if mimic is None else mimic.multiplier
            columns = joint.compute_transform_columns((factor * position).tolist(), clamp=False)
            self._canvas.rows(f"{robot_root(self._mounted)}/{joint.name}", times, columns)


class ContactLane:
    """Lane with the states contact and flight over time."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._is_off: bool | None = None
        names, hues = list(STATES), list(STATES.values())
        canvas.log_static(CONTACT, rr.StateConfiguration(values=names, colors=hues))

    def add(self, time: FloatArray, angle: FloatArray, force: FloatArray) -> None:
        """Add the changes of state at times (s) and angles (rad) by the contact force (N)."""
        off = force == 0.0
        before = np.append(not off[0] if self._is_off is None else self._is_off, off[:-1])
        changed, self._is_off = off != before, bool(off[-1])
        if changed.any():
            names = [list(STATES)[int(is_off)] for is_off in off[changed]]
            times = self._canvas.times(time[changed], angle[changed])
            self._canvas.rows(CONTACT, times, rr.StateChange.columns(state=names))


class RunSound:
    """Sound of a run, which the viewer plays in step with the rig time."""

    def __init__(self, canvas: Canvas, loaded: LoadedScene) -> None:
        self._canvas, self._rate = canvas, int(loaded.scene.sample_rate.si)
        self._source = SoundSource(loaded.radiation, self._rate, least_rate=self._rate)
        self._first: CamState | None = None
        self._pressure, self._count = list[FloatArray](), 0

    def add(self, start: CamState, end: CamState, force: FloatArray, impulse: FloatArray) -> None:
        """Add the sound of a tick by its contact force (N) and landing impulses (N·s)."""
        self._first, self._count = self._first or start, self._count + force.size
        pressure = self._source.pressure(force, impulse, start.until(end).mean_speed)
        if self._count <= MAX_SOUND_SAMPLES:
            self._pressure.append(pressure.astype(np.float32))

    def close(self) -> None:
        """Write the sound, unless the run is empty or longer than `MAX_SOUND_SAMPLES`."""
        if self._first is None or self._count > MAX_SOUND_SAMPLES:
            return
        pressure, file = np.concatenate(self._pressure).astype(np.float64), io.BytesIO()
        with wave.open(file, "wb") as out:
            out.setparams((1, 2, self._rate, 0, "NONE", ""))
            out.writeframes(pcm(pressure, full_scale(float(np.abs(pressure).max()))))
        columns = rr.AssetAudio.columns(blob=[file.getvalue()], media_type=["audio/wav"])
        self._canvas.rows(SOUND, self._canvas.times_of(self._first), columns)
