"""Shape of a cam for each type of follower: contour, curvature, checks, cutter path."""

from cam_rig.profile.contact import turn_angles
from cam_rig.profile.disc import Contour, Disc, contours, contours_at, discs

__all__ = ["Contour", "Disc", "contours", "contours_at", "discs", "turn_angles"]
