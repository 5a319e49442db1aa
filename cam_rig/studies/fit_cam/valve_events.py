"""Cam angles at which a valve opens and closes, and the duration between them.

They are those at which the lift of the valve passes a checking height.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from cam_rig.laws import Law
from cam_rig.laws.passages import passages
from cam_rig.units import TURN

#: Default lifts of the valve (m) at which the cam angles of its opening and closing are listed: 1
#: mm, usual in metric tables, and 0.050 in.
CHECKING_HEIGHTS = (1e-3, 0.05 * 0.0254)


@dataclass(frozen=True)
class ValveTrain:
    """Valve train that a cam drives.

    Parameters
    ----------
    rocker_ratio
        Lift of the valve per lift of the cam follower.
    lash
        Clearance of the valve in m, measured at the valve.
    checking_heights
        Lifts of the valve in m at which opening and closing are reported.
    """

    rocker_ratio: float = 1.0
    lash: float = 0.0
    checking_heights: tuple[float, ...] = CHECKING_HEIGHTS


@dataclass(frozen=True)
class ValveEvent:
    """Opening and closing of a valve at a checking height.

    `height` is that lift of the valve in m. The cam angles `opening` and `closing` and the
    `duration` between them are in rad. `lobe_centre` is the middle between opening and closing.
    """

    height: float
    opening: float
    closing: float
    duration: float
    lobe_centre: float


def valve_events(law: Law, train: ValveTrain) -> tuple[ValveEvent, ...]:
    """Return the valve events at each checking height, by height and angle.

    Heights that the valve does not reach are omitted. The lift of the valve is ratio · s - lash.

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("poly345"))  # 18 mm
    >>> event = valve_events(law, ValveTrain(checking_heights=(9e-3,)))[0]
    >>> round(event.duration, 6) == round(event.closing - event.opening, 6)
    True
    """
    events = []
    for height in train.checking_heights:
        level = (height + train.lash) / (train.rocker_ratio * law.lift)
        crossings = passages(law, law.lift, [level])
        for opening, closing in zip(crossings, crossings[1:] + crossings[:1], strict=True):
            if opening.rising and not closing.rising:
                duration = (closing.angle - opening.angle) % TURN
                centre = (opening.angle + 0.5 * duration) % TURN
                events.append(ValveEvent(height, opening.angle, closing.angle, duration, centre))
    return tuple(events)


def explain_missing_events(law: Law, train: ValveTrain) -> Iterator[str]:
    """Yield a sentence if the valve does not open, or misses some checking heights."""
    lift = train.rocker_ratio * law.lift - train.lash
    if lift <= 0.0:
        yield (
            f"The valve does not open: the lash of {train.lash * 1e3:.4g} mm is not less than the "
            f"lift of {train.rocker_ratio * law.lift * 1e3:.4g} mm."
        )
        return
    unreached = [f"{1e3 * height:.4g} mm" for height in train.checking_heights if height >= lift]
    if unreached:
        yield (
            f"No valve event at {' and '.join(unreached)}: the valve opens by {lift * 1e3:.4g} mm "
            "at most."
        )
