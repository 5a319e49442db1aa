"""Motion laws: every family becomes one periodic Bernstein piecewise polynomial."""

from cam_rig.laws.cam import build_law
from cam_rig.laws.law import Law

__all__ = ["Law", "build_law"]
