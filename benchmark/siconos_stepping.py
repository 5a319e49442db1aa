"""Time stepping by Siconos of one mass that bounces on a cam.

It needs Siconos and numpy, but not cam_rig. It reads JSON from standard input and writes JSON, for
`siconos_bounce`. The coordinate is the gap x, so that the contact x ≥ 0 is fixed. With the lift s
of the cam
m ẍ + c ẋ + k x = −(F₀ + k s + c ṡ + m s̈) + λ.
"""

import json
import sys
from typing import Any

import numpy as np
import siconos.kernel as siconos


def states(given: dict[str, Any], rpm: float) -> list[list[float]]:
    """Return gap (m), rate (m/s) and largest gap (m) of each turn.

    Gap and rate are those at the end of the turn.
    """
    lift, slope = np.array(given["lift"]), np.array(given["slope"])
    count, omega = lift.size - 1, rpm * np.pi / 30.0
    step = 2.0 * np.pi / omega / count
    m, c, k = given["mass"], given["damping"], given["stiffness"]
    # Mean forces in a step, as in the θ scheme with θ = 1/2. The mean of s̈ is the change of ṡ.
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
    load, states = mass.fExt(), []
    for _ in range(given["turns"]):
        greatest = 0.0
        for force in loads.tolist():
            load[0] = force
            stepping.computeOneStep()
            greatest = max(greatest, mass.q()[0])
            stepping.nextStep()
        states.append([mass.q()[0], mass.velocity()[0], greatest])
    return states


def main() -> None:
    """Integrate each requested speed."""
    given = json.load(sys.stdin)
    for rpm in given["rpm"]:
        print(json.dumps([rpm, states(given, rpm)]), flush=True)


main()
