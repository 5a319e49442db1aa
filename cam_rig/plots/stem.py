"""Stems of more and more masses: convergence to a bar, and the least contact force over speed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cam_rig.laws import Law
from cam_rig.plots.figures import CAM_SPEED, colour, empty, line, marker, write
from cam_rig.studies.stem.chain import BAR, Stem
from cam_rig.studies.stem.steady import stem_turn
from cam_rig.tables import number
from cam_rig.units import RPM

#: Elements of the left panel, and of the right one with what they are called.
LEFT = (1, 2, 3, 5, 9, 17, 33)
RIGHT = {1.0: "two masses", 2.0: "three masses", BAR: "bar"}
#: Speeds of the right panel, rpm.
SPEEDS = np.arange(150.0, 440.0, 2.0)


def draw(law: Law, title: str, stem: Stem, path: Path) -> None:
    """Write the figure to a file, of any kind that matplotlib knows by the suffix."""
    out = empty(11.0, 4.4)
    left, right = out.subplots(1, 2)
    follower = stem.follower
    limits = Stem(follower, BAR).natural_frequencies(3)
    for mode in range(3):
        counts = [n for n in LEFT if n > mode]
        found = [Stem(follower, float(n)).natural_frequencies(mode + 1)[mode] for n in counts]
        error = 100.0 * np.abs(np.array(found) / limits[mode] - 1.0)
        left.loglog(counts, error, lw=1.2, label=f"frequency {mode + 1}", **marker(mode))
    left.loglog(LEFT, 10.0 / np.array(LEFT) ** 2.0, color="0.4", lw=0.8, ls=":", label="∝ 1/n²")
    left.set(title="Error of the natural frequencies", xlabel="elements n", ylabel="error [%]")
    for i, (elements, name) in enumerate(RIGHT.items()):
        least = [
            stem_turn(law, Stem(follower, elements), speed * RPM).force.min() for speed in SPEEDS
        ]
        right.plot(SPEEDS, least, lw=1.4, label=name, **line(i))
    right.axhline(0.0, color=colour(3), lw=0.8)
    right.set(title=f"Least contact force, {title}", xlabel=CAM_SPEED, ylabel="force [N]")
    right.set_ylim(-15.0, None)
    for axes in (left, right):
        axes.grid(alpha=0.25)
        axes.legend(frameon=False)
    out.suptitle(f"Stem of {number(follower.stem_stiffness, '.3g')} N/m, steady state")
    write(out, path)
