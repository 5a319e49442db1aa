"""Motion laws, each as one periodic piecewise polynomial in Bernstein form."""

from cam_rig.laws.cam import build_law
from cam_rig.laws.law import Law

__all__ = ["Law", "build_law"]
