"""Data types of the state machine in `runs`, which simulates contact and flight.

`RUN_STATE` is its state, `RunTable` contains its coefficients, and `RunRecord` receives its output:
phases (contact or flight) and events (lift-off or landing). All are arrays and tuples, because the
state machine runs in plain Python or compiled by numba.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.contact import StemContactTable
from cam_rig.dynamics.events.law_table import Cam
from cam_rig.laws.vectors import Records


class RunMode(IntEnum):
    """Mode of the follower: in contact with the cam, or in flight."""

    CONTACT = 0  #: the follower is on the cam
    FLIGHT = 1  #: the follower has lifted off


class EventCode(IntEnum):
    """Kind of an event of the follower: lift-off or landing."""

    LIFT_OFF = 0  #: contact ends
    LANDING = 1  #: the follower meets the cam, also if it rebounds


#: Record of the state of the follower in a run. The record of a phase (contact or flight) is the
#: state at its start together with its end, ``phase_end``.
RUN_STATE = np.dtype(
    [
        ("time", "f8"),  # time since the start of the interval, s
        ("phase_end", "f8"),  # end time of a recorded phase, s; 0 in the state of a run
        ("gap", "f8"),  # gap between follower and cam in flight if ``gap_known`` is True, m
        ("gap_rate", "f8"),  # rate of the gap in flight if ``gap_known`` is True, m/s
        ("initial_step", "f8"),  # change of the cam's velocity ṡ to apply at the start, m/s
        ("jumps_done", "i8"),  # number of velocity jumps of the interval that have been applied
        ("mode", "i8"),  # contact or flight, `RunMode`
        # In contact: (η, η̇) of a follower of two masses, unused for one mass. In flight:
        # (w, ẇ, Y, Ẏ) of two masses or (y, ẏ) of one mass, as in `FreeSystem`. The other numbers
        # are unused.
        ("vector", "f8", (4,)),
        ("gap_known", "?"),  # True if ``gap`` is more accurate than a difference of displacements
        ("has_started", "?"),  # True if ``initial_step`` has been applied
    ],
    align=True,
)
#: Record of a lift-off or a landing.
EVENT = np.dtype(
    [
        ("code", "i8"),  # kind of the event, `EventCode`
        ("time", "f8"),  # time since the start of the interval, s
        ("impulse", "f8"),  # impulse of a landing, N·s; 0 at a lift-off
        ("energy_lost", "f8"),  # energy lost in a landing, J; 0 at a lift-off
    ],
    align=True,
)
#: Record of the numbers of phases (contact or flight) and events (lift-off or landing) in a
#: `RunRecord`.
COUNTS = np.dtype([("phases", "i8"), ("events", "i8")], align=True)


#: Record of a velocity jump: a joint of the law at which the cam's velocity ṡ changes abruptly.
JUMP = np.dtype(
    [
        ("time", "f8"),  # time since the start of the interval, s
        ("step", "f8"),  # change of the cam's velocity ṡ at the joint, m/s
    ],
    align=True,
)
#: Record of a range of cam angles in which a follower of one mass loses contact, because its
#: contact force would be negative.
LOSS = np.dtype(
    [
        ("start", "f8"),  # cam angle at the start of the range, in [0, 2π], rad
        ("end", "f8"),  # cam angle at the end of the range, in [0, 2π], rad
    ],
    align=True,
)


class StemStretch(NamedTuple):
    """Stretch of the stem between contact mass and end mass, and its rate."""

    length: float  #: stretch w, end mass less contact mass displacement, m
    rate: float  #: rate ẇ of the stretch, m/s


class Jumps(NamedTuple):
    """Velocity jumps of a law (jumps of s') that the cam passes in one interval.

    The cam speed is constant in the interval.
    """

    ahead: Records  #: records of `JUMP` in the order of time, ``(n,)``
    duration: float  #: duration of the interval, s
    #: Time (s) from which on the cam angle equals, to rounding, that of a velocity jump at the end
    #: of the interval. Such a jump belongs to the next interval, and so does a lift-off after this
    #: time.
    contact_limit: float


class RunRecord(NamedTuple):
    """Output of an event search: phases (contact or flight) and events."""

    state: Records  #: present state of the follower, one record of `RUN_STATE`, updated in place
    phases: Records  #: phases in the order of time, records of `RUN_STATE`
    events: Records  #: lift-offs and landings, records of `EVENT`, with room for two per phase
    counts: Records  #: numbers of phases and events so far, one record of `COUNTS`


class CamWeights(NamedTuple):
    """Weights of the cam's lift, velocity and acceleration in a linear combination."""

    lift: float  #: weight of s
    velocity: float  #: weight of ṡ
    acceleration: float  #: weight of s̈
    constant: float  #: constant term


class RunTable(NamedTuple):
    """Coefficients of a follower on a cam that turns at constant speed.

    The follower is one rigid mass, or two masses that an elastic stem connects: the contact mass
    at the cam and the end mass. The fields from ``contact`` to ``preload_compression`` are used
    only if ``has_stem`` is True, ``losses`` only if it is False.
    """

    cam: Cam  #: cam and its speed
    free: Records  #: coefficients of the masses in flight, one record of `FREE_SYSTEM`
    jumps: Jumps  #: velocity jumps of the law in the interval
    mass: float  #: contact mass, kg
    #: Weights of the cam's motion in the contact force without vibration, in N per m, m/s and m/s².
    force: CamWeights
    losses: Records  #: angles at which one mass loses contact, records of `LOSS` in their order
    has_stem: bool  #: True for two masses, False for one
    contact: StemContactTable  #: coefficients of the end mass while the contact mass is on the cam
    drive: CamWeights  #: weights of the cam's motion in the acceleration η̈ of the end mass
    end_share: float  #: end mass as a fraction of both masses
    spring_share: float  #: 1 − α, static stem compression as a fraction of the lift
    preload_compression: float  #: compression of the stem by the preload, m
    restitution: float  #: Newton's coefficient of restitution of a landing
    acceleration_rounding: float  #: uncertainty of the gap's acceleration at a lift-off, m/s²
    min_bounce_height: float  #: height of a bounce below which it counts as contact, m
    min_velocity_step: float  #: largest change of ṡ at a joint that counts as rounding, m/s
