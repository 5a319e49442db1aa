"""How long the arrow of a contact force is drawn."""

from __future__ import annotations

import numpy as np

from cam_rig.dynamics.contact_force import force_weights
from cam_rig.profile import turn_angles
from cam_rig.simulation.loaded_scene import LoadedScene

#: The arrow of the greatest contact force, as a share of the follower's reach.
ARROW = 0.5


def max_contact_force(loaded: LoadedScene, cam: str, speed: float) -> float:
    """Maximum contact force (N) of a follower that stays in contact at a speed (rad/s)."""
    follower, angle = loaded.follower, turn_angles(720)
    motion = np.stack([loaded.laws[cam](angle, order) for order in range(3)])
    return follower.preload + float((force_weights(follower, speed) @ motion).max())
