"""Data drawn by the bench's page: cam with follower, live motion, predicted turn."""

from __future__ import annotations

import base64
import math
from collections import deque
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import FollowerParameters, Samples, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S
from cam_rig.errors import CamRigError
from cam_rig.laws import Law, build_law
from cam_rig.panel.bench.runner import Setup
from cam_rig.profile import contours
from cam_rig.profile.contact import Motion, turn_angles
from cam_rig.profile.outlines import FollowerShape, follower_shape
from cam_rig.quantities.steady import steady_turn
from cam_rig.schema import CamConfig, RigConfig, SceneConfig
from cam_rig.schema.load import Library, config_root, load_cam
from cam_rig.show.looks import DECIMALS, MM, millimetres
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Smallest step of the cam angle (rad) between the samples that are sent to a page. Smaller steps
#: are not visible on the page, which draws no finer than one degree.
SAMPLE_STEP = math.radians(1.0)
#: Largest number of cam states that are stored until the follower's samples of the same time
#: arrive.
MAX_STATES = 64
#: First bytes of a message with the motion of one or more ticks. They are padded to 8 bytes, so
#: that the doubles after them are aligned.
MOTION = b"motion  "
#: First bytes of a message with the sound of one or more ticks, padded to the length of `MOTION`.
SOUND = b"sound   "
#: Number of points per turn of the contours and the predicted curves that are sent to a page.
CONTOUR_POINTS = 360
#: Number of turns that are simulated to determine the sound level of a speed.
LEVEL_TURNS = 4


class Cams:
    """Loader of the cams that can be mounted, with their laws.

    Each file is read once.
    """

    def __init__(self, folder: Path) -> None:
        self._library = Library((folder, config_root()))
        self._cache: dict[str, tuple[CamConfig, Law]] = {}

    def __call__(self, name: str) -> tuple[CamConfig, Law]:
        """Return the cam with a name, and its law."""
        if name not in self._cache:
            cam = load_cam(self._library.path("cams", name))
            self._cache[name] = cam, build_law(cam)
        return self._cache[name]


class LiveMotion:
    """Converter of the follower's samples to bytes for a page, tick by tick.

    The cam angle of each sample is added. It follows from the cam states.
    """

    def __init__(self, cams: Cams) -> None:
        self._cams = cams
        self._states: deque[dict[str, Any]] = deque(maxlen=MAX_STATES)

    def add_state(self, state: dict[str, Any]) -> None:
        """Add the cam state (time_ns, angle, rpm, cam) that applies from its time on."""
        self._states.append(state)

    def block(self, rows: FloatArray) -> bytes | None:
        """Return the samples of a tick as bytes, or None if the tick has no cam state.

        `rows` contains the samples, shape (6, n). The bytes contain rig time (s), time step (s) and
        number of samples as doubles, followed by the rows of `turn_curves` as float32.
        """
        time = rows[0]
        start_ns, newest_first = round(float(time[0]) * NS), reversed(self._states)
        state = next((s for s in newest_first if s["time_ns"] <= start_ns), None)
        if state is None:
            return None
        step = float(time[-1] - time[0]) / max(1, time.size - 1)
        try:
            law = self._cams(state["cam"])[1]
        except CamRigError:  # the file was removed after the law server had read it
            return None
        speed = state["rpm"] * RPM
        angle = state["angle"] % TURN + speed * (time - state["time_ns"] / NS)
        angle_step = speed * step
        stride = max(1, int(SAMPLE_STEP / angle_step)) if angle_step > 0.0 else 1
        values = turn_curves(law, angle[::stride], rows[:, ::stride])
        header = np.array([time[0], step * stride, values.shape[1]], dtype="<f8")
        return header.tobytes() + values.tobytes()


def cam_picture(cam: CamConfig, law: Law) -> dict[str, Any]:
    """Return the geometry of a cam and its follower as JSON data, in mm and rad.

    The coordinates are those of the cam's frame. The follower is that of `follower_picture`.
    """
    shape, disc = follower_shape(cam, law), contours(cam.follower, law, CONTOUR_POINTS)[0]
    motion = Motion.at(law, turn_angles(CONTOUR_POINTS))
    point, normal = shape.contact(motion)
    return follower_picture(cam, law, shape) | {
        "contour": millimetres(disc.points),
        "roller": _millimetres(shape.element.roller),
        "support": [millimetres(strip.T) for strip in shape.support()],
        "centre": millimetres(shape.place(_lifts(law)).T),
        "reach": _millimetres(shape.reach),
        "contact": millimetres(point.T),
        "normal": np.round(normal.T, DECIMALS).tolist(),
    }


