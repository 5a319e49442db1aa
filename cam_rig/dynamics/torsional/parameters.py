"""The numbers and the state of the torsional model (eq. 10 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.dynamics.input_limits import require_number
from cam_rig.dynamics.parameters import FollowerParameters


@dataclass(frozen=True)
class TorsionalParameters:
    """A cam on an elastic shaft, behind a flywheel that holds its speed (the paper's case).

    Parameters
    ----------
    follower : the follower on the cam; its stem is rigid here
    cam_inertia : I, kg·m²
    shaft_stiffness : k_s, N·m/rad
    shaft_damping : c_s, N·m·s/rad
    """

    follower: FollowerParameters
    cam_inertia: float
    shaft_stiffness: float
    shaft_damping: float = 0.0

    def __post_init__(self) -> None:
        require_number("cam_inertia", self.cam_inertia, "> 0")
        require_number("shaft_stiffness", self.shaft_stiffness, "> 0")
        require_number("shaft_damping", self.shaft_damping, "≥ 0")

    @property
    def mobility(self) -> float:
        """1/I, 1/(kg·m²): what a torque in the shaft accelerates."""
        return 1.0 / self.cam_inertia


@dataclass(frozen=True)
class TorsionalState:
    """Twist ψ = θ_c − θ_v (rad), its rate (rad/s), flywheel's angle (rad) and speed (rad/s)."""

    twist: float
    twist_rate: float
    flywheel_angle: float
    flywheel_speed: float
