"""Independent reference for bounce maps: a ball on a harmonically moving table.

A bounce map is the motion of a follower at each speed, turn after turn. The tests compare cam_rig
with these results, which share no code with it. The table moves as s = A (1 − cos θ). Landings are
roots computed in mpmath's multi-digit arithmetic. Derivatives are differences in 60 digits.
"""

from __future__ import annotations

import math
from dataclasses import astuple

import mpmath as mp
import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.laws import Law
from cam_rig.laws.sampling import fit_curve
from cam_rig.laws.segments import trigonometric
from cam_rig.studies.bounce.sweep import OperatingPoint, Sweep
from cam_rig.units import TURN

#: Amplitude A of the table in m, half of its stroke.
AMPLITUDE = 0.01
#: Gravity, m/s².
GRAVITY = 9.81
#: Spring stiffness of the ball, N/m. It is negligible, but the parameters require a value above 0.
NO_SPRING = 1e-15


def table_law() -> Law:
    """Return the displacement law s = A (1 − cos θ) of the table as a `Law`, in m."""
    breaks, ordinates = fit_curve(trigonometric(AMPLITUDE, [-AMPLITUDE], [0.0]), 0.0, TURN)
    return Law("table", breaks, np.stack(ordinates, axis=1))


def ball(restitution: float, damping: float = 0.0, spring: float = NO_SPRING) -> FollowerParameters:
    """Return the parameters of a ball of 1 kg that gravity presses on the table."""
    return FollowerParameters(1.0, spring, damping, GRAVITY, 1e8, restitution)


def by_speed(follower: FollowerParameters) -> Sweep:
    """Return a sweep in which this follower's cam speed (rad/s) is varied."""
    return Sweep(OperatingPoint(follower, 1.0))


def speed_at(ratio: float) -> float:
    """Return the speed ω (rad/s) for a ratio A ω²/g of table acceleration to gravity."""
    return math.sqrt(ratio * GRAVITY / AMPLITUDE)


def window(restitution: float, turns: int = 1) -> tuple[float, float]:
    """Return the range of A ω²/g in which a landing every `turns` turns is stable.

    The lower limit is a fold and the upper limit a period doubling. In a flight of n turns of
    period T the ball takes off at the relative speed g n T/2, so at the landing ṡ = (g n T/2) (1 −
    r)/(1 + r), with the restitution r. The derivative of the map of one turn has the trace (1 + r)²
    (1 + s̈/g) − 2 r and the determinant r². The fold is at s̈ = 0, the doubling at s̈/g = −2 (1 +
    r²)/(1 + r)².
    """
    r = restitution
    least = math.pi * turns * (1.0 - r) / (1.0 + r)
    return least, math.hypot(least, 2.0 * (1.0 + r**2) / (1.0 + r) ** 2)


def one_landing(restitution: float, ratio: float) -> tuple[float, tuple[float, float]]:
    """Return the speed and the state at angle 0 of a ball that lands once per turn.

    `ratio` is A ω²/g. The speed is in rad/s. The state is the gap between ball and table (m) and
    its rate (m/s), in closed form.
    """
    speed, (least, _) = speed_at(ratio), window(restitution)
    landing = 0.5 * math.pi + math.acos(least / ratio)  # table speed ṡ as required, falling
    left, up = (TURN - landing) / speed, math.pi * GRAVITY / speed
    gap = AMPLITUDE * (1.0 - math.cos(landing)) + up * left - 0.5 * GRAVITY * left**2
    return speed, (gap, up - GRAVITY * left)


def as_array(matrix) -> np.ndarray:
    return np.array(matrix.tolist(), dtype=float)


# -- two masses on a moving table, in many digits ----------------------------------------------


#: Kinds of events of the roller: it lifts off the table, or it lands. After a landing it stays in
#: contact, bounces, or leaves at once because the table accelerates away from it.
LIFTS_OFF, STAYS, BOUNCES, LEAVES = "lifts off", "stays", "bounces", "leaves"


