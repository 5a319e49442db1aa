"""Laws, blocks and cam states as the content of messages: labelled arrays, stamps, joints.

No message class enters here, so nodes (rclpy) and analysis (rosbags) share it.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from typing import Any

import numpy as np

from cam_rig.dynamics import ANGLE_TOLERANCE, COLUMNS
from cam_rig.errors import CamRigError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import FACTORS
from cam_rig.live.state_validation import MAX_SAMPLES, require_possible
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, FloatArray

#: A label and a size each, outermost first.
Dimensions = list[tuple[str, int]]
#: The row of a piece: the cam angle where it begins, then its Bernstein ordinates.
PIECE_LABEL = "break_rad, ordinates_m"
BLOCK_LABEL = ", ".join(COLUMNS)
SAMPLE_LABEL = "sample"
#: A cam's name; its file has the same.
CAM_NAME = re.compile(r"[a-z][a-z0-9_]{0,99}")
#: The joints of a cam's state: the angle with all turns, and the angle within the turn, which has
#: all its digits. Bags of earlier versions have the first alone.
CAM_JOINTS = ("cam", "cam_in_turn")
#: Limits beyond any cam's pieces and degree: a receiver would compute for minutes.
MAX_PIECES, MAX_DEGREE = 1000, 64
#: A shorter piece, in rad, would have accelerations beyond what numbers hold.
MIN_PIECE_SPAN = 1e-9
#: No cam lifts farther, m; no sample of a test rig is larger, in SI units.
MAX_LIFT, MAX_VALUE = 10.0, 1e12


def array_of(message: Any) -> tuple[Dimensions, FloatArray]:
    """Dimensions and data of a Float64MultiArray, of rclpy or of rosbags alike."""
    dimensions = [(str(d.label), int(d.size)) for d in message.layout.dim]
    return dimensions, np.frombuffer(message.data, dtype=np.float64)


def encode_law(law: Law) -> tuple[Dimensions, FloatArray]:
    """A law as ``(n, p + 2)``: one row per piece, labelled with the cam's name."""
    rows = np.column_stack([law.breaks[:-1], law.ordinates.T])
    return [(law.name, rows.shape[0]), (PIECE_LABEL, rows.shape[1])], rows


def decode_law(dimensions: Dimensions, data: FloatArray) -> Law:
    """The law of an array made by `encode_law`."""
    rows = _shaped(dimensions, data, "law coefficients")
    if dimensions[1][0] != PIECE_LABEL or rows.shape[1] < 2:
        raise RefusedError(f"law coefficients: dimension {dimensions[1]}; allowed: {PIECE_LABEL!r}")
    if rows.shape[0] > MAX_PIECES or rows.shape[1] > MAX_DEGREE + 2:
        raise RefusedError(
            f"law coefficients: {rows.shape[0]} pieces of degree {rows.shape[1] - 2}; allowed: "
            f"{MAX_PIECES} of {MAX_DEGREE}"
        )
    if not CAM_NAME.fullmatch(dimensions[0][0]):
        raise RefusedError(f"law coefficients: of {dimensions[0][0][:80]!r}; allowed: a cam's name")
    if not np.abs(rows[:, 1:]).max() <= MAX_LIFT:
        raise RefusedError(f"law coefficients: allowed: finite, at most {MAX_LIFT:g} m")
    try:
        law = Law(dimensions[0][0], np.append(rows[:, 0], TURN), rows[:, 1:].T)
        if law.spans.min() < MIN_PIECE_SPAN:
            raise RefusedError(f"a piece shorter than {MIN_PIECE_SPAN:g} rad")
    except CamRigError as error:
        raise RefusedError(f"law coefficients: {error}") from None
    return law


def encode_block(rows: FloatArray) -> tuple[Dimensions, FloatArray]:
    """A block of samples as it is, ``(6, n)``: a row each for `COLUMNS`."""
    return [(BLOCK_LABEL, rows.shape[0]), (SAMPLE_LABEL, rows.shape[1])], rows


