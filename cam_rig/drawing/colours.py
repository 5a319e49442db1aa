"""The one palette of plots and viewer, 0xRRGGBBAA as Rerun has it.

Okabe and Ito's colours for curves, Tol's for cams (`cam_rig.drawing.cam_looks`): both are told
apart by the colour-blind. In the viewer no two curves share one, so a curve that is missing there
is missed.
"""

from __future__ import annotations

SKY_BLUE, BLUE, GREEN, PURPLE = 0x56B4E9FF, 0x0072B2FF, 0x009E73FF, 0xCC79A7FF
ORANGE, VERMILION, BLACK, LIGHT_GREY = 0xE69F00FF, 0xD55E00FF, 0x000000FF, 0xCCCCCCFF

LIFT, LAW, VELOCITY, ACCELERATION = SKY_BLUE, 0x00426BFF, GREEN, PURPLE
FORCE, LANDING, LIFT_OFF, TWIST = ORANGE, VERMILION, 0x882255FF, 0x332288FF
LEVEL, SPEED, BANDS = 0x117733FF, 0xAA4499FF, 0x44AA99FF
GREY, FOLLOWER, GAP, ZERO = 0x999999FF, 0x8C6D31FF, 0xFF0000FF, 0x661100FF
#: Behind curves, where the follower is off the cam.
FLIGHT = 0xF2DADAFF
#: On paper: s to s''', the discs of a cam, their pitch curve, and what may not be passed.
DERIVATIVES = (BLUE, GREEN, VERMILION, BLACK)
DISCS, PITCH_CURVE, LIMIT = (BLUE, VERMILION), GREEN, PURPLE


def web(colour: int) -> str:
    """The colour as ``#rrggbb``, without its opacity.

    Examples
    --------
    >>> web(BLUE)
    '#0072b2'
    """
    return f"#{colour >> 8:06x}"


def tint(colour: int, share: float = 0.25) -> int:
    """A colour as it is seen when so much of it lies on white, opaque.

    Examples
    --------
    >>> web(tint(BLUE))
    '#bfdcec'
    """
    parts = (colour >> shift & 255 for shift in (24, 16, 8))
    mixed = bytes(round(255 + share * (part - 255)) for part in parts)
    return int.from_bytes(mixed + b"\xff", "big")
