"""The limits of the paper's models: a flywheel of any inertia, a stem of any number of masses."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cam_rig.dynamics import TwoMassParameters
from cam_rig.paper.stem.study import BAR, SHOWN_CAM, Stem, StemResult, stem_turn
from cam_rig.show.figure import (
    ACROSS,
    CAM_SPEED,
    empty,
    logarithmic,
    series,
    series_marker,
    styled,
    wrapped,
)
from cam_rig.show.looks import title_of
from cam_rig.show.tables import typeset_number
from cam_rig.units import RPM

#: Elements of the stem whose frequencies, and whose least force is shown, and what they are called.
COUNTS = (1, 2, 3, 5, 9, 17, 33)
SHOWN = {1.0: "two masses", 2.0: "three masses", BAR: "bar"}
#: Speeds of the least force, rpm.
SPEEDS = np.arange(150.0, 440.0, 2.0)


@styled
def figure(found: StemResult) -> Figure:
    """Error of the natural frequencies over the elements, and least contact force over speed."""
    cam_set = found.cam_set
    law, title = cam_set.laws[SHOWN_CAM], title_of(cam_set.titles, SHOWN_CAM)
    follower = TwoMassParameters.from_rig(cam_set.rig)
    out = empty(3.3)
    left, right = out.subplots(1, 2)
    limits = Stem(follower, BAR).natural_frequencies(3)
    for mode in range(3):
        counts = [n for n in COUNTS if n > mode]
        rates = [Stem(follower, float(n)).natural_frequencies(mode + 1)[mode] for n in counts]
        error = 100.0 * np.abs(np.array(rates) / limits[mode] - 1.0)
        left.loglog(counts, error, label=f"frequency {mode + 1}", **series_marker(mode))
    left.loglog(COUNTS, 10.0 / np.array(COUNTS) ** 2.0, color="0.4", lw=0.8, ls=":", label="∝ 1/n²")
    logarithmic(left.xaxis, left.yaxis)
    left.set(title="Error of the natural frequencies", xlabel="elements n", ylabel="error [%]")
    for i, (elements, name) in enumerate(SHOWN.items()):
        least = [
            stem_turn(law, Stem(follower, elements), speed * RPM).force.min() for speed in SPEEDS
        ]
        right.plot(SPEEDS, least, label=name, **series(i))
    right.axhline(0.0, color="0.3", lw=0.9)
    right.set(
        title=wrapped(f"Least contact force, {title}", ACROSS // 2),
        xlabel=CAM_SPEED,
        ylabel="force [N]",
    )
    right.set_ylim(-15.0, None)
    for axes in (left, right):
        axes.legend(frameon=False)
    out.suptitle(f"Stem of {typeset_number(follower.stem_stiffness, '.3g')} N/m, steady state")
    return out
