"""The cam angles at which a law passes given heights, from roots, not from samples."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from cam_rig.laws import Law, bernstein
from cam_rig.laws.peaks import extremes
from cam_rig.units import TURN

#: Heights that are timed, as fractions of the lift.
LEVELS = (0.01, 0.50, 0.99)
#: Nearer to a height than this fraction of the lift a joint is on it, and two passages nearer than
#: this (rad) are one.
ON, SAME = 1e-12, 1e-7
#: So far (rad) on either side of a passage the law is above and below.
BESIDE = 1e-5


@dataclass(frozen=True)
class TimedEvent:
    """A passage through a height.

    Parameters
    ----------
    level : the height over the lowest place, as a fraction of the lift
    angle : rad, cam angle of the passage
    rising : whether the follower goes up there
    slope : m/rad, s' there
    """

    level: float
    angle: float
    rising: bool
    slope: float


def events(law: Law, lift: float, levels: Iterable[float] = LEVELS) -> tuple[TimedEvent, ...]:
    """Every passage of a turn through the heights ``levels``, in the order of the cam angle.

    Parameters
    ----------
    lift : m, that the levels are fractions of: the one of the cam's file
    levels : heights above the lowest place of the law; one that is not reached has no passage

    Examples
    --------
    The 3-4-5 rises over 117.5° from 31.25° on and is halfway up in the middle of that:

    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    >>> [round(np.degrees(event.angle).item(), 4) for event in events(law, 0.05, [0.5])]
    [90.0, 270.0]
    """
    low = extremes(law, 0)[0].value
    found = []
    for level in levels:
        height = low + level * lift
        for angle in _passages(law, height, ON * lift):
            before, after = law(np.array([angle - BESIDE, angle + BESIDE])) - height
            if before * after < 0.0:
                slope = float(law(angle, 1))
                found.append(TimedEvent(level, angle, bool(after > before), slope))
    return tuple(sorted(found, key=lambda event: event.angle))


def _passages(law: Law, height: float, on: float) -> list[float]:
    """Cam angles in [0, 2π) where s may pass a height (m): roots inside of pieces, and joints."""
    above = law.ordinates - height
    found: list[float] = []
    for i, (start, span) in enumerate(zip(law.breaks[:-1], law.spans, strict=True)):
        if abs(above[0, i]) <= on:
            found.append(float(start))
        found += [float(start + span * u) for u in bernstein.crossings(above[:, i])]
    once: list[float] = []
    for angle in sorted(float(angle) % TURN for angle in found):
        if not once or angle - once[-1] > SAME:
            once.append(angle)
    return once