def decode_block(dimensions: Dimensions, data: FloatArray) -> FloatArray:
    """Rows ``(6, n)`` of an array made by `encode_block`."""
    rows = _shaped(dimensions, data, "follower samples")
    if dimensions[0] != (BLOCK_LABEL, len(COLUMNS)):
        raise RefusedError(f"follower samples: dimension {dimensions[0]}; allowed: {BLOCK_LABEL!r}")
    if rows.shape[1] > MAX_SAMPLES:
        raise RefusedError(f"follower samples: {rows.shape[1]}; allowed: {MAX_SAMPLES} a tick")
    if not max(rows.max(), -rows.min()) <= MAX_VALUE:
        raise RefusedError(f"follower samples: allowed: finite, at most {MAX_VALUE:g}")
    return rows


def block_of(message: Any) -> FloatArray:
    """Rows ``(6, n)`` of a message of /follower/samples."""
    return decode_block(*array_of(message))


def rig_time(seconds: int, nanoseconds: int) -> int:
    """Rig time in ns."""
    if seconds < 0 or nanoseconds >= NS:
        raise RefusedError(f"a stamp of {seconds} s and {nanoseconds} ns; allowed: from zero on")
    return seconds * NS + nanoseconds


def stamp_ns(stamp: Any) -> int:
    """Rig time in ns of a builtin_interfaces/Time, of rclpy or of rosbags alike."""
    return rig_time(int(stamp.sec), int(stamp.nanosec))


def real_time_factor(value: float) -> float:
    """Rig seconds a wall second, as /rig/real_time_factor has it; 0 of a free run."""
    if value != 0.0 and not FACTORS[0] <= value <= FACTORS[1]:
        raise RefusedError(
            f"real-time factor: is {value:g}; allowed: 0, or {FACTORS[0]:g} to {FACTORS[1]:g}"
        )
    return value


def cam_state_of(message: Any) -> CamState:
    """The cam's state of a JointState; the frame names the mounted cam."""
    cam, count = str(message.header.frame_id), len(message.position)
    if count not in (1, 2) or len(message.velocity) != count or not CAM_NAME.fullmatch(cam):
        raise RefusedError(
            f"cam state: {count} positions, {len(message.velocity)} velocities, frame "
            f"{cam[:80]!r}; allowed: {' and '.join(CAM_JOINTS)}, or the first alone, and a cam's "
            "name"
        )
    time_ns, speed = stamp_ns(message.header.stamp), float(message.velocity[0])
    state = CamState(time_ns, float(message.position[0]), speed, cam)
    require_possible(state)
    return state if count == 1 else _within_turn(state, float(message.position[1]))


def _within_turn(read: CamState, angle: float) -> CamState:
    """A state with its angle (rad) within the turn; ``read`` has the angle with all turns."""
    if not 0.0 <= angle < TURN:
        raise RefusedError(f"cam state: {angle!r} rad within the turn; allowed: 0 to 2π, without")
    turns = round((read.unwrapped - angle) / TURN)
    state = replace(read, angle=angle, turns=turns)
    away, rounding = abs(state.since(read)), 4.0 * math.ulp(read.unwrapped)
    if not away <= ANGLE_TOLERANCE + rounding:
        raise RefusedError(
            f"cam state: θ {read.unwrapped!r} rad and {angle!r} rad within the turn are {away:.3g} "
            f"rad apart; allowed: {ANGLE_TOLERANCE:g} rad"
        )
    return state


def _shaped(dimensions: Dimensions, data: FloatArray, what: str) -> FloatArray:
    shape = tuple(size for _, size in dimensions)
    if len(shape) != 2 or shape[0] * shape[1] != data.size or data.size == 0:
        raise RefusedError(
            f"{what}: {data.size} numbers in dimensions {shape}; allowed: two that fit"
        )
    return data.reshape(shape)
