"""Command that compiles the searches for lift-offs and landings with numba, in advance.

The compiled code is stored in the user's cache, so that later runs start without this delay.

Usage: ``python -m cam_rig.dynamics.events``
"""

from __future__ import annotations

import os

import numpy as np

from cam_rig.dynamics.events.backend import COMPILED, VARIABLE
from cam_rig.dynamics.free_masses import TwoMassParameters
from cam_rig.dynamics.interval import Interval
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.dynamics.jump.two_masses import find_two_mass_jump, force_run
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.turn_map import StroboscopicMap
from cam_rig.dynamics.two_mass import Separation, first_lift_off
from cam_rig.laws import Law
from cam_rig.units import NS, TURN


def main() -> None:
    """Compile the event searches and the search for the jump speed.

    Each function is compiled when it is first called, so each follower model does a short run.
    """
    os.environ[VARIABLE] = COMPILED
    ordinates = np.array([[0.0, 0.01], [0.0, 0.01], [0.01, 0.0], [0.01, 0.0]])
    law = Law("smoothstep", np.array([0.0, 0.5 * TURN, TURN]), ordinates)
    one_mass = FollowerParameters(1.0, 1e3, 1.0, 1.0, 1e8)
    OneMassTrajectory(law, one_mass, Interval(0, NS // 10, 0.0, 60.0)).run(None)
    StroboscopicMap(law, one_mass, 60.0).run(1)
    two_masses = TwoMassParameters(0.5, 0.5, 1e6, 1e3, 1.0, 1.0, 1.0)
    Separation(law, two_masses, 60.0).run(0.1)
    StroboscopicMap(law, two_masses, 60.0).run(1)
    first_lift_off(law, two_masses, 60.0, np.zeros(2), 0.1)
    force_run(law, two_masses, 0.1).min_output(60.0)
    find_two_mass_jump(law, two_masses, 0.1)
    rigid_jump(law, one_mass)


if __name__ == "__main__":
    main()
