"""A cam that speeds up or slows down evenly: θ(t) = θ₀ + ω t + α t²/2, as exact as a steady one.

Along a ramp the law is a piecewise polynomial of time, of twice its degree. Written as a law of its
own, on a substitute cam that turns steadily, every model takes it as it takes any other.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import TypeVar

import numpy as np

from cam_rig.dynamics.interval import (
    Block,
    Event,
    FollowerState,
    Interval,
    ended,
    require_joined,
    speed_change,
)
from cam_rig.dynamics.parameters import require_turning
from cam_rig.dynamics.velocity_jumps import SLACK, short_of_velocity_jump
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import compose, product
from cam_rig.units import TURN, FloatArray

#: The ramp takes no more than this much of the substitute cam's turn; the rest is never reached.
USED = 0.875 * TURN

P = TypeVar("P")

Advance = Callable[[Law, P, FollowerState | None, Interval, int], tuple[FollowerState, Block]]
#: A model at one speed. Last comes by how much ṡ is more than where the state before ended, m/s.
AtOneSpeed = Callable[
    [Law, P, FollowerState | None, Interval, int, float], tuple[FollowerState, Block]
]


def with_ramps(
    advance: AtOneSpeed[P], require: Callable[[Law], None] = lambda _law: None
) -> Advance[P]:
    """The model for intervals whose speed changes too, and from one to the next.

    ``require`` refuses a law that the model cannot take.
    """

    @wraps(advance)
    def through(
        law: Law, parameters: P, state: FollowerState | None, interval: Interval, sample_rate: int
    ) -> tuple[FollowerState, Block]:
        require(law)  # here, where it is not yet a ramp's substitute
        require_turning(interval.mean_speed)
        require_joined(state, interval)
        change = speed_change(state, interval)  # it acts before a velocity jump there
        step = law.at(short_of_velocity_jump(law, interval.angle))[1] * change if change else 0.0
        if interval.acceleration == 0.0:
            end, block = advance(law, parameters, state, interval, sample_rate, step)
            return ended(end, interval), block
        blocks, events = list[Block](), list[Event]()
        for part in interval.split(TURN):
            ramped, steady = substitute(law, part)
            state, block = advance(ramped, parameters, state, steady, sample_rate, step)
            blocks.append(block)
            events += [  # with the angle of the cam in place of the substitute's, which is a time
                event._replace(angle=part.unwrapped_at(event.angle / steady.speed))
                for event in block.events
            ]
            step = 0.0
        assert state is not None
        rows = np.hstack([block.rows for block in blocks])
        return ended(state, interval), Block(interval, rows, tuple(events))

    return through


@lru_cache(maxsize=64)
def substitute(law: Law, interval: Interval) -> tuple[Law, Interval]:
    """The law of a cam that, turning steadily from angle 0, moves the follower as the ramp does."""
    duration = interval.duration
    speed = min(interval.angle_at(duration) - interval.angle, USED) / duration
    stretches = _stretches(law, interval)
    motion = np.stack([_piece(law, interval, *stretch) for stretch in stretches], axis=2)
    motion /= (speed ** np.arange(3.0))[:, None, None]
    breaks = [0.0, *(speed * end for _, end, *_ in stretches[:-1]), speed * duration]
    # What follows the ramp is read at its start alone, as the ramp's end.
    after = np.repeat(motion[:, -1:, -1:], motion.shape[1], axis=1)
    motion = np.concatenate([motion, after], axis=2)
    steady = Interval(interval.start_ns, interval.stop_ns, 0.0, speed)
    velocity_jumps = _velocity_jumps(law, interval, stretches, speed)
    return law.substitute(np.array([*breaks, TURN]), motion, velocity_jumps), steady


#: Begin and end (s), piece of the law and where that begins (rad).
Stretch = tuple[float, float, int, float]


def _velocity_jumps(
    law: Law, interval: Interval, stretches: list[Stretch], speed: float
) -> dict[int, float]:
    """Jumps of the substitute's s': those of the law's own that are met, at the speed there."""
    return {
        i: law.velocity_jumps[piece] * interval.speed_at(begin) / speed
        for i, (begin, _, piece, low) in enumerate(stretches)
        if piece in law.velocity_jumps
        and (begin > 0.0 or interval.angle - low <= SLACK)
        and interval.speed_at(begin) > 0.0  # a cam at rest has no velocity to jump
    }


def _stretches(law: Law, interval: Interval) -> list[Stretch]:
    """The pieces that the ramp passes; a jump of s' at its end is the next interval's."""
    found, begin = [], 0.0
    reached = interval.angle_at(interval.duration)
    index = law.piece(interval.angle)
    low = law.joints[index]
    while begin < interval.duration:
        span = float(law.spans[index])
        end = min(interval.time_at(low + span), interval.duration)
        if (index + 1) % law.spans.size in law.velocity_jumps and reached - (low + span) <= SLACK:
            end = interval.duration
        if end > begin:
            found.append((begin, end, index, low))
            begin = end
        index, low = (index + 1) % law.spans.size, low + span
    return found


def _piece(
    law: Law, interval: Interval, begin: float, end: float, index: int, low: float
) -> FloatArray:
    """S, ṡ and s̈ as polynomials of time in one stretch, ``(3, 2p + 3)``."""
    span, length = float(law.spans[index]), end - begin
    speeds = np.array([interval.speed_at(begin), interval.speed_at(end)])
    first, last = ((interval.angle_at(t) - low) / span for t in (begin, end))
    u = np.clip([first, first + 0.5 * speeds[0] / span * length, last], 0.0, 1.0)
    s, slope, bend = compose(law.motion[:, :, index].T, u).T[:, :, None]
    squares = np.array([speeds[0] ** 2, speeds[0] * speeds[1], speeds[1] ** 2])
    top = s.shape[0] + 1
    rows = (
        bernstein.elevate(s, top),
        bernstein.elevate(product(speeds, slope), top),
        product(squares, bend) + interval.acceleration * bernstein.elevate(slope, top),
    )
    return np.stack([row[:, 0] for row in rows])
