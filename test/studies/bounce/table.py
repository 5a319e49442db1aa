"""A ball on a table that moves up and down: the law of the table, and the turn in many digits.

The reference shares no code with the package: its law is the cosine itself, its landings are roots
in mpmath's arithmetic, and a derivative is a difference in 60 digits.
"""

from __future__ import annotations

import math
from dataclasses import astuple

import mpmath as mp
import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.laws import Law
from cam_rig.laws.segments import fit, trigonometric
from cam_rig.studies.bounce.sweep import OperatingPoint, Sweep
from cam_rig.units import TURN

#: m, m/s² and N/m: half the table's stroke, gravity, and a spring that is none.
AMPLITUDE, GRAVITY, NO_SPRING = 0.01, 9.81, 1e-15


def table_law() -> Law:
    """S = A (1 − cos θ)."""
    breaks, ordinates = fit(trigonometric(AMPLITUDE, [-AMPLITUDE], [0.0]), 0.0, TURN)
    return Law("table", breaks, np.stack(ordinates, axis=1))


def ball(restitution: float, damping: float = 0.0, spring: float = NO_SPRING) -> FollowerParameters:
    """1 kg."""
    return FollowerParameters(1.0, spring, damping, GRAVITY, 1e8, restitution)


def by_speed(follower: FollowerParameters) -> Sweep:
    """Over the speed, of a follower."""
    return Sweep(OperatingPoint(follower, 1.0))


def speed_at(ratio: float) -> float:
    """The speed (rad/s) of an A ω²/g."""
    return math.sqrt(ratio * GRAVITY / AMPLITUDE)


def window(restitution: float, turns: int = 1) -> tuple[float, float]:
    """A ω²/g from which on one landing in so many turns repeats, and at which its period doubles.

    With a flight of n turns T the ball takes off at g n T/2, so at the landing
    ṡ = (g n T/2) (1 − r)/(1 + r); the trace of the turn's derivative is (1 + r)² (1 + s̈/g) − 2 r
    and its determinant r². The fold is at s̈ = 0, the doubling at s̈/g = −2 (1 + r²)/(1 + r)².
    """
    r = restitution
    least = math.pi * turns * (1.0 - r) / (1.0 + r)
    return least, math.hypot(least, 2.0 * (1.0 + r**2) / (1.0 + r) ** 2)


def one_landing(restitution: float, ratio: float) -> tuple[float, tuple[float, float]]:
    """Speed (rad/s), and gap and rate at angle 0, of the ball that lands once a turn."""
    speed, (least, _) = speed_at(ratio), window(restitution)
    landing = 0.5 * math.pi + math.acos(least / ratio)  # where ṡ is what it must be, falling
    left, up = (TURN - landing) / speed, math.pi * GRAVITY / speed
    place = AMPLITUDE * (1.0 - math.cos(landing)) + up * left - 0.5 * GRAVITY * left**2
    return speed, (place, up - GRAVITY * left)


def as_array(matrix) -> np.ndarray:
    return np.array(matrix.tolist(), dtype=float)


# -- two masses on a table that moves up and down, in many digits -----------------------------


#: A lift-off; landings after which the roller stays, bounces, or at once leaves a falling table.
LIFTS_OFF, STAYS, BOUNCES, LEAVES = "lifts off", "stays", "bounces", "leaves"


