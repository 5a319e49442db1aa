"""One flight over a cam, without the run around it."""

from __future__ import annotations

from cam_rig.dynamics.events.approach import Gap, Hop, landing
from cam_rig.dynamics.events.contact import free_table, law_table
from cam_rig.dynamics.events.free_flight import launched
from cam_rig.dynamics.events.law_table import Cam
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.laws import Law


def land(
    flight: Flight, law: Law, angle: float, speed: float, limit: float, noise: float = 0.0
) -> Gap:
    """Where a flight from a cam angle (rad) on ends; ``noise`` as in `Hop`."""
    launch = launched(free_table(flight.system, arrays=False), flight.start.tolist())
    gap, opening = flight.known or (0.0, 0.0)
    cam = Cam(law_table(law, arrays=False), float(speed), float(angle))
    hop = Hop(launch, cam, bool(flight.known), float(gap), float(opening), noise)
    return landing(hop, limit)