def follower_picture(cam: CamConfig, law: Law, shape: FollowerShape) -> dict[str, Any]:
    """Return the outline and the position of a follower as JSON data, in mm and rad.

    Position and turn are given at zero lift and per mm of lift, because they are linear in the
    lift. The data contain the base circle of the cam.
    """
    lifts = _lifts(law)
    origin, turn = shape.origin(lifts) * MM, shape.turn(lifts)
    lift = float(lifts[1]) * MM
    return {
        "base": _millimetres(cam.follower.base_radius.si),
        "outline": [millimetres(strip.T) for strip in shape.in_guide()],
        "origin": origin[0].tolist(),
        "origin_per_mm": ((origin[1] - origin[0]) / lift).tolist(),
        "turn": float(turn[0]),
        "turn_per_mm": float(turn[1] - turn[0]) / lift,
        "is_oscillating": bool(np.ptp(turn)),
        "max_lift": _millimetres(shape.max_lift),
    }


def _lifts(law: Law) -> FloatArray:
    """Return two lifts (m), which define the linear map from lift to origin and turn."""
    return np.array([0.0, max(law.lift, 1e-3)])


def _millimetres(length: float) -> float:
    return round(float(length * MM), DECIMALS)


def predict_turn(setup: Setup, law: Law, rig: RigConfig) -> dict[str, Any]:
    """Return the steady turn of a set-up, computed by the exact model.

    The result contains the speed (rpm), `turn_curves` in base64, the level (dB), the least force
    (N), and the flags `contact_lost` and `is_steady` (the turn repeats).
    """
    scene = SceneConfig.model_validate(setup.scene_data(rig, [setup.rpm], LEVEL_TURNS))
    speed = setup.rpm * RPM
    block, row, is_steady = steady_turn(law, rig, scene, speed, CONTOUR_POINTS)
    values = turn_curves(law, speed * block.time, block.rows)
    return {
        "rpm": setup.rpm,
        "curves": base64.b64encode(values.tobytes()).decode("ascii"),
        "level_db": row.level_db,
        "min_force_n": row.min_force,
        "contact_lost": bool((block.force == 0.0).any()),
        "is_steady": is_steady,
    }


def turn_curves(law: Law, angle: FloatArray, rows: FloatArray) -> NDArray[np.float32]:
    """Return the curves that a page draws from samples, ``(6, n)``.

    The rows are cam angle (rad), lift (mm), velocity (m/s), acceleration (m/s²), force (N) and gap
    (µm). ``angle`` (rad) is that of the samples.
    """
    samples = Samples(rows)
    gap, free = np.zeros(angle.size), samples.force == 0.0
    if free.any():
        gap[free] = samples.lift[free] - law(angle[free])
    columns = [angle, samples.lift * MM, samples.velocity, samples.acceleration, samples.force]
    return np.array([*columns, gap * 1e6], dtype="<f4")


def jump_speeds(law: Law, rig: RigConfig, model: str) -> list[dict[str, Any]]:
    """Return the jump speeds (rpm), at which the follower first leaves the cam.

    There is an entry for one rigid mass and one for two elastic masses. The entry of `model` comes
    first. A speed is None if contact is never lost. Two masses are left out if the rig does not
    split its mass. A speed that cannot be computed is left out, such as that of a desmodromic
    follower.
    """
    speeds: dict[str, float] = {}
    with suppress(CamRigError):  # a desmodromic follower has no jump speed
        speeds["one_mass"] = rigid_jump_speed(law, FollowerParameters.from_rig(rig)) / RPM
        if isinstance(follower := follower_of(rig), TwoMassParameters):
            speeds["two_mass"] = find_jump(law, follower, REST_DURATION_S).rpm
    entries = [{"model": m, "rpm": v if math.isfinite(v) else None} for m, v in speeds.items()]
    return sorted(entries, key=lambda entry: entry["model"] != model)
