"""The cam angle of an encoder: its whole turns counted, and turning forwards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cam_rig.errors import BagError
from cam_rig.simulation.measured_run import Signal
from cam_rig.units import TURN

#: An angle within one turn may exceed it by so much of it: rounding.
WITHIN = 1.0 + 1e-6


def forward_turns(angle: Signal, where: str) -> tuple[Signal, list[str]]:
    """The angle with all its turns, rising; and what was done, a sentence each.

    Raises
    ------
    BagError : it does not turn, or so fast that its turns cannot be counted
    """
    notes = []
    value = angle.value
    inside = bool(np.ptp(value) <= TURN * WITHIN and np.abs(np.diff(value)).max() > 0.5 * TURN)
    if inside:
        steps = np.abs(np.remainder(np.diff(value) + 0.5 * TURN, TURN) - 0.5 * TURN)
        if np.median(steps) > 0.4 * TURN:
            raise BagError(
                f"{where}: the angle steps by {np.degrees(np.median(steps)):.0f}° from reading to "
                "reading; allowed: less than half a turn, else its turns cannot be counted, so "
                "record more readings"
            )
        value = np.unwrap(value)
        notes.append("The angle is given within one turn: its turns were counted.")
        if len(angle.gaps()):
            notes.append("Whole turns within a gap of the angle are not known.")
    if value[-1] < value[0]:
        value = -value
        notes.append("The angle falls: it was turned over, so the cam turns the other way.")
    turned = value[-1] - value[0]
    if turned < 0.5 * float(np.abs(np.diff(value)).sum()) or turned <= 0.0:
        raise BagError(
            f"{where}: the angle goes from {np.degrees(value[0]):.6g}° to "
            f"{np.degrees(value[-1]):.6g}° and not one way; allowed: a cam that turns"
        )
    return replace(angle, value=value), notes
