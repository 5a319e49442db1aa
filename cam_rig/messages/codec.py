"""Conversion of laws, samples and cam states to and from messages.

A law consists of polynomial pieces. A block contains the samples of one tick. The module does not
depend on message classes. Nodes (rclpy) and analysis (rosbags) share it.
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
from cam_rig.live.flow_control import MAX_FACTOR, MIN_FACTOR
from cam_rig.live.state_validation import MAX_SAMPLES, require_possible
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN, FloatArray

#: Label and size of each dimension of an array in a message, outermost first.
Dimensions = list[tuple[str, int]]
#: Label of the columns of a law in a message, one row per polynomial piece: cam angle (rad) at the
#: start of the piece, then its ordinates in Bernstein form (m).
PIECE_LABEL = "break_rad, ordinates_m"
#: Label of the rows of the samples of one tick (time between two cam states) in a message: the
#: names of the quantities.
BLOCK_LABEL = ", ".join(COLUMNS)
#: Label of the columns of the samples of one tick (time between two cam states) in a message: one
#: column per sample.
SAMPLE_LABEL = "sample"
#: Pattern of the names of cams, which are also the names of their files.
CAM_NAME = re.compile(r"[a-z][a-z0-9_]{0,99}")
#: Joints of a cam state: the angle with all turns, and the angle within the turn, which has the
#: full precision. Bags of earlier versions have the first joint only.
CAM_JOINTS = ("cam", "cam_in_turn")
#: Largest number of polynomial pieces of a law in a message, more than any cam has. Larger laws
#: would occupy a receiver for minutes.
MAX_PIECES = 1000
#: Largest degree of the polynomial pieces of a law in a message. Larger laws would occupy a
#: receiver for minutes.
MAX_DEGREE = 64
#: Shortest cam angle (rad) of a polynomial piece of a law in a message. The accelerations of
#: shorter pieces could exceed the range of float64.
MIN_PIECE_SPAN = 1e-9
#: Largest lift of a law in a message, m, larger than that of any cam.
MAX_LIFT = 10.0
#: Largest absolute value of a sample in a message, in SI units, larger than any value of a test
#: rig.
MAX_VALUE = 1e12


def array_of(message: Any) -> tuple[Dimensions, FloatArray]:
    """Return the dimensions and the data of a Float64MultiArray message.

    The message is one of rclpy or rosbags. A dimension is a label and a size.
    """
    dimensions = [(str(d.label), int(d.size)) for d in message.layout.dim]
    return dimensions, np.frombuffer(message.data, dtype=np.float64)


def encode_law(law: Law) -> tuple[Dimensions, FloatArray]:
    """Return a law as a labelled array with one row per polynomial piece.

    A row contains the cam angle (rad) at the start of the piece, and the p + 1 ordinates (m) of its
    Bernstein polynomial of degree p. The first result is the label and the size of each dimension,
    and the second the array, shape (n, p + 2).
    """
    rows = np.column_stack([law.breaks[:-1], law.ordinates.T])
    return [(law.name, rows.shape[0]), (PIECE_LABEL, rows.shape[1])], rows


def decode_law(dimensions: Dimensions, data: FloatArray) -> Law:
    """Return the law that a labelled array of `encode_law` contains.

    Raises
    ------
    RefusedError
        If the array is not a law, or is beyond the limits of this module.
    """
    rows = _shaped(dimensions, data, "law coefficients")
    if dimensions[1][0] != PIECE_LABEL or rows.shape[1] < 2:
        raise RefusedError(
            f"law coefficients: the columns must be {PIECE_LABEL!r}, got {dimensions[1]}"
        )
    if rows.shape[0] > MAX_PIECES or rows.shape[1] > MAX_DEGREE + 2:
        raise RefusedError(
            f"law coefficients: must have at most {MAX_PIECES} pieces of degree {MAX_DEGREE}, got "
            f"{rows.shape[0]} of degree {rows.shape[1] - 2}"
        )
    if not CAM_NAME.fullmatch(dimensions[0][0]):
        label = dimensions[0][0][:80]
        raise RefusedError(f"law coefficients: the label must be a cam's name, got {label!r}")
    if not np.abs(rows[:, 1:]).max() <= MAX_LIFT:
        raise RefusedError(f"law coefficients: lifts must be finite and at most {MAX_LIFT:g} m")
    try:
        law = Law(dimensions[0][0], np.append(rows[:, 0], TURN), rows[:, 1:].T)
        if law.spans.min() < MIN_PIECE_SPAN:
            raise RefusedError(f"a piece must span at least {MIN_PIECE_SPAN:g} rad")
    except CamRigError as error:
        raise RefusedError(f"law coefficients: {error}") from None
    return law


def encode_block(rows: FloatArray) -> tuple[Dimensions, FloatArray]:
    """Return the dimensions and the data of a message with the samples of one tick.

    A tick is the time between two cam states. `rows` has the shape (6, n), with one row per entry
    of `COLUMNS`. The first result is the label and the size of each dimension, and the second are
    the samples.
    """
    return [(BLOCK_LABEL, rows.shape[0]), (SAMPLE_LABEL, rows.shape[1])], rows


def decode_block(dimensions: Dimensions, data: FloatArray) -> FloatArray:
    """Return the samples, shape (6, n), in a labelled array of `encode_block`.

    Raises
    ------
    RefusedError
        If the array does not contain samples in this form, or is beyond the limits of this module.
    """
    rows = _shaped(dimensions, data, "follower samples")
    if dimensions[0] != (BLOCK_LABEL, len(COLUMNS)):
        raise RefusedError(
            f"follower samples: the rows must be {BLOCK_LABEL!r}, got {dimensions[0]}"
        )
    if rows.shape[1] > MAX_SAMPLES:
        raise RefusedError(
            f"follower samples: a tick has at most {MAX_SAMPLES}, got {rows.shape[1]}"
        )
    if not max(rows.max(), -rows.min()) <= MAX_VALUE:
        raise RefusedError(f"follower samples: values must be finite and at most {MAX_VALUE:g}")
    return rows


def block_of(message: Any) -> FloatArray:
    """Return the samples, shape (6, n), in a message of /follower/samples."""
    return decode_block(*array_of(message))


def rig_time(seconds: int, nanoseconds: int) -> int:
    """Convert a time stamp to rig time in ns.

    Raises
    ------
    RefusedError
        If the stamp is invalid.
    """
    if seconds < 0 or nanoseconds >= NS:
        raise RefusedError(f"a stamp must be 0 or later, got {seconds} s and {nanoseconds} ns")
    return seconds * NS + nanoseconds


def stamp_ns(stamp: Any) -> int:
    """Convert a builtin_interfaces/Time message to rig time in ns.

    The message is one of rclpy or rosbags.
    """
    return rig_time(int(stamp.sec), int(stamp.nanosec))


def real_time_factor(value: float) -> float:
    """Return the value of /rig/real_time_factor after a check, 0 for a free run.

    Raises
    ------
    RefusedError
        If the value is not allowed.
    """
    if value != 0.0 and not MIN_FACTOR <= value <= MAX_FACTOR:
        raise RefusedError(
            f"real-time factor must be 0, or between {MIN_FACTOR:g} and {MAX_FACTOR:g}, got "
            f"{value:g}"
        )
    return value


def cam_state_of(message: Any) -> CamState:
    """Return the cam state in a JointState message, whose frame is the cam's name.

    Raises
    ------
    RefusedError
        If the message has other joints, or values that no cam can have.
    """
    cam, count = str(message.header.frame_id), len(message.position)
    if count not in (1, 2) or len(message.velocity) != count or not CAM_NAME.fullmatch(cam):
        raise RefusedError(
            f"cam state: the joints must be {' and '.join(CAM_JOINTS)}, or the first alone, and "
            f"the frame a cam's name, got {count} positions, {len(message.velocity)} velocities "
            f"and frame {cam[:80]!r}"
        )
    time_ns, speed = stamp_ns(message.header.stamp), float(message.velocity[0])
    state = CamState(time_ns, float(message.position[0]), speed, cam)
    require_possible(state)
    return state if count == 1 else _within_turn(state, float(message.position[1]))


def _within_turn(state: CamState, angle: float) -> CamState:
    """Return a cam state whose angle is replaced by the angle within the turn.

    The angle of the state contains all turns and is less accurate. `angle` (rad) is from the second
    joint of the message. Raises RefusedError if the two angles contradict each other.
    """
    if not 0.0 <= angle < TURN:
        raise RefusedError(
            f"cam state: the angle within the turn must be from 0 to below 2π rad, got {angle!r}"
        )
    unwrapped = state.unwrapped
    precise = replace(state, angle=angle, turns=round((unwrapped - angle) / TURN))
    difference, rounding = abs(precise.since(state)), 4.0 * math.ulp(unwrapped)
    if not difference <= ANGLE_TOLERANCE + rounding:
        raise RefusedError(
            f"cam state: θ {unwrapped!r} rad and {angle!r} rad within the turn differ by "
            f"{difference:.3g} rad, more than {ANGLE_TOLERANCE:g} rad"
        )
    return precise


def _shaped(dimensions: Dimensions, data: FloatArray, name: str) -> FloatArray:
    """Return the data of a labelled array in the shape of its dimensions.

    `name` names the array in error messages. Raises RefusedError unless there are two dimensions
    that match the number of data.
    """
    shape = tuple(size for _, size in dimensions)
    if len(shape) != 2 or shape[0] * shape[1] != data.size or data.size == 0:
        raise RefusedError(
            f"{name}: must have two dimensions that match the data, got {shape} for {data.size} "
            "numbers"
        )
    return data.reshape(shape)
