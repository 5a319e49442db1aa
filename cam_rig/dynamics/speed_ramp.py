"""Speed ramps θ(t) = θ₀ + ω t + α t²/2 of the cam, solved by models for constant speed.

Along a ramp the lift is a piecewise polynomial of time, of twice the degree of the law. It is
written as the law of a substitute cam that turns at constant speed and gives the follower the same
motion in time. Every model can then solve it like any other law.
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
    add_cam_state,
    require_continuation,
    speed_change,
)
from cam_rig.dynamics.parameters import require_turning
from cam_rig.dynamics.velocity_jumps import JOINT_ATOL_RAD, step_before_velocity_jump
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import compose, product
from cam_rig.units import TURN, FloatArray

#: Largest angle (rad) by which the substitute cam turns in place of the cam on a speed ramp. The
#: rest of its turn is never reached.
MAX_SUBSTITUTE_ANGLE = 0.875 * TURN

#: Type of the parameters of a follower model.
P = TypeVar("P")

#: Function ``advance`` of a follower model, see `cam_rig.dynamics.Model`.
Advance = Callable[[Law, P, FollowerState | None, Interval, int], tuple[FollowerState, Block]]
#: Function ``advance`` of a follower model for constant cam speed. Its additional last argument is
#: the abrupt change of the cam's velocity ṡ (m/s) since the previous state.
AtOneSpeed = Callable[
    [Law, P, FollowerState | None, Interval, int, float], tuple[FollowerState, Block]
]


def with_ramps(
    advance: AtOneSpeed[P], require: Callable[[Law], None] = lambda _law: None
) -> Advance[P]:
    """Extend a follower model for constant cam speed to ramps and changes of the speed.

    ``advance`` computes the motion in an interval of constant speed. The returned function computes
    it in any interval. ``require`` raises a `DynamicsError` for a law that the model cannot solve.
    """

    @wraps(advance)
    def through(
        law: Law, parameters: P, state: FollowerState | None, interval: Interval, sample_rate: int
    ) -> tuple[FollowerState, Block]:
        require(law)  # before it is replaced by a substitute law
        require_turning(interval.mean_speed)
        require_continuation(state, interval)
        change = speed_change(state, interval)  # it acts before a velocity jump at this angle
        step = law.at(step_before_velocity_jump(law, interval.angle))[1] * change if change else 0.0
        if interval.acceleration == 0.0:
            end, block = advance(law, parameters, state, interval, sample_rate, step)
            return add_cam_state(end, interval), block
        blocks, events = list[Block](), list[Event]()
        for part in interval.split(TURN):
            ramped, steady = substitute(law, part)
            state, block = advance(ramped, parameters, state, steady, sample_rate, step)
            blocks.append(block)
            events += [  # convert the angle of the substitute cam to the angle of the cam
                event._replace(angle=part.unwrapped_at(event.angle / steady.speed))
                for event in block.events
            ]
            step = 0.0
        assert state is not None
        rows = np.hstack([block.rows for block in blocks])
        return add_cam_state(state, interval), Block(interval, rows, tuple(events))

    return through


@lru_cache(maxsize=64)
def substitute(law: Law, interval: Interval) -> tuple[Law, Interval]:
    """Return a law and an interval of constant speed that replace a speed ramp.

    A cam with the substitute law gives the follower the same motion in time as ``law`` on the ramp
    ``interval``. It starts at angle 0.
    """
    duration = interval.duration
    speed = min(interval.angle_at(duration) - interval.angle, MAX_SUBSTITUTE_ANGLE) / duration
    stretches = _stretches(law, interval)
    motion = np.stack([_piece(law, interval, *stretch) for stretch in stretches], axis=2)
    motion /= (speed ** np.arange(3.0))[:, None, None]
    breaks = [0.0, *(speed * end for _, end, *_ in stretches[:-1]), speed * duration]
    # The piece after the ramp is evaluated at its start only, as the end of the ramp.
    after = np.repeat(motion[:, -1:, -1:], motion.shape[1], axis=1)
    motion = np.concatenate([motion, after], axis=2)
    steady = Interval(interval.start_ns, interval.stop_ns, 0.0, speed)
    velocity_jumps = _velocity_jumps(law, interval, stretches, speed)
    return law.substitute(np.array([*breaks, TURN]), motion, velocity_jumps), steady


#: Passage of the cam over one piece of the law on a speed ramp: start time (s), end time (s), index
#: of the piece, and cam angle at the start of the piece (rad).
Stretch = tuple[float, float, int, float]


def _velocity_jumps(
    law: Law, interval: Interval, stretches: list[Stretch], speed: float
) -> dict[int, float]:
    """Return the jumps of the slope s' of a substitute law, by the index of its piece.

    A cam with the substitute law at the constant speed ``speed`` (rad/s) replaces the cam with
    ``law`` on the speed ramp ``interval``. The pieces of the substitute law are ``stretches``. The
    jumps correspond to the velocity jumps of ``law`` that the cam passes on the ramp, at the cam
    speed there.
    """
    return {
        i: law.velocity_jumps[piece] * interval.speed_at(start) / speed
        for i, (start, _, piece, low) in enumerate(stretches)
        if piece in law.velocity_jumps
        and (start > 0.0 or interval.angle - low <= JOINT_ATOL_RAD)
        and interval.speed_at(start) > 0.0  # at rest the velocity cannot jump
    }


def _stretches(law: Law, interval: Interval) -> list[Stretch]:
    """Return the passages of the cam over pieces of the law on a speed ramp, in order.

    A velocity jump of the law at the end of the ramp belongs to the next interval and is not
    passed.
    """
    stretches, start = [], 0.0
    end_angle = interval.angle_at(interval.duration)
    index = law.piece(interval.angle)
    low = law.joints[index]
    while start < interval.duration:
        span = float(law.spans[index])
        end, following = min(interval.time_at(low + span), interval.duration), index + 1
        is_jump = following % law.spans.size in law.velocity_jumps
        if is_jump and end_angle - (low + span) <= JOINT_ATOL_RAD:
            end = interval.duration
        if end > start:
            stretches.append((start, end, index, low))
            start = end
        index, low = following % law.spans.size, low + span
    return stretches


def _piece(
    law: Law, interval: Interval, start: float, end: float, index: int, low: float
) -> FloatArray:
    """Return s, ṡ and s̈ of the cam on a speed ramp as polynomials of time.

    The polynomials cover the passage over one piece of the law of degree p. They are rows of
    Bernstein ordinates, ``(3, 2p + 3)``, in m, m/s and m/s². ``start`` and ``end`` are times in s,
    ``index`` is that of the piece, and ``low`` is the cam angle (rad) at its start.
    """
    span, length = float(law.spans[index]), end - start
    speeds = np.array([interval.speed_at(start), interval.speed_at(end)])
    first, last = ((interval.angle_at(t) - low) / span for t in (start, end))
    u = np.clip([first, first + 0.5 * speeds[0] / span * length, last], 0.0, 1.0)
    s, slope, curvature = compose(law.motion[:, :, index].T, u).T[:, :, None]
    squares = np.array([speeds[0] ** 2, speeds[0] * speeds[1], speeds[1] ** 2])
    top = s.shape[0] + 1
    rows = (
        bernstein.elevate(s, top),
        bernstein.elevate(product(speeds, slope), top),
        product(squares, curvature) + interval.acceleration * bernstein.elevate(slope, top),
    )
    return np.stack([row[:, 0] for row in rows])
