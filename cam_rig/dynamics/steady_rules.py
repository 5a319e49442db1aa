"""Rules that decide if a motion is steady, each with its tolerance and the reason for it.

A turn of the cam is *steady* if the turns after it repeat it. A motion in contact is linear, so its
steady turn is computed exactly and needs no rule. For a follower that leaves the cam, turns are
computed until a rule is satisfied. The rules differ because their users need different accuracy or
have different data:

======================  ===========================================================================
user                    rule
======================  ===========================================================================
scene, sweep, bag       the first `transient_turns` of each speed are omitted (`is_steady`)
levels of the paper     the second turn from rest (`LEVEL_TURNS`)
campaign, design        the remaining change is below `FORCE_RTOL` of the contact force
order spectrum          the state repeats after up to `MAX_PERIOD_TURNS` turns to `STATE_RTOL`
fit of a rig            the turn returns to its start to `RETURN_RTOL`
bounce map              states one period apart agree to `PERIOD_RTOL`
lab sheets              after `LAB_TURNS` turns from rest
======================  ===========================================================================
"""

from __future__ import annotations

#: Number of turns by which a tick (one time step of a run) may start too early and still count as
#: steady. Rig time is in whole nanoseconds, which are 1e-9 of a turn at 60 rpm and 1e-6 of a turn
#: at 60 000 rpm.
TURN_ATOL = 1e-6

#: Number of turns from rest for a sound level, which is that of the last turn. Levels are printed
#: to 0.1 dB. A rigid follower that ends the first turn on the cam repeats it exactly. Landings damp
#: the motion of a follower that ends it in flight.
LEVEL_TURNS = 2

#: Relative tolerance of a steady contact force, which is printed to six digits. The force is steady
#: if no further turn changes it by more.
FORCE_RTOL = 1e-6
#: Number of turns after which a motion that has not become steady is evaluated and reported as not
#: steady. For comparison: at a damping ratio of 1 % and nine vibrations of the stem per turn, 1e-6
#: of a vibration is left after 25 turns.
MAX_FORCE_TURNS = 40

#: Tolerance of a steady state, relative to the lift (displacement) and to the largest velocity of
#: the law. Spectra show eight digits, and an error in the time of a landing changes their
#: amplitudes by the same order.
STATE_RTOL = 1e-8
#: Largest period of a motion, in turns, for which a spectrum is computed.
MAX_PERIOD_TURNS = 8
#: Numbers of turns from rest after which a periodic motion is searched for, tried in this order.
#: Most motions are periodic after few turns.
SPECTRUM_TURNS = (4, 16, 64)

#: Tolerance for the difference of the states before and after a turn that counts as steady,
#: relative to the turn and to the scale of its vibration. Derivatives of a turn are differences
#: over 1e-6 of that scale, so their relative error is 1e-5.
RETURN_RTOL = 1e-11
#: Numbers of turns from rest after which the states before and after a turn are compared, tried in
#: this order.
RETURN_TURNS = (2, 4, 8, 16, 32)

#: Relative tolerance for the difference of two states one period apart. It allows for the rounding
#: errors of hundreds of turns, which grow with each landing.
PERIOD_RTOL = 1e-9

#: Number of turns from rest after which lab sheets (worksheets for students) evaluate a motion. The
#: simulated test bench of a student shows four digits.
LAB_TURNS = 6


def is_steady(turns: float, transient_turns: float) -> bool:
    """Return True if a tick starts after the turns that are omitted at each speed.

    A tick is one time step of a run. `turns` is the number of turns from the change to the present
    cam speed to the start of the tick. `transient_turns` is the number of omitted turns.
    """
    return turns > transient_turns - TURN_ATOL
