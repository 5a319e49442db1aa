"""Speed fluctuation of a flywheel of finite inertia, compared with eq. 10.

In eq. 10 of the paper the speed of the flywheel is constant, which corresponds to an infinite
inertia I_v, and there is no preload. Here a constant torque, the mean of the load, drives a
flywheel of inertia I_v, which drives the cam through the shaft.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

import cam_rig
from cam_rig.dynamics.torsional.model import from_rig
from cam_rig.dynamics.vibration import FlywheelTurn, flywheel_turn
from cam_rig.show.figure import colour, empty, line, logarithmic, styled
from cam_rig.units import RPM
from examples.paper.common import CAMS, RIG, Table, load_laws, parser, publish, titles

#: Inertias (kg·m²) of the flywheel. Infinity corresponds to eq. 10.
INERTIAS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0, math.inf)
#: Inertia (kg·m²) for the comparison of all cams: assumed, a steel disc of 300 mm.
SHOWN = 0.2
#: Speed (rpm), which is below all jump speeds of table 2.
SPEED_RPM = 300.0
#: Cam whose results are listed for all inertias.
SHOWN_CAM = "poly345"


@dataclass(frozen=True)
class Flywheels:
    """Steady turns for each cam and flywheel, and the twist of eq. 10 without preload.

    `turns` is by cam and inertia (kg·m²). `without_preload` is the peak-to-peak twist (rad) by cam
    at constant speed, as eq. 10 is printed.
    """

    turns: dict[tuple[str, float], FlywheelTurn]
    without_preload: dict[str, float]


def study(cams: Sequence[str] = CAMS) -> Flywheels:
    """Compute the steady turn of every cam with every flywheel, at `SPEED_RPM`."""
    rig, laws, speed = cam_rig.load_rig(RIG), load_laws(cams), SPEED_RPM * RPM
    shaft, slack = from_rig(rig), from_rig(rig.with_follower(preload=0.0))
    return Flywheels(
        {
            (cam, inertia): flywheel_turn(law, shaft, inertia, speed)
            for cam, law in laws.items()
            for inertia in INERTIAS
        },
        {cam: flywheel_turn(law, slack, math.inf, speed).twist for cam, law in laws.items()},
    )


def tables(result: Flywheels) -> list[Table]:
    """Return a table of one cam for all inertias, and of all cams with one flywheel."""
    names = titles(result.without_preload)
    over_inertia = [
        (
            f"{inertia:g}".replace("inf", "∞"),
            100.0 * turn.fluctuation,
            100.0 * turn.formula,
            100.0 * turn.cam_fluctuation,
            math.degrees(turn.twist),
            turn.torque,
        )
        for (cam, inertia), turn in result.turns.items()
        if cam == SHOWN_CAM
    ]
    over_cams = [
        (
            names[cam],
            100.0 * result.turns[cam, SHOWN].fluctuation,
            math.degrees(result.turns[cam, SHOWN].twist),
            math.degrees(result.turns[cam, math.inf].twist),
            math.degrees(bare),
        )
        for cam, bare in result.without_preload.items()
    ]
    return [
        Table(
            f"Fluctuation of the speed over the flywheel's inertia, {names[SHOWN_CAM]}, "
            f"{SPEED_RPM:g} rpm",
            "inertia of the flywheel [kg·m²] | flywheel [%] :.2f | "
            "by ΔE/(Iω²) [%] :.2f | cam [%] :.2f | twist [°] :.4f | "
            "motor torque [N·m] :.4f",
            over_inertia,
            "Fluctuation: (fastest − slowest)/mean speed. The last row is eq. 10 of the paper.\n"
            "ΔE/(Iω²): the handbook's formula, shaft rigid, I of flywheel and cam.",
        ),
        Table(
            f"All laws behind a flywheel of {SHOWN:g} kg·m² (assumed), {SPEED_RPM:g} rpm",
            "law | flywheel [%] :.2f | twist [°] :.4f | twist at held speed [°] :.4f | "
            "the same without preload [°] :.4f",
            over_cams,
            "Held speed without preload is eq. 10 as it is printed; the rig adds its preload "
            "to it.",
        ),
    ]


@styled
def figure(result: Flywheels) -> Figure:
    """Draw fluctuation of the speed and twist of the shaft against the inertia."""
    out = empty(3.3)
    left, right = out.subplots(1, 2)
    for cam, title in titles(result.without_preload).items():
        finite = [result.turns[cam, inertia] for inertia in INERTIAS if inertia < math.inf]
        inertia = np.array([turn.inertia for turn in finite])
        fluctuation = 100.0 * np.array([turn.fluctuation for turn in finite])
        left.loglog(inertia, fluctuation, label=title, **line(cam))
        right.semilogx(inertia, np.degrees([turn.twist for turn in finite]), **line(cam))
        held = math.degrees(result.turns[cam, math.inf].twist)
        right.axhline(held, color=colour(cam), lw=0.8, ls=":")
    left.set(title="(fastest − slowest)/mean speed", ylabel="fluctuation [%]")
    right.set(title="Twist of the shaft", ylabel="twist, peak to peak [°]")
    right.plot([], [], color="0.3", lw=0.8, ls=":", label="the speed held, eq. 10")
    for axes in (left, right):
        axes.set_xlabel("inertia of the flywheel [kg·m²]")
    logarithmic(left.xaxis, left.yaxis, right.xaxis)
    out.legend(loc="outside lower center", ncols=3, frameon=False)
    out.suptitle(f"Driven by a constant torque, {SPEED_RPM:g} rpm")
    return out


def summary(result: Flywheels) -> list[str]:
    """Return fluctuation and twist of `SHOWN_CAM` as text."""
    turn, held = result.turns[SHOWN_CAM, SHOWN], result.turns[SHOWN_CAM, math.inf]
    bare = result.without_preload[SHOWN_CAM]
    return [
        f"{SHOWN_CAM} behind {SHOWN:g} kg·m²: fluctuation {turn.fluctuation:.2%}, "
        f"twist {math.degrees(turn.twist):.4f}°",
        f"{SHOWN_CAM} at the held speed: twist {math.degrees(held.twist):.4f}°, "
        f"{math.degrees(bare):.4f}° without preload",
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, print its tables and write its figure."""
    out = parser(__doc__).parse_args(argv).out
    result = study()
    publish(out, tables(result), {"flywheel": figure(result)}, summary(result))


if __name__ == "__main__":
    main()
