"""Followers that have left their cams, as in fig. 11 of the paper."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.two_mass.model import states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.plots.styles import line
from cam_rig.studies.cam_set import CamSet
from cam_rig.units import RPM, TURN

#: The turn shown, counted from rest, and its samples.
SHOWN, POINTS = 3, 3000


def draw(cam_set: CamSet, rpm: float, path: Path) -> None:
    """Roller's place, and its gap to the cam, over one turn at one speed."""
    out, (place, gap) = plt.subplots(
        2, 1, figsize=(9.0, 6.4), sharex=True, height_ratios=[1.4, 1.0], layout="constrained"
    )
    parameters, speed = TwoMassParameters.from_rig(cam_set.rig), rpm * RPM
    times = (SHOWN - 1 + np.linspace(0.0, 1.0, POINTS)) * TURN / speed
    degrees = np.degrees(speed * times) - 360.0 * (SHOWN - 1)
    for i, (cam, law) in enumerate(cam_set.laws.items()):
        course = Separation(law, parameters, speed)
        course.run(SHOWN * TURN / speed)
        roller = states(course, times)[0]
        off = 1e3 * (roller - course.cam(times)[0])
        flights = sum(event.kind == "lift-off" for event in course.events)
        label = f"{cam_set.titles[cam]}: {'stays on' if not flights else 'leaves'}"
        place.plot(degrees, 1e3 * roller, lw=1.5, label=label, **line(i))
        gap.plot(degrees, off, lw=1.3, **line(i))
    place.set(ylabel="roller [mm]", title=f"Turn {SHOWN} from rest at {rpm:g} rpm")
    gap.set(ylabel="gap to the cam [mm]", xlabel="cam angle θ [°]", xlim=(0.0, 360.0))
    gap.set_xticks(range(0, 361, 30))
    for axes in (place, gap):
        axes.grid(alpha=0.25)
    place.legend(fontsize=8.5, handlelength=3.4, loc="lower center")
    out.savefig(path, dpi=130)
    plt.close(out)
