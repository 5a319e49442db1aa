"""Colours, 0xRRGGBBAA as Rerun has them: Okabe and Ito's for curves, Tol's for cams.

Both are told apart by the colour-blind. No two curves share one, so a curve that is missing in a
picture is missed.
"""

from __future__ import annotations

from cam_rig.simulation.scene import LoadedScene

LIFT, LAW, VELOCITY, ACCELERATION = 0x56B4E9FF, 0x0072B2FF, 0x009E73FF, 0xCC79A7FF
FORCE, LANDING, LIFT_OFF, TWIST = 0xE69F00FF, 0xD55E00FF, 0x882255FF, 0x332288FF
LEVEL, SPEED, BANDS = 0x117733FF, 0xAA4499FF, 0x44AA99FF
GREY, FOLLOWER, GAP, ZERO = 0x999999FF, 0x8C6D31FF, 0xFF0000FF, 0x661100FF
#: One a cam, in the order of the scene: in the viewer and in every plot.
CAMS = (0x4477AAFF, 0xEE6677FF, 0x228833FF, 0xCCBB44FF, 0x66CCEEFF, 0xAA3377FF)


def of_cam(loaded: LoadedScene, cam: str) -> int:
    """The colour of a cam of the scene."""
    return CAMS[list(loaded.cams).index(cam) % len(CAMS)]


def web(colour: int) -> str:
    """The colour as ``#rrggbb``, without its opacity."""
    return f"#{colour >> 8:06x}"
