"""One mass bouncing on a cam, by Siconos' time stepping; needs Siconos and numpy, not the rig.

Reads JSON from standard input and writes JSON, for `siconos_bounce`. The coordinate is the gap x,
so that the contact x ≥ 0 does not move: with the cam's lift s
m ẍ + c ẋ + k x = −(F₀ + k s + c ṡ + m s̈) + λ.
"""

import json
import sys
from typing import Any

import numpy as np
import siconos.kernel as siconos


def states(given: dict[str, Any], rpm: float) -> list[list[float]]:
    """Gap (m) and its rate (m/s) at the end of each turn, and each turn's greatest gap."""
    lift, slope = np.array(given["lift"]), np.array(given["slope"])
    count, omega = lift.size - 1, rpm * np.pi / 30.0
    step = 2.0 * np.pi / omega / count
    m, c, k = given["mass"], given["damping"], given["stiffness"]
    # Over a step the forces' means: the scheme's own, with theta 1/2, and of s̈ the change of ṡ.
    mean = 0.5 * (lift[1:] + lift[:-1]), np.diff(lift) / step, omega * np.diff(slope) / step
    loads = -(given["preload"] + k * mean[0] + c * mean[1] + m * mean[2])
    mass = siconos.LagrangianLinearTIDS([0.0], [0.0], [[m]])
    mass.setKPtr(np.array([[k]]))
    mass.setCPtr(np.array([[c]]))
    mass.setFExtPtr(np.zeros(1))
    law = siconos.NewtonImpactNSL(given["restitution"])
    contact = siconos.Interaction(law, siconos.LagrangianLinearTIR([[1.0]]))
    system = siconos.NonSmoothDynamicalSystem(0.0, 1e9)
    system.insertDynamicalSystem(mass)
    system.link(contact, mass)
    stepping = siconos.TimeStepping(
        system, siconos.TimeDiscretisation(0.0, step), siconos.MoreauJeanOSI(0.5), siconos.LCP()
    )
    load, found = mass.fExt(), []
    for _ in range(given["turns"]):
        greatest = 0.0
        for one in loads.tolist():
            load[0] = one
            stepping.computeOneStep()
            greatest = max(greatest, mass.q()[0])
            stepping.nextStep()
        found.append([mass.q()[0], mass.velocity()[0], greatest])
    return found


def main() -> None:
    """Each speed asked for."""
    given = json.load(sys.stdin)
    for rpm in given["rpm"]:
        print(json.dumps([rpm, states(given, rpm)]), flush=True)


main()