class TwoInManyDigits:
    """Map of one turn of the two-mass model over the table s = A (1 − cos θ).

    It is computed in mpmath arithmetic. `speed` is in rad/s. The motion between events is solved by
    the eigenvectors of two matrices: one for (z, ż, y, ẏ, 1) in flight, and one for (y, ẏ, cos,
    sin, 1) in contact with the table. z is the position of the roller mass and y that of the end
    mass, both in m.
    """

    def __init__(self, parameters: TwoMassParameters, speed: float) -> None:
        self.parameters, self.speed = parameters, speed
        a, w = mp.mpf(AMPLITUDE), mp.mpf(speed)
        m1, m2, k1, k2, c1, c2, load = map(mp.mpf, astuple(parameters)[:7])
        end_mass_row = [-(k1 + k2) / m2, -(c1 + c2) / m2]
        flight = [
            [0, 1, 0, 0, 0],
            [-k1 / m1, -c1 / m1, k1 / m1, c1 / m1, 0],
            [0, 0, 0, 1, 0],
            [k1 / m2, c1 / m2, *end_mass_row, -load / m2],
            [0, 0, 0, 0, 0],
        ]
        contact = [
            [0, 1, 0, 0, 0],
            [*end_mass_row, -k1 * a / m2, c1 * a * w / m2, (k1 * a - load) / m2],
            [0, 0, 0, -w, 0],
            [0, 0, w, 0, 0],
            [0, 0, 0, 0, 0],
        ]
        modes = (mp.eig(mp.matrix(matrix)) for matrix in (flight, contact))  # distinct rates
        self.flight, self.contact = ((rates, shapes, shapes**-1) for rates, shapes in modes)

    def table(self, t):
        """Return s (m), ṡ (m/s) and s̈ (m/s²) of the table at the time t (s)."""
        a, w = mp.mpf(AMPLITUDE), mp.mpf(self.speed)
        return a * (1 - mp.cos(w * t)), a * w * mp.sin(w * t), a * w**2 * mp.cos(w * t)

    def at(self, state, start, t):
        """Return the state at the time `t` (s), given the state at the time `start` (s).

        A state of four numbers is a flight (z, ż, y, ẏ). A state of two is in contact (y, ẏ).
        """
        angle = mp.mpf(self.speed) * start
        driven = [1] if len(state) == 4 else [mp.cos(angle), mp.sin(angle), 1]
        rates, shapes, inverse = self.flight if len(state) == 4 else self.contact
        modes = inverse * mp.matrix([*state, *driven])
        for i, rate in enumerate(rates):
            modes[i] *= mp.exp(rate * (t - start))
        return [mp.re(value) for value in shapes * modes][: len(state)]

    def gap(self, state, start, t):
        """Return the function of time whose next zero is the next lift-off or landing.

        In flight it is the gap (m) between roller and table. In contact it is the force (N) on the
        table.
        """
        s, velocity, acceleration = self.table(t)
        current = self.at(state, start, t)
        if len(current) == 4:
            return current[0] - s
        p = self.parameters
        force = mp.mpf(p.roller_mass) * acceleration - mp.mpf(p.stem_stiffness) * (current[0] - s)
        return force - mp.mpf(p.stem_damping) * (current[1] - velocity)

    def turn(self, numbers, events):
        """Return gap, stem stretch and their rates one turn later, in m and m/s.

        `numbers` has the same four values at angle 0. `events` has the pairs (time in s, kind) of
        the turn's lift-offs and landings. The times are approximate and are refined to roots here.
        """
        gap, gap_rate, w, rate = numbers  # table at angle 0: s = 0 and ṡ = 0
        flies = gap != 0 or gap_rate != 0
        state = [gap, gap_rate, gap + w, gap_rate + rate] if flies else [w, rate]
        start = mp.mpf(0)
        for near, kind in events:
            root = mp.findroot(
                lambda t, state=state, start=start: self.gap(state, start, t),
                (mp.mpf(near), mp.mpf(near) * (1 + mp.mpf(10) ** -12)),
                tol=mp.mpf(10) ** (-2 * mp.mp.dps + 20),
            )
            current, (s, velocity, _) = self.at(state, start, root), self.table(root)
            rebound = mp.mpf(0)
            if kind == BOUNCES:
                rebound = -mp.mpf(self.parameters.restitution) * (current[1] - velocity)
            state = current[-2:] if kind == STAYS else [s, velocity + rebound, *current[-2:]]
            start = root
        end = 2 * mp.pi / mp.mpf(self.speed)
        current, (s, velocity, _) = self.at(state, start, end), self.table(end)
        z, v, y, other = current if len(current) == 4 else [s, velocity, *current]
        return [z - s, v - velocity, y - z, other - v]

    def derivative(self, numbers, events):
        """Return the derivative of `turn` by central differences, shape (4, 4).

        If the turn starts in contact, the first two columns are zero, because gap and gap rate are
        fixed.
        """
        numbers, h = [mp.mpf(number) for number in numbers], mp.mpf(10) ** -22
        matrix = mp.zeros(4, 4)
        for j in range(0 if numbers[0] or numbers[1] else 2, 4):
            ends = []
            for sign in (1, -1):
                moved = list(numbers)
                moved[j] += sign * h
                ends.append(self.turn(moved, events))
            for i in range(4):
                matrix[i, j] = (ends[0][i] - ends[1][i]) / (2 * h)
        return matrix
