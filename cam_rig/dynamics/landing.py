"""Where a flying follower meets the cam again.

Within a window the gap's acceleration is a polynomial: the follower's power series less the law's
s'' ω². Integrated twice from the gap and the speed at which it opens it gives the gap, and where
both are known exactly, as they are at a lift-off, so is a gap of any smallness: its first zero is
divided out, and the next one is the landing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.dynamics.linear.free_system import Flight
from cam_rig.dynamics.root_scan import TOGETHER, clear_cells, fall, step
from cam_rig.dynamics.velocity_jumps import SAME_PLACE
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN

#: A gap reckoned from two places is this many rounding errors of them wrong at most.
ROUNDING_ERRORS = 16.0
#: The same for what is reckoned from accelerations, of theirs.
OF_ACCELERATIONS = 64.0
#: Roundings of an angle that a lift-off may be wrong by.
SLIP = 4.0
#: Longest time (s) before a velocity jump that may be none.
VELOCITY_JUMP_S = 1e-7
#: A look at the gap takes steps of this part of a window at least; below that it is a polynomial.
MIN_STEP = 1.0 / 16.0


@dataclass(frozen=True)
class Gap:
    """Follower less cam at a time (s) since the flight began: m, and m/s.

    ``noise`` (m) is what rounding may have added; ``landed`` whether the flight ends here.
    """

    time: float
    gap: float
    rate: float
    noise: float
    landed: bool = False


@dataclass(frozen=True)
class Approach:
    """A flight over a cam; ``angle`` (rad) where it begins, ``speed`` in rad/s.

    ``force_noise`` (m/s²) is by how much the acceleration may be wrong at which the gap opens when
    the cam's force, which is known to so much, falls to zero.
    """

    flight: Flight
    law: Law
    angle: float
    speed: float
    force_noise: float = 0.0

    def run(self, limit: float) -> Gap:
        """The flight's end: where it lands, or at ``limit`` (s) in the air."""
        now, last = self._begin(), limit - self._rounding
        while now.time < limit:
            # A velocity jump ends the flight: rounding must not put its last bit behind that jump.
            now = self._window(now, limit, now.time - (self._rounding if now.time > last else 0.0))
            if now.landed:
                return now
            if now.time < last:
                now = self._open_until(now, limit)
        return now

    @property
    def _rounding(self) -> float:
        """Time (s) before the end of a flight that may be none, if a velocity jump ends it."""
        if not self.law.velocity_jumps:
            return 0.0
        return min(max(SAME_PLACE / self.speed, 4.0 * self._last_digit), VELOCITY_JUMP_S)

    def _begin(self) -> Gap:
        flight = self.flight
        if flight.gap is None or flight.opening is None:
            return self._apart()
        return Gap(0.0, flight.gap, flight.opening, 0.0)

    def _apart(self) -> Gap:
        """The gap at the beginning, as the difference of two places."""
        place, velocity = (float(x[0]) for x in self.flight.state(np.zeros(1)))
        piece, first = self._start
        s, slope = (order(first) for order in self.law.scalars(piece)[:2])
        noise = gap_rounding(self.law, place)
        return Gap(0.0, place - s, velocity - self.speed * slope, noise)

    @cached_property
    def _start(self) -> tuple[int, float]:
        """Piece of the law where the flight begins, and u there."""
        piece, low, high = self._piece(0.0)
        return piece, min(max((self.angle - low) / (high - low), 0.0), 1.0 - 1e-16)

    @property
    def _left_of_piece(self) -> float:
        """Time (s) up to the end of the piece where the flight begins."""
        piece, first = self._start
        return float(self.law.spans[piece]) * (1.0 - first) / self.speed

    def _at(self, time: float, piece: int) -> Gap:
        """The gap by how far both have come since; where a piece ends, before what follows it."""
        begun, flight = self._begin(), self.flight
        row, (way, rates) = flight.system.row, flight.moved_to(time)
        noise = gap_rounding(self.law, float(row @ flight.start))
        if piece == self._start[0] and time <= self._left_of_piece:
            cam = self._bent(time)
            begin = row @ flight.moved_to(0.0)[1]
            more = float(row @ way - begin * time) - cam[0]
            faster = float(row @ rates - begin) - cam[1]
            gap = begun.gap + begun.rate * time + more
            return Gap(time, gap, begun.rate + faster, noise)
        u = self.law.within(np.array([piece]), self.angle, np.array([self.speed * time]))
        s, slope = (order(float(u[0])) for order in self.law.scalars(piece)[:2])
        place, velocity = float(row @ (flight.start + way)), float(row @ rates)
        return Gap(time, place - s, velocity - self.speed * slope, noise)

    def _bent(self, time: float) -> tuple[float, float]:
        """What the cam has come to more than at its first velocity, m, and that velocity's gain.

        In the piece where the flight begins. From s'' alone: the rounding of s and of s', which
        differs from that of the follower's place and velocity, does not enter.
        """
        (piece, first), length = self._start, self._left_of_piece
        bend = bernstein.restrict(self.law.motion[2][:, piece], first, 1.0) * self.speed**2
        rates = length * bernstein.antiderivative(bend)
        u = min(time / length, 1.0)
        whole = length * bernstein.antiderivative(rates)
        return bernstein.scalar(whole)(u), bernstein.scalar(rates)(u)

    def _open_until(self, now: Gap, limit: float) -> Gap:
        """The gap as far from ``now`` on as steps prove that it is open."""
        begin, value, law, piece = now.time, now.gap, self.law, -1
        least = MIN_STEP * self.flight.system.window
        while begin < limit:
            bend = self.flight.largest_acceleration(begin)
            wide = min(step(value, bend + self.speed**2 * law.bounds[2], least), limit)
            times = np.minimum(begin + wide * np.arange(TOGETHER + 1), limit)
            times, pieces = self._with_joints(times[: np.argmax(times) + 1])
            values = self.flight.state(times)[0] - self._lift(times, pieces)
            bends = bend + self.speed**2 * law.bends[pieces]
            noise = gap_rounding(law, float(np.abs(values).max()) + law.bounds[0])
            clear = clear_cells(times, values, bends, noise)
            begin, value = float(times[clear]), float(values[clear])
            piece = int(pieces[clear - 1]) if clear else piece
            if clear < pieces.size:
                break
        return now if piece < 0 else self._at(begin, piece)

    def _with_joints(self, times: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        """Times with those of the law's joints among them, and the piece between any two."""
        law, angles = self.law, self.angle + self.speed * times[[0, -1]]
        first, last = (int(turn) for turn in np.floor(angles / TURN))
        turns = np.arange(first, last + 1)[:, None] * TURN
        joints = ((law.breaks[:-1] + turns).ravel() - self.angle) / self.speed
        slip = SAME_PLACE / self.speed  # one at either end is met there already
        inner = joints[(joints > times[0] + slip) & (joints < times[-1] - slip)]
        times = np.union1d(times, inner)
        middle = self.angle + self.speed * 0.5 * (times[:-1] + times[1:])
        inside = middle - np.floor(middle / TURN) * TURN
        return times, np.searchsorted(law.breaks[1:-1], inside, side="right")

    def _lift(self, times: FloatArray, pieces: NDArray[np.intp]) -> FloatArray:
        """S (m) at times; at a joint of the piece after it."""
        pieces, law = np.append(pieces, pieces[-1]), self.law
        at = bernstein.basis(law.degree, law.within(pieces, self.angle, self.speed * times))
        return np.asarray(np.einsum("np,pn->n", at, law.ordinates[:, pieces]))

    def _window(self, now: Gap, limit: float, within: float) -> Gap:
        """The gap's polynomial from ``now`` on: where it falls to zero, or its end.

        The law's piece is that of the time ``within``.
        """
        law, begin = self.law, now.time
        piece, low, high = self._piece(within)
        end = min(begin + self.flight.system.window, limit)
        if within == begin:
            end = min(end, (high - self.angle) / self.speed)
        if not end > begin:
            return Gap(math.nextafter(begin, math.inf), now.gap, now.rate, now.noise)
        length, span = end - begin, high - low
        first, last = ((self.angle + self.speed * t - low) / span for t in (begin, end))
        first, last = min(max(first, 0.0), 1.0 - 1e-16), min(max(last, 0.0), 1.0)
        bend = bernstein.restrict(law.motion[2][:, piece], first, max(first, last))
        follower, cam = self.flight.accelerations(begin, end), self.speed**2 * bend
        degree = max(follower.size, cam.size) - 1
        follower, cam = (bernstein.elevate(x, degree) for x in (follower, cam))
        doubt = bernstein.EPS * OF_ACCELERATIONS * float(np.abs(follower).max())
        doubt += bernstein.EPS * self.speed**2 * self._bend_size(piece)
        rates = length * bernstein.antiderivative(follower - cam) + now.rate
        gaps = length * bernstein.antiderivative(rates) + now.gap
        doubt_at_start = doubt + self.force_noise + self._slip(follower - cam, length)
        at = _landing(gaps, now, length, doubt_at_start)
        if at is not None:
            rate = float(bernstein.evaluate(rates, np.array([at]))[0])
            return Gap(begin + at * length, 0.0, rate, 0.0, landed=True)
        noise = now.noise + length**2 * doubt
        return Gap(end, float(gaps[-1]), float(rates[-1]), noise)

    def _slip(self, acceleration: FloatArray, length: float) -> float:
        """What the acceleration (m/s²) changes within the rounding of the time of a lift-off.

        The time is a float, and so is the angle: the force there is not quite none.
        """
        jerk = (acceleration.size - 1) / length * float(np.abs(np.diff(acceleration)[:2]).max())
        return jerk * self._last_digit

    def _bend_size(self, piece: int) -> float:
        """What rounding of s'' (m/rad²) is to be measured by: its own size, and that of s."""
        law = self.law
        differences = (law.degree / float(law.spans[piece])) ** 2 * law.bounds[0]
        return OF_ACCELERATIONS * float(law.bends[piece]) + differences

    def _piece(self, time: float) -> tuple[int, float, float]:
        """The law's piece from a time on, and the angles (rad) where it begins and ends.

        One that ends within the rounding of the angle is over: a lift-off
        where s'' falls is there, and not a last digit before.
        """
        law, at = self.law, self.angle + self.speed * time
        turn = math.floor(at / TURN) * TURN
        index = law.piece(at - turn)
        low, high = law.joints[index] + turn, law.joints[index + 1] + turn
        if (high - self.angle) / self.speed <= time + self._last_digit:
            index = (index + 1) % law.spans.size
            low, high = high, high + float(law.spans[index])
        return index, low, high

    @cached_property
    def _last_digit(self) -> float:
        """Time (s) in which the cam turns by the rounding of its angle."""
        return SLIP * bernstein.EPS * (abs(self.angle) + TURN) / self.speed


def _landing(gaps: FloatArray, now: Gap, length: float, doubt: float) -> float | None:
    """U ∈ [0, 1] where the gap falls to zero; a zero at the start is divided out first.

    A polynomial with the ordinates b is u times one with the ordinates bᵢ n/i.
    """
    noise = now.noise + OF_ACCELERATIONS * bernstein.EPS * float(np.abs(gaps).max())
    if now.gap != 0.0 or now.noise != 0.0 or now.rate < 0.0:
        return fall(gaps, noise)
    degree = gaps.size - 1
    order = np.arange(1.0, degree + 1.0)
    gaps = gaps[1:] * (degree / order)
    noise = length**2 * doubt
    if now.rate == 0.0:
        gaps = gaps[1:] * ((degree - 1) / order[:-1])
        return fall(gaps, noise)
    return fall(gaps, min(noise, 0.5 * length * now.rate))


def gap_rounding(law: Law, displacement: float) -> float:
    """Bound (m) on the error of a gap: of both displacements, the angle, the law's own joints."""
    largest, steepest, _ = law.bounds
    size = max(abs(displacement), largest) + TURN * steepest
    return ROUNDING_ERRORS * bernstein.EPS * size + law.largest_step
