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

#: Cam whose published regression of the level is used for the calibration.
CAM = "poly345"


def study() -> SoundFit:
    """Fit the radiation to the published levels of `CAM` at the speeds of the scene."""
    scene = cam_rig.load_scene(SCENE)
    rpm = np.array(scene.scene.schedule.speeds.numbers)
    return cam_rig.fit_sound(np.column_stack([rpm, scene.published_levels(CAM, rpm)]), scene)


def table(result: SoundFit) -> Table:
    """Return a table of published and fitted level by speed."""
    return Table(
        f"Published noise of {result.scene.titles[result.cam]}, and the rig fitted to it",
        "cam speed [rpm] :g | published [dB] :.2f | fitted [dB] :.2f | difference [dB] :+.2f",
        [(row.rpm, row.measured, row.fitted, row.difference) for row in result.levels],
    )


@styled
def figure(result: SoundFit) -> Figure:
    """Draw published and fitted level against speed."""
    out = empty(3.3)
    axes = out.subplots()
    rpm = [row.rpm for row in result.levels]
    style = line(result.cam)
    axes.plot(rpm, [row.measured for row in result.levels], label="published", **style)
    axes.plot(rpm, [row.fitted for row in result.levels], "o", ms=4, color="0.3", label="fitted")
    axes.set(xlabel=CAM_SPEED, ylabel=LEVEL, title=result.scene.titles[result.cam])
    axes.legend(frameon=False)
    return out


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment. With --write the rig file of the scene is updated."""
    command = parser(__doc__)
    command.add_argument("--write", action="store_true", help="write into the rig file")
    chosen = command.parse_args(argv)
    result = study()
    publish(chosen.out, [table(result)], {"calibrate": figure(result)}, result.summary())
    if chosen.write:
        print(f"written to {result.write()}")


if __name__ == "__main__":
    main()
