"""The numbers and the state of the torsional model (eq. 10 of the paper)."""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.dynamics.parameters import FollowerParameters, require_number
from cam_rig.errors import DynamicsError


@dataclass(frozen=True)
class TorsionalParameters:
    """A cam on an elastic shaft behind a flywheel, which holds its speed or has an inertia."""

    follower: FollowerParameters  #: the follower on the cam; its stem is rigid here
    cam_inertia: float  #: I, kg·m²
    shaft_stiffness: float  #: k_s, N·m/rad
    shaft_damping: float = 0.0  #: c_s, N·m·s/rad
    #: I_v, kg·m²; None holds its speed (eq. 10 of the paper, the limit I_v → ∞)
    flywheel_inertia: float | None = None
    #: T, N·m, constant, on a flywheel that has an inertia; `motion.steady_state` finds the one that
    #: holds the mean speed
    motor_torque: float = 0.0

    def __post_init__(self) -> None:
        require_number("cam_inertia", self.cam_inertia, "> 0")
        require_number("shaft_stiffness", self.shaft_stiffness, "> 0")
        require_number("shaft_damping", self.shaft_damping, "≥ 0")
        if self.flywheel_inertia is not None:
            require_number("flywheel_inertia", self.flywheel_inertia, "> 0")
        require_number("motor_torque", self.motor_torque, "of either sign")
        if self.flywheel_inertia is None and self.motor_torque != 0.0:
            raise DynamicsError(
                f"motor_torque is {self.motor_torque!r}; allowed: 0 where the flywheel holds its "
                "speed, so give a flywheel_inertia"
            )

    @property
    def mobility(self) -> float:
        """1/I + 1/I_v, 1/(kg·m²): what a torque in the shaft accelerates."""
        flywheel = 0.0 if self.flywheel_inertia is None else 1.0 / self.flywheel_inertia
        return 1.0 / self.cam_inertia + flywheel

    @property
    def flywheel_acceleration(self) -> tuple[float, float, float]:
        """Weights of ψ, ψ̇ and 1 in θ̈_v, SI; zeros where the flywheel holds its speed."""
        if self.flywheel_inertia is None:
            return 0.0, 0.0, 0.0
        torques = self.shaft_stiffness, self.shaft_damping, self.motor_torque
        k, c, t = (torque / self.flywheel_inertia for torque in torques)
        return k, c, t


@dataclass(frozen=True)
class TorsionalState:
    """Twist and flywheel; lead and even turning apart, a heavy flywheel keeps all its digits."""

    twist: float  #: ψ = θ_c − θ_v, rad
    twist_rate: float  #: rad/s
    flywheel_angle: float  #: of even turning, which the drive sets, rad
    flywheel_speed: float  #: of even turning, rad/s
    lead: float = 0.0  #: by how much a flywheel of finite inertia is ahead of it, rad
    lead_rate: float = 0.0  #: rad/s

    @property
    def cam_angle(self) -> float:
        """θ_c, rad."""
        return self.flywheel_angle + self.lead + self.twist
