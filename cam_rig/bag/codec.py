"""Laws and blocks as labelled arrays: what std_msgs/Float64MultiArray carries.

No message class enters here, so nodes (rclpy) and analysis (rosbags) share it. A dimension is a
(label, size) pair, outermost first.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cam_rig.dynamics import COLUMNS, FloatArray
from cam_rig.errors import BagError
from cam_rig.laws import TURN, Law

Dimensions = list[tuple[str, int]]

#: A piece's row: the cam angle where it begins, then its Bernstein ordinates.
PIECE_LABEL = "break_rad, ordinates_m"
BLOCK_LABEL = ", ".join(COLUMNS)
SAMPLE_LABEL = "sample"


def array_of(message: Any) -> tuple[Dimensions, FloatArray]:
    """Dimensions and data of a Float64MultiArray, of rclpy or of rosbags alike."""
    dimensions = [(str(d.label), int(d.size)) for d in message.layout.dim]
    return dimensions, np.frombuffer(message.data, dtype=np.float64)


def encode_law(law: Law) -> tuple[Dimensions, FloatArray]:
    """A law as ``(n, p + 2)``: one row a piece, labelled with the cam's name."""
    rows = np.column_stack([law.breaks[:-1], law.ordinates.T])
    return [(law.name, rows.shape[0]), (PIECE_LABEL, rows.shape[1])], rows


def decode_law(dimensions: Dimensions, data: FloatArray) -> Law:
    """The law of an array made by `encode_law`.

    Raises
    ------
    BagError : the layout is another
    LawError : the numbers are no law
    """
    rows = _shaped(dimensions, data, "law coefficients")
    if dimensions[1][0] != PIECE_LABEL or rows.shape[1] < 2:
        raise BagError(f"law coefficients: dimension {dimensions[1]}; allowed: {PIECE_LABEL!r}")
    return Law(dimensions[0][0], np.append(rows[:, 0], TURN), rows[:, 1:].T)


def encode_block(rows: FloatArray) -> tuple[Dimensions, FloatArray]:
    """A block of samples as it is, ``(6, n)``: a row each for `COLUMNS`."""
    return [(BLOCK_LABEL, rows.shape[0]), (SAMPLE_LABEL, rows.shape[1])], rows


def decode_block(dimensions: Dimensions, data: FloatArray) -> FloatArray:
    """Rows ``(6, n)`` of an array made by `encode_block`.

    Raises
    ------
    BagError : the layout is another
    """
    rows = _shaped(dimensions, data, "follower samples")
    if dimensions[0] != (BLOCK_LABEL, len(COLUMNS)):
        raise BagError(f"follower samples: dimension {dimensions[0]}; allowed: {BLOCK_LABEL!r}")
    return rows


def _shaped(dimensions: Dimensions, data: FloatArray, what: str) -> FloatArray:
    shape = tuple(size for _, size in dimensions)
    if len(shape) != 2 or shape[0] * shape[1] != data.size or data.size == 0:
        raise BagError(f"{what}: {data.size} numbers in dimensions {shape}; allowed: two that fit")
    return data.reshape(shape)
