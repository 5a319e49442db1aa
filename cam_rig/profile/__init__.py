"""The cam's shape: pitch curve and contour."""

from cam_rig.profile.contour import contour, pitch_curve, turn_angles

__all__ = ["contour", "pitch_curve", "turn_angles"]
