"""The limits of the paper's models: a flywheel of any inertia, a stem of any number of masses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cam_rig.laws import Law
from cam_rig.plots.figures import CAM_SPEED, colour, empty, line, series, series_marker, write
from cam_rig.studies.flywheel.fluctuation import FlywheelStudy
from cam_rig.studies.stem.chain import BAR, Stem
from cam_rig.studies.stem.steady import stem_turn
from cam_rig.tables import number
from cam_rig.units import RPM

INERTIA = "inertia of the flywheel [kg·m²]"
#: Elements of the stem whose frequencies, and whose least force is shown, and what they are called.
COUNTS = (1, 2, 3, 5, 9, 17, 33)
SHOWN = {1.0: "two masses", 2.0: "three masses", BAR: "bar"}
#: Speeds of the least force, rpm.
SPEEDS = np.arange(150.0, 440.0, 2.0)


def draw_flywheel(study: FlywheelStudy, titles: Mapping[str, str], path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    out = empty(11.0, 4.4)
    left, right = out.subplots(1, 2)
    for cam, turns in study.turns.items():
        finite = [turn for turn in turns if math.isfinite(turn.inertia)]
        inertia = np.array([turn.inertia for turn in finite])
        shown = 100.0 * np.array([turn.fluctuation for turn in finite])
        left.loglog(inertia, shown, lw=1.5, label=titles[cam], **line(cam))
        twist = np.degrees([turn.twist for turn in finite])
        right.semilogx(inertia, twist, lw=1.5, **line(cam))
        limit = math.degrees(study.at(cam, math.inf).twist)
        right.axhline(limit, color=colour(cam), lw=0.8, ls=":")
    left.set(title="Flywheel: (fastest − slowest)/mean speed", ylabel="fluctuation [%]")
    right.set(title="Shaft (dotted: the speed held, eq. 10)", ylabel="twist, peak to peak [°]")
    for axes in (left, right):
        axes.set_xlabel(INERTIA)
        axes.grid(alpha=0.25, which="both")
    out.legend(loc="outside lower center", ncols=5, frameon=False, handlelength=3.4)
    out.suptitle(f"Driven by a constant torque, {study.rpm:g} rpm")
    write(out, path)


def draw_stem(law: Law, title: str, stem: Stem, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    out = empty(11.0, 4.4)
    left, right = out.subplots(1, 2)
    follower = stem.follower
    limits = Stem(follower, BAR).natural_frequencies(3)
    for mode in range(3):
        counts = [n for n in COUNTS if n > mode]
        found = [Stem(follower, float(n)).natural_frequencies(mode + 1)[mode] for n in counts]
        error = 100.0 * np.abs(np.array(found) / limits[mode] - 1.0)
        left.loglog(counts, error, lw=1.2, label=f"frequency {mode + 1}", **series_marker(mode))
    left.loglog(COUNTS, 10.0 / np.array(COUNTS) ** 2.0, color="0.4", lw=0.8, ls=":", label="∝ 1/n²")
    left.set(title="Error of the natural frequencies", xlabel="elements n", ylabel="error [%]")
    for i, (elements, name) in enumerate(SHOWN.items()):
        least = [
            stem_turn(law, Stem(follower, elements), speed * RPM).force.min() for speed in SPEEDS
        ]
        right.plot(SPEEDS, least, lw=1.4, label=name, **series(i))
    right.axhline(0.0, color="0.3", lw=0.9)
    right.set(title=f"Least contact force, {title}", xlabel=CAM_SPEED, ylabel="force [N]")
    right.set_ylim(-15.0, None)
    for axes in (left, right):
        axes.grid(alpha=0.25)
        axes.legend(frameon=False)
    out.suptitle(f"Stem of {number(follower.stem_stiffness, '.3g')} N/m, steady state")
    write(out, path)
