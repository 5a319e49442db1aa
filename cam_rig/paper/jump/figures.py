"""Loss of contact above the jump speed, as in fig. 11 of the paper."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass.trajectory import Separation, states
from cam_rig.laws.cam import CamSet
from cam_rig.show.figure import CAM_ANGLE, empty, line, styled, turn_axis
from cam_rig.show.looks import title_of
from cam_rig.units import RPM, TURN

#: The turn shown, counted from rest, and its samples.
SHOWN, POINTS = 3, 3000


@styled
def figure(cam_set: CamSet, rpm: float) -> Figure:
    """Displacement of the roller, and its gap to the cam, over one turn at one speed (rpm)."""
    out = empty(4.8)
    place, gap = out.subplots(2, 1, sharex=True, height_ratios=[1.4, 1.0])
    parameters, speed = TwoMassParameters.from_rig(cam_set.rig), rpm * RPM
    times = (SHOWN - 1 + np.linspace(0.0, 1.0, POINTS)) * TURN / speed
    degrees = np.degrees(speed * times) - 360.0 * (SHOWN - 1)
    for cam, law in cam_set.laws.items():
        course = Separation(law, parameters, speed)
        course.run(SHOWN * TURN / speed)
        roller = states(course, times)[0]
        off = 1e3 * (roller - course.cam(times)[0])
        lift_offs = sum(event.kind == "lift-off" for event in course.events)
        contact = "contact lost" if lift_offs else "contact kept"
        label = f"{title_of(cam_set.titles, cam)}: {contact}"
        place.plot(degrees, 1e3 * roller, label=label, **line(cam))
        gap.plot(degrees, off, **line(cam))
    place.set(ylabel="displacement of the roller [mm]")
    place.set(title=f"Turn {SHOWN} from rest at {rpm:g} rpm")
    gap.set(ylabel="gap to the cam [mm]", xlabel=CAM_ANGLE)
    for axes in (place, gap):
        turn_axis(axes, 30)
    place.legend(loc="lower center")
    return out
