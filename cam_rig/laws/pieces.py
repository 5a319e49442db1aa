"""Bernstein pieces that follow one another, before they are a cam's law."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.laws import bernstein

#: Breakpoints, and one column of ordinates between each two.
Pieces = tuple[list[float], list[FloatArray]]
#: A cut nearer to a breakpoint than this fraction of its piece is made at the breakpoint.
NEAR = 1e-12


def turned_to_zero(pieces: Pieces, turn: float) -> Pieces:
    """One turn of pieces that begins anywhere, as one that begins at angle 0.

    The breakpoints may begin at any angle and end a turn later. The piece at angle 0 is cut
    there, and what lies outside of [0, turn] comes round again on the other side.
    """
    moved: list[tuple[float, float, FloatArray]] = []
    breaks, columns = pieces
    for start, stop, column in zip(breaks[:-1], breaks[1:], columns, strict=True):
        shift = turn * (start // turn)
        a, b = start - shift, stop - shift
        u = (turn - a) / (b - a)
        if u > 1.0 - NEAR:
            moved.append((a, min(b, turn), column))
        elif u < NEAR:
            moved.append((0.0, b - turn, column))
        else:
            before, after = bernstein.split(column, u)
            moved += [(a, turn, before), (0.0, b - turn, after)]
    moved.sort(key=lambda piece: piece[0])
    starts = [0.0, *(a for a, _, _ in moved[1:])]
    return [*starts, turn], [column for _, _, column in moved]


def joined(columns: list[FloatArray]) -> FloatArray:
    """``(p + 1, n)`` ordinates of n columns, written with the highest degree p among them."""
    degree = max(column.size - 1 for column in columns)
    return np.stack([bernstein.elevate(column, degree) for column in columns], axis=1)