class TwoInManyDigits:
    """The map of a turn of ``speed`` rad/s over the table s = A (1 − cos θ).

    It holds the matrices of (z, ż, y, ẏ, 1) in flight, and of (y, ẏ, cos, sin, 1) on the table.
    """

    def __init__(self, parameters: TwoMassParameters, speed: float) -> None:
        self.parameters, self.speed = parameters, speed
        a, w = mp.mpf(AMPLITUDE), mp.mpf(speed)
        m1, m2, k1, k2, c1, c2, load = map(mp.mpf, astuple(parameters)[:7])
        own = [-(k1 + k2) / m2, -(c1 + c2) / m2]
        flight = [
            [0, 1, 0, 0, 0],
            [-k1 / m1, -c1 / m1, k1 / m1, c1 / m1, 0],
            [0, 0, 0, 1, 0],
            [k1 / m2, c1 / m2, *own, -load / m2],
            [0, 0, 0, 0, 0],
        ]
        contact = [
            [0, 1, 0, 0, 0],
            [*own, -k1 * a / m2, c1 * a * w / m2, (k1 * a - load) / m2],
            [0, 0, 0, -w, 0],
            [0, 0, w, 0, 0],
            [0, 0, 0, 0, 0],
        ]
        modes = (mp.eig(mp.matrix(matrix)) for matrix in (flight, contact))  # all are distinct
        self.flight, self.contact = ((rates, shapes, shapes**-1) for rates, shapes in modes)

    def table(self, t):
        """S, ṡ and s̈."""
        a, w = mp.mpf(AMPLITUDE), mp.mpf(self.speed)
        return a * (1 - mp.cos(w * t)), a * w * mp.sin(w * t), a * w**2 * mp.cos(w * t)

    def at(self, state, begun, t):
        """(z, ż, y, ẏ) or (y, ẏ) at a time, from the one ``begun``."""
        angle = mp.mpf(self.speed) * begun
        driven = [1] if len(state) == 4 else [mp.cos(angle), mp.sin(angle), 1]
        rates, shapes, inverse = self.flight if len(state) == 4 else self.contact
        modes = inverse * mp.matrix([*state, *driven])
        for i, rate in enumerate(rates):
            modes[i] *= mp.exp(rate * (t - begun))
        return [mp.re(one) for one in shapes * modes][: len(state)]

    def gap(self, state, begun, t):
        """What is zero at an event: the gap of a flight, the contact force on the table."""
        s, velocity, bend = self.table(t)
        now = self.at(state, begun, t)
        if len(now) == 4:
            return now[0] - s
        p = self.parameters
        force = mp.mpf(p.roller_mass) * bend - mp.mpf(p.stem_stiffness) * (now[0] - s)
        return force - mp.mpf(p.stem_damping) * (now[1] - velocity)

    def turn(self, numbers, events):
        """Gap, its rate, stretch and its rate a turn later; ``events`` are kinds near times (s)."""
        gap, opening, w, rate = numbers  # at angle 0 the table is at 0 and at rest
        flies = gap != 0 or opening != 0
        state = [gap, opening, gap + w, opening + rate] if flies else [w, rate]
        begun = mp.mpf(0)
        for near, kind in events:
            root = mp.findroot(
                lambda t, state=state, begun=begun: self.gap(state, begun, t),
                (mp.mpf(near), mp.mpf(near) * (1 + mp.mpf(10) ** -12)),
                tol=mp.mpf(10) ** (-2 * mp.mp.dps + 20),
            )
            now, (s, velocity, _) = self.at(state, begun, root), self.table(root)
            rebound = mp.mpf(0)
            if kind == BOUNCES:
                rebound = -mp.mpf(self.parameters.restitution) * (now[1] - velocity)
            state = now[-2:] if kind == STAYS else [s, velocity + rebound, *now[-2:]]
            begun = root
        end = 2 * mp.pi / mp.mpf(self.speed)
        now, (s, velocity, _) = self.at(state, begun, end), self.table(end)
        z, v, y, other = now if len(now) == 4 else [s, velocity, *now]
        return [z - s, v - velocity, y - z, other - v]

    def derivative(self, numbers, events):
        """``(4, 4)`` by central differences in 60 digits; of a turn from the table the last two."""
        numbers, h = [mp.mpf(one) for one in numbers], mp.mpf(10) ** -22
        found = mp.zeros(4, 4)
        for j in range(0 if numbers[0] or numbers[1] else 2, 4):
            ends = []
            for sign in (1, -1):
                moved = list(numbers)
                moved[j] += sign * h
                ends.append(self.turn(moved, events))
            for i in range(4):
                found[i, j] = (ends[0][i] - ends[1][i]) / (2 * h)
        return found
