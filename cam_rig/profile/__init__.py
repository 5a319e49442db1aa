"""The cam's shape under each kind of follower: contour, curvature, checks, cutter path."""

from cam_rig.profile.contour import Contour, contours, contours_at
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.motion import turn_angles

__all__ = ["Contour", "Disc", "contours", "contours_at", "discs", "turn_angles"]
