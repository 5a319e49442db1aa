"""The event angle of a cam: how far it turns in a rise, and in a fall."""

from __future__ import annotations

from collections.abc import Iterable

from cam_rig.errors import ConfigError
from cam_rig.schema import CamConfig
from cam_rig.units import TURN


def event_of(cams: Iterable[CamConfig]) -> float:
    """The angle (rad) of a rise, of the first cam that has dwells."""
    for cam in cams:
        moving = [s.span.si for s in cam.segments if s.law != "dwell"]
        if len(moving) < len(cam.segments):
            return 0.5 * sum(moving)
    raise ConfigError("no cam has a dwell; needed: one, its rises have the event angle")


def with_event(cam: CamConfig, event: float) -> CamConfig:
    """A cam with every rise and fall over ``event`` rad and equal dwells; a whole turn stays.

    Parts of a rise share its angle as they did.
    """
    moving = [s for s in cam.segments if s.law != "dwell"]
    dwells = [s for s in cam.segments if s.law == "dwell"]
    if not dwells:
        return cam
    factors = {
        id(s): f
        for group, f in (
            (moving, 2.0 * event / sum(s.span.si for s in moving)),
            (dwells, (TURN - 2.0 * event) / sum(s.span.si for s in dwells)),
        )
        for s in group
    }
    segments = []
    for s in cam.segments:
        value = s.span.numbers[0] * factors[id(s)]
        span = s.span.model_copy(update={s.span.origin: value})
        segments.append(s.model_copy(update={"span": span}))
    return cam.model_copy(update={"segments": segments})
