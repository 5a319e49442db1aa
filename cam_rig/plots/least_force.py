"""The least contact force of one cam over its speed, with its jump speed."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.plots.styles import colour
from cam_rig.studies.jump.search import force_run
from cam_rig.units import RPM

#: Speeds of the curve.
POINTS = 300


def figure(law: Law, parameters: TwoMassParameters, duration: float | None, jump: float) -> Figure:
    """Speeds to 8 % above ``jump`` (rpm), of runs of ``duration`` s from rest, or steady: None."""
    out = Figure(figsize=(8.0, 4.4), layout="constrained")
    axes = out.subplots()
    rpm = np.linspace(0.35 * jump, 1.08 * jump, POINTS)
    least = force_run(law, parameters, duration).least(rpm * RPM)
    axes.plot(rpm, least, color=colour(0), lw=1.6)
    axes.plot(jump, 0.0, "o", color=colour(0), label=f"leaves the cam at {jump:.2f} rpm")
    axes.axhline(0.0, color="0.3", lw=0.9)
    when = "in steady state" if duration is None else f"of {duration:g} s from rest"
    axes.set(
        xlabel="cam speed [rpm]",
        ylabel="least contact force [N]",
        title=f"{law.name}: least contact force of a run {when}",
        xlim=(rpm[0], rpm[-1]),
    )
    axes.grid(alpha=0.3)
    axes.legend(loc="lower left")
    return out
