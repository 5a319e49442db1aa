"""The laws of a factorial study: one rise up and down over any angle, and a cam squeezed."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.catalogue import figures
from cam_rig.laws.named import NAMED_RISES, unit_rise
from cam_rig.laws.pieces import joined
from cam_rig.schema import FactorialConfig, load_factorial
from cam_rig.units import TURN

#: A dwell narrower than this (rad) is left out.
MIN_DWELL = 1e-9


def open_factorial(path: Path) -> FactorialConfig:
    """Read a study's file, and refuse rises whose velocity jumps.

    Raises
    ------
    ConfigError : the file is wrong, or a rise's velocity jumps where it joins a dwell
    """
    config = load_factorial(path)
    for key, rises in (("rises", config.rises), ("reference", [config.reference])):
        for rise in rises:
            if figures(rise).continuity < 1 or any(NAMED_RISES[rise].slopes):
                good = [n for n in NAMED_RISES if not any(NAMED_RISES[n].slopes)]
                allowed = ", ".join(n for n in good if figures(n).continuity >= 1)
                raise ConfigError(
                    f"{path}: {key}: is {rise!r}, whose velocity jumps where it joins a dwell; "
                    f"allowed: {allowed}"
                )
    return config


def up_and_down(rise: str, event: float, lift: float, high_dwell: float | None = None) -> Law:
    """Half a low dwell, rise, high dwell, fall, half a low dwell.

    Parameters
    ----------
    event : rad, of the rise and of the fall, at most π
    lift : m
    high_dwell : rad; by default as long as the low one
    """
    steps, columns = unit_rise(rise)
    high = math.pi - event if high_dwell is None else high_dwell
    low = TURN - 2.0 * event - high
    breaks, pieces = [0.0], []
    for height, base, before in ((lift, 0.0, 0.5 * low), (-lift, lift, high)):
        if before > MIN_DWELL:
            breaks.append(breaks[-1] + before)
            pieces.append(np.array([base]))
        start = breaks[-1]
        breaks += [start + event * u for u in steps[1:]]
        pieces += [base + height * column for column in columns]
    if low > MIN_DWELL:
        breaks.append(TURN)
        pieces.append(np.array([0.0]))
    breaks[-1] = TURN
    return Law(f"{rise} over {math.degrees(event):.4g}°", np.array(breaks), joined(pieces))


def as_gentle(rise: str, reference: str, event: float) -> float:
    """The event angle (rad) over which a rise accelerates as the reference does over ``event``."""
    ratio = figures(rise).peak_acceleration / figures(reference).peak_acceleration
    return event * math.sqrt(ratio)


def squeezed(law: Law, span: float) -> Law:
    """A cam's whole turn pressed into ``span`` rad, and its lift at θ = 0 held for the rest."""
    if span > TURN - MIN_DWELL:
        return law
    rest = np.full_like(law.ordinates[:, :1], law.ordinates[0, 0])
    breaks = np.append(law.breaks * (span / TURN), TURN)
    name = f"{law.name} in {math.degrees(span):.4g}°"
    return Law(name, breaks, np.hstack([law.ordinates, rest]))
