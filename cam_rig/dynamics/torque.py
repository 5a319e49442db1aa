"""The torque that turns the cam."""

from __future__ import annotations

from cam_rig.dynamics.kinetostatic import state_at
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.laws import Law


def shaft_torque(law: Law, parameters: FollowerParameters, angle: float, speed: float) -> float:
    """Torque in N·m that holds ``speed`` (rad/s) at ``angle`` (rad): F s' (eq. 8 of the paper).

    Power in is power out, T ω = F ṡ. F is the kinetostatic contact force, none where the cam
    would have to pull.
    """
    force = state_at(law, parameters, angle, speed).contact_force
    return max(force, 0.0) * law.at(angle)[1] + 0.0  # no negative zero: it is another message
