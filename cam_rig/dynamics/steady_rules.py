"""When a motion counts as steady: every rule, with its tolerance and the reason for it.

A turn is *steady* if the turns after it repeat it. A motion in contact is linear, so its steady
turn is found exactly and needs no rule. A follower that leaves the cam is turned until a rule
holds. The rules differ because their users need different accuracy, or see different data:

======================  ===========================================================================
user                    rule
======================  ===========================================================================
scene, sweep, bag       the first `settle_turns` of each speed are left out (`is_settled`)
levels of the paper     the second turn from rest (`LEVEL_TURNS`)
campaign, design        the change still to come is below `FORCE_RTOL` of the contact force
order spectrum          the state repeats after up to `MAX_PERIOD_TURNS` turns to `STATE_RTOL`
fit of a rig            the turn returns to its start to `RETURN_RTOL`
bounce map              states one period apart agree to `PERIOD_RTOL`
lab sheets              after `LAB_TURNS` turns from rest
======================  ===========================================================================
"""

from __future__ import annotations

#: Fraction of a turn by which a tick may start early and still count as settled: rig time is in
#: whole nanoseconds, which are 1e-9 of a turn at 60 rpm and 1e-6 at 60 000 rpm.
TURN_ATOL = 1e-6

#: Turns from rest of which the last gives a level. Levels are printed to 0.1 dB. A rigid follower
#: that ends the first turn on the cam repeats it exactly, and one in flight is damped by landings.
LEVEL_TURNS = 2

#: Relative tolerance of the contact force: the turns to come change it by less. Measures are
#: printed to six digits.
FORCE_RTOL = 1e-6
#: Turns after which a motion that has not become steady is measured and reported as unsettled.
#: A damping ratio of 1 % leaves 1e-6 after 25 turns if the stem vibrates nine times per turn.
MAX_FORCE_TURNS = 40

#: Tolerance of a state, relative to the lift and to the largest law velocity: spectra show eight
#: digits, and the order of a landing's amplitude is that of its time.
STATE_RTOL = 1e-8
#: Largest period of a motion of which a spectrum is computed, in turns.
MAX_PERIOD_TURNS = 8
#: Turns from rest before a period is looked for, tried in this order: most motions need few.
SPECTRUM_TURNS = (4, 16, 64)

#: Tolerance of a returning turn, relative to the turn and to the scale of its vibration. Slopes of
#: a turn are differences over 1e-6 of that scale, so their relative error is 1e-5.
RETURN_RTOL = 1e-11
#: Turns from rest before a returning turn is expected, tried in this order.
RETURN_TURNS = (2, 4, 8, 16, 32)

#: Relative tolerance of states one period apart, in a run of hundreds of exact turns whose rounding
#: grows with each landing.
PERIOD_RTOL = 1e-9

#: Turns from rest after which lab sheets read a motion: a student's bench shows four digits.
LAB_TURNS = 6


def is_settled(turns: float, settle_turns: float) -> bool:
    """Return True if a tick starts after the turns that are left out at each speed.

    `turns` is the number of turns from the start of the speed to the start of the tick.
    """
    return turns > settle_turns - TURN_ATOL
