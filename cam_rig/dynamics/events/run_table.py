"""Data of a run's state machine (`runs`): its state, its record and its table."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics.events.contact import StemContactTable
from cam_rig.dynamics.events.law_table import Cam
from cam_rig.laws.vectors import Records


class RunMode(IntEnum):
    """Mode of the follower in a run: on the cam or in flight."""

    CONTACT = 0
    FLIGHT = 1


class EventCode(IntEnum):
    """Kind of an event that a run records."""

    LIFT_OFF = 0
    LANDING = 1


#: State of a run. A recorded phase is the state at its start together with ``phase_end``.
RUN_STATE = np.dtype(
    [
        ("time", "f8"),  # since the start of the interval, s
        ("phase_end", "f8"),  # end of a recorded phase, s; 0 in the state of a run
        ("gap", "f8"),  # gap in flight if ``gap_known``, m
        ("gap_rate", "f8"),  # its rate, m/s
        ("initial_step", "f8"),  # step of ṡ to apply when the run starts, m/s
        ("jumps_done", "i8"),  # number of velocity jumps of the interval that are applied
        ("mode", "i8"),  # `RunMode`
        # Contact: (η, η̇) of two masses, unused of one. Flight: (w, ẇ, Y, Ẏ) of two masses, (y, ẏ)
        # of one, as in `FreeSystem`. Numbers beyond these are unused.
        ("vector", "f8", (4,)),
        ("gap_known", "?"),  # True if ``gap`` is better than a difference of displacements
        ("has_started", "?"),  # True if ``initial_step`` has been applied
    ],
    align=True,
)
#: A lift-off or a landing.
EVENT = np.dtype(
    [
        ("code", "i8"),  # `EventCode`
        ("time", "f8"),  # since the start of the interval, s
        ("impulse", "f8"),  # N·s, 0 at a lift-off
        ("energy_lost", "f8"),  # J, 0 at a lift-off
    ],
    align=True,
)
#: Numbers of phases and events in a record.
COUNTS = np.dtype([("phases", "i8"), ("events", "i8")], align=True)


#: A velocity jump.
JUMP = np.dtype(
    [
        ("time", "f8"),  # since the start of the interval, s
        ("step", "f8"),  # step of ṡ, m/s
    ],
    align=True,
)
#: An interval of the turn in which the cam would have to pull one mass.
LOSS = np.dtype(
    [
        ("start", "f8"),  # cam angle in [0, 2π], rad
        ("end", "f8"),  # rad
    ],
    align=True,
)


class StemStretch(NamedTuple):
    """Stretch of the stem between contact mass and end mass, and its rate."""

    length: float  #: w, m
    rate: float  #: ẇ, m/s


class Jumps(NamedTuple):
    """Velocity jumps of the law that belong to an interval of the run."""

    ahead: Records  #: records of `JUMP` in the order of time, ``(n,)``
    duration: float  #: duration of the interval, s
    #: Time (s) from which the cam is within rounding of a velocity jump of the next interval. A
    #: lift-off from then on belongs to that interval.
    contact_limit: float


class RunRecord(NamedTuple):
    """Output of a run's event search: phases and events."""

    state: Records  #: one record of `RUN_STATE`, updated in place
    phases: Records  #: records of `RUN_STATE`
    events: Records  #: records of `EVENT`, room for two per phase
    counts: Records  #: one record of `COUNTS`


class CamWeights(NamedTuple):
    """Weights of the cam's lift, velocity and acceleration in a linear combination."""

    lift: float
    velocity: float
    acceleration: float
    constant: float


class RunTable(NamedTuple):
    """Coefficients of a run: a follower on a cam that turns at constant speed.

    The follower is one rigid mass, or two masses with a stem. The fields from ``contact`` to
    ``preload_compression`` are used only if ``has_stem`` is True, ``losses`` only if it is False.
    """

    cam: Cam
    free: Records  #: one record of `FREE_SYSTEM`
    jumps: Jumps
    mass: float  #: contact mass, kg
    force: CamWeights  #: contact force without vibration, N per m, m/s and m/s², and N
    losses: Records  #: records of `LOSS` in the order of the angle
    has_stem: bool  #: True for two masses
    contact: StemContactTable  #: end mass while the roller is on the cam
    drive: CamWeights  #: weights of the cam's motion in η̈
    end_share: float  #: end mass as a fraction of both masses
    spring_share: float  #: 1 − α, static stem compression as a fraction of the lift
    preload_compression: float  #: compression of the stem by the preload, m
    restitution: float  #: Newton's coefficient of a landing
    acceleration_rounding: float  #: as in `FlightOverCam`, m/s²
    min_bounce_height: float  #: height of a bounce below which it counts as contact, m
    min_velocity_step: float  #: step of ṡ up to which it counts as rounding, m/s
