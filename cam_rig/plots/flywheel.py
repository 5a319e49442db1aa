"""Speed fluctuation and twist over the flywheel's inertia, with eq. 10's limit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cam_rig.plots.figures import colour, empty, line, write
from cam_rig.studies.flywheel.fluctuation import FlywheelStudy

INERTIA = "inertia of the flywheel [kg·m²]"


def draw(study: FlywheelStudy, titles: Mapping[str, str], path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    out = empty(11.0, 4.4)
    left, right = out.subplots(1, 2)
    for i, (cam, turns) in enumerate(study.turns.items()):
        finite = [turn for turn in turns if math.isfinite(turn.inertia)]
        inertia = np.array([turn.inertia for turn in finite])
        shown = 100.0 * np.array([turn.fluctuation for turn in finite])
        left.loglog(inertia, shown, lw=1.5, label=titles[cam], **line(i))
        twist = np.degrees([turn.twist for turn in finite])
        right.semilogx(inertia, twist, lw=1.5, **line(i))
        limit = math.degrees(study.at(cam, math.inf).twist)
        right.axhline(limit, color=colour(i), lw=0.8, ls=":")
    left.set(title="Flywheel: (fastest − slowest)/mean speed", ylabel="fluctuation [%]")
    right.set(title="Shaft (dotted: the speed held, eq. 10)", ylabel="twist, peak to peak [°]")
    for axes in (left, right):
        axes.set_xlabel(INERTIA)
        axes.grid(alpha=0.25, which="both")
    out.legend(loc="outside lower center", ncols=5, frameon=False, handlelength=3.4)
    out.suptitle(f"Driven by a constant torque, {study.rpm:g} rpm")
    write(out, path)
