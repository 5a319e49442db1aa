"""The cam and its follower as a moving picture in the plane, mm, y up."""

from __future__ import annotations

import numpy as np
import rerun as rr

from cam_rig.dynamics import FloatArray
from cam_rig.errors import BagError
from cam_rig.experiment.program import CamState
from cam_rig.experiment.stage import Stage
from cam_rig.view.shapes import MM, circle, closed, follower_strips, guide_strips
from cam_rig.view.timeline import time_columns

#: What the view shows; the rig hangs below, for a view is not moved by its own transform.
VIEW = "scene"
ROOT = f"{VIEW}/rig"
CAM, FOLLOWER, LABEL = f"{ROOT}/cam", f"{ROOT}/follower", f"{ROOT}/label"
CONTOUR = f"{CAM}/contour"
#: Pictures a turn, so that slow motion is smooth at every speed.
FRAMES_PER_TURN = 72
COLOURS = (0x56B4E9FF, 0xE69F00FF, 0x009E73FF, 0xCC79A7FF, 0xF0E442FF)
GREY = 0x999999FF
#: Radii on the screen: Rerun takes a negative one as points, not as mm.
LINE, THIN, SHAFT, UNSEEN = -1.5, -0.7, -3.0, -0.1


def reach(stage: Stage) -> float:
    """Greatest height of a roller's centre above the cam shaft over all cams of the scene, m."""
    angle = np.radians(np.arange(360.0))
    return max(
        cam.follower.base_radius.si + cam.follower.roller + float(stage.laws[name](angle).max())
        for name, cam in stage.cams.items()
    )


def frame_mask(angle: FloatArray, step: float) -> FloatArray:
    """True for the first sample in each frame; unwrapped ``angle`` and its ``step`` in rad."""
    frame = np.floor(np.append(angle[:1] - step, angle) * (FRAMES_PER_TURN / (2.0 * np.pi)))
    return np.asarray(np.diff(frame) > 0.0)


class Scene2D:
    """Draws into a recording: a cam when it is mounted, then frames of cam and follower."""

    def __init__(self, stream: rr.RecordingStream, stage: Stage) -> None:
        self._stream, self._stage = stream, stage
        self._reach, self._pitch = reach(stage), 0.0
        # A plane in Rerun has y down.
        stream.log(ROOT, rr.Transform3D(mat3x3=np.diag([1.0, -1.0, 1.0])), static=True)
        guide = rr.LineStrips2D(guide_strips(self._reach), colors=GREY, radii=THIN)
        stream.log(f"{ROOT}/guide", guide, static=True)
        shaft = rr.Points2D([[0.0, 0.0]], colors=GREY, radii=SHAFT)
        stream.log(f"{ROOT}/shaft", shaft, static=True)

    def mount(self, state: CamState, profile: FloatArray | None) -> None:
        """Put a cam in place of the one before; ``profile`` ``(n, 2)`` in its own frame, m."""
        if profile is None:
            raise BagError(f"cam {state.cam!r} turns, but its /cam/profile is not in the bag")
        config = self._stage.cams[state.cam].follower
        self._pitch = config.base_radius.si + config.roller
        colour = COLOURS[list(self._stage.cams).index(state.cam) % len(COLOURS)]
        outline = closed(profile) * MM
        mark = np.stack([np.zeros(2), outline[0]])
        self._strips(state, CONTOUR, [outline], colour, LINE)
        self._strips(state, f"{CAM}/mark", [mark], colour, THIN)
        self._strips(state, f"{CAM}/base_circle", [circle(config.base_radius.si * MM)], GREY, THIN)
        strips = follower_strips(config, self._reach)
        self._strips(state, f"{FOLLOWER}/outline", strips, 0xDDDDDDFF, LINE)

    def label(self, state: CamState, words: str) -> None:
        """Words under the cam from this state on."""
        columns = rr.Points2D.columns(
            positions=[[0.0, -1.1 * self._reach * MM]],
            labels=[words],
            radii=[UNSEEN],
            show_labels=[True],
        )
        self._stream.send_columns(LABEL, _at(state), columns)

    def frames(self, time: FloatArray, angle: FloatArray, lift: FloatArray) -> None:
        """Cam and follower at ``time`` (s), unwrapped cam ``angle`` (rad) and ``lift`` (m)."""
        zero, half = np.zeros_like(angle), 0.5 * angle
        turn = np.column_stack([zero, zero, np.sin(half), np.cos(half)])
        place = np.column_stack([zero, (self._pitch + lift) * MM, zero])
        times = time_columns(time, angle)
        self._stream.send_columns(CAM, times, rr.Transform3D.columns(quaternion=turn))
        self._stream.send_columns(FOLLOWER, times, rr.Transform3D.columns(translation=place))

    def _strips(
        self,
        state: CamState,
        entity: str,
        strips: list[FloatArray],
        colour: int,
        radius: float,
    ) -> None:
        count = len(strips)
        columns = rr.LineStrips2D.columns(
            strips=strips, colors=[colour] * count, radii=[radius] * count
        )
        self._stream.send_columns(entity, _at(state), columns.partition([count]))


def _at(state: CamState) -> list[rr.TimeColumn]:
    return time_columns(np.array([state.time_ns * 1e-9]), np.array([state.angle]))
