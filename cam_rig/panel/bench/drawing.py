"""What the bench's page draws: the mounted cam under its follower, and what a speed will do."""

from __future__ import annotations

import base64
import math
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import FollowerParameters, Samples, TwoMassParameters
from cam_rig.dynamics.jump.any_follower import find_jump, follower_of
from cam_rig.dynamics.jump.rigid_mass import rigid_jump_speed
from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.errors import CamRigError
from cam_rig.laws import Law, build_law
from cam_rig.panel.bench.runner import Setup
from cam_rig.profile import contours
from cam_rig.profile.contact import Motion, turn_angles
from cam_rig.profile.outlines import follower_shape
from cam_rig.quantities.steady import settled_turn
from cam_rig.schema import CamConfig, RigConfig, SceneConfig
from cam_rig.schema.load import Library, config_root, load_cam
from cam_rig.show.looks import DECIMALS, MM, millimetres
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Samples of a tick that a page gets: about one a degree, as it draws no finer.
STEP = math.radians(1.0)
#: States of the cam that are kept until the follower's samples between two of them come.
STATES = 64
#: What blocks for a page begin with.
MOTION, SOUND = b"motion  ", b"sound   "
#: Points of a contour and of a turn's curves.
POINTS = 360
#: Turns over which the level of a speed is measured before the cam turns at it.
TURNS = 4


class Cams:
    """The cams that can be mounted, with their laws, each read once."""

    def __init__(self, folder: Path) -> None:
        self._library = Library((folder, config_root()))
        self._known: dict[str, tuple[CamConfig, Law]] = {}

    def __call__(self, name: str) -> tuple[CamConfig, Law]:
        """A cam and its law by its name."""
        if name not in self._known:
            cam = load_cam(self._library.path("cams", name))
            self._known[name] = cam, build_law(cam)
        return self._known[name]


class LiveMotion:
    """The follower's samples, tick by tick, with the cam's angle at each of them."""

    def __init__(self, cams: Cams) -> None:
        self._cams = cams
        self._states: deque[dict[str, Any]] = deque(maxlen=STATES)

    def state(self, state: dict[str, Any]) -> None:
        """The cam turns at a speed from a rig time on."""
        self._states.append(state)

    def block(self, rows: FloatArray) -> bytes | None:
        """A tick: rig time, step (s) and samples as doubles, `curves`; None without its state."""
        time = rows[0]
        begin_ns, newest_first = round(float(time[0]) * NS), reversed(self._states)
        state = next((s for s in newest_first if s["time_ns"] <= begin_ns), None)
        if state is None:
            return None
        step = float(time[-1] - time[0]) / max(1, time.size - 1)
        try:
            law = self._cams(state["cam"])[1]
        except CamRigError:  # its file went after the law server had read it
            return None
        speed = state["rpm"] * RPM
        angle = state["angle"] % TURN + speed * (time - state["time_ns"] / NS)
        turned = speed * step
        every = max(1, int(STEP / turned)) if turned > 0.0 else 1
        found = curves(law, angle[::every], rows[:, ::every])
        head = np.array([time[0], step * every, found.shape[1]], dtype="<f8")
        return head.tobytes() + found.tobytes()


def cam_picture(cam: CamConfig, law: Law) -> dict[str, Any]:
    """The cam in its own frame and its follower, whose origin is linear in lift; mm and rad."""
    shape, disc = follower_shape(cam, law), contours(cam.follower, law, POINTS)[0]
    two = np.array([0.0, max(law.lift, 1e-3)])
    origin, turn = shape.origin(two) * MM, shape.turn(two)
    lift = float(two[1]) * MM
    motion = Motion.at(law, turn_angles(POINTS))
    point, normal = shape.contact(motion)
    return {
        "contour": millimetres(disc.points),
        "base": _rounded(cam.follower.base_radius.si * MM),
        "roller": _rounded(shape.element.roller * MM),
        "outline": [millimetres(strip.T) for strip in shape.in_guide()],
        "support": [millimetres(strip.T) for strip in shape.support()],
        "origin": origin[0].tolist(),
        "along": ((origin[1] - origin[0]) / lift).tolist(),
        "turn": float(turn[0]),
        "turns": float(turn[1] - turn[0]) / lift,
        "place": millimetres(shape.place(two).T),
        "swings": bool(np.ptp(turn)),
        "reach": _rounded(shape.reach * MM),
        "max_lift": _rounded(shape.max_lift * MM),
        "touch": millimetres(point.T),
        "normal": np.round(normal.T, DECIMALS).tolist(),
    }


def _rounded(value: float) -> float:
    return round(float(value), DECIMALS)


def expected(setup: Setup, law: Law, rig: RigConfig) -> dict[str, Any]:
    """A settled turn by the exact model: `curves`, level (dB), least force (N), if it repeats."""
    scene = SceneConfig.model_validate(setup.scene(rig, [setup.rpm], TURNS))
    speed = setup.rpm * RPM
    block, row, settled = settled_turn(law, rig, scene, speed, POINTS)
    drawn = curves(law, speed * block.time, block.rows)
    return {
        "rpm": setup.rpm,
        "curves": base64.b64encode(drawn.tobytes()).decode("ascii"),
        "level_db": row.level_db,
        "least_n": row.force_least,
        "lost": bool((block.force == 0.0).any()),
        "settled": settled,
    }


def curves(law: Law, angle: FloatArray, rows: FloatArray) -> NDArray[np.float32]:
    """``(6, n)`` of samples: cam angle (rad), lift (mm), m/s, m/s², N, and the gap in µm."""
    samples = Samples(rows)
    gap, off = np.zeros(angle.size), samples.force == 0.0
    if off.any():
        gap[off] = samples.lift[off] - law(angle[off])
    found = [angle, samples.lift * MM, samples.velocity, samples.acceleration, samples.force]
    return np.array([*found, gap * 1e6], dtype="<f4")


def jump_speeds(law: Law, rig: RigConfig, model: str) -> list[dict[str, Any]]:
    """By one rigid mass and, where the rig says how it splits, by two: rpm, None at no speed."""
    found: list[dict[str, Any]] = []
    try:
        found.append(
            _jump("one_mass", rigid_jump_speed(law, FollowerParameters.from_rig(rig)) / RPM)
        )
        if isinstance(follower := follower_of(rig), TwoMassParameters):
            found.append(_jump("two_mass", find_jump(law, follower, FROM_REST).rpm))
    except CamRigError:
        pass  # a held follower has none
    return sorted(found, key=lambda one: one["model"] != model)


def _jump(model: str, rpm: float) -> dict[str, Any]:
    return {"model": model, "rpm": rpm if math.isfinite(rpm) else None}
