"""Calibration of the rig's sound on the paper's published noise of one cam.

Gain and corner of the radiation are fitted to eq. 21 of the paper, the regression of the polynomial
3-4-5. The other two published curves are then predictions. There are two parameters per rig, and no
parameter per cam.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

import cam_rig
from cam_rig.show.figure import CAM_SPEED, LEVEL, empty, line, styled
from cam_rig.studies.fit_sound.study import SoundFit
from examples.paper.common import SCENE, Table, parser, publish

#: Cam whose published regression calibrates the rig.
CAM = "poly345"


def study() -> SoundFit:
    """Fit the radiation to the published levels of `CAM` at the speeds of the scene."""
    scene = cam_rig.load_scene(SCENE)
    rpm = np.array(scene.scene.program.speeds.numbers)
    return cam_rig.fit_sound(np.column_stack([rpm, scene.published_levels(CAM, rpm)]), scene)


def table(found: SoundFit) -> Table:
    """Return published and fitted level by speed."""
    return Table(
        f"Published noise of {found.scene.titles[found.cam]}, and the rig fitted to it",
        "cam speed [rpm] :g | published [dB] :.2f | fitted [dB] :.2f | difference [dB] :+.2f",
        [(row.rpm, row.measured, row.fitted, row.difference) for row in found.levels],
    )


@styled
def figure(found: SoundFit) -> Figure:
    """Draw published and fitted level over the speed."""
    out = empty(3.3)
    axes = out.subplots()
    rpm = [row.rpm for row in found.levels]
    style = line(found.cam)
    axes.plot(rpm, [row.measured for row in found.levels], label="published", **style)
    axes.plot(rpm, [row.fitted for row in found.levels], "o", ms=4, color="0.3", label="fitted")
    axes.set(xlabel=CAM_SPEED, ylabel=LEVEL, title=found.scene.titles[found.cam])
    axes.legend(frameon=False)
    return out


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment; with --write the numbers go into the rig file of the scene."""
    command = parser(__doc__)
    command.add_argument("--write", action="store_true", help="write into the rig file")
    chosen = command.parse_args(argv)
    found = study()
    publish(chosen.out, [table(found)], {"calibrate": figure(found)}, found.summary())
    if chosen.write:
        print(f"written to {found.write()}")


if __name__ == "__main__":
    main()
