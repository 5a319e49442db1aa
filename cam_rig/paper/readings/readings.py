"""Table 2 read in other ways: what a rig would show to someone who looks every 5 rpm.

The table prints speeds in steps of 5 rpm. So for each cam a run from rest is looked at at every
such speed; the first at which contact is lost is what the table would print, and when it is first
lost there is its time. How much that time says shows in how many of the speeds about the printed
one give it: where the force of every turn is alike, hardly any.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import find_jump_speed, force_run
from cam_rig.dynamics.modal.motion import SERIES_RTOL
from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.laws import Law, bernstein, build_law
from cam_rig.schema import CamConfig, TableReading
from cam_rig.schema.published import PublishedJump
from cam_rig.studies.jump.study import ROUNDED_TO, with_event
from cam_rig.units import RPM, TURN, ComplexArray, FloatArray, rms, to_rpm

# The least contact force of each turn from rest, for many two-mass rigs at once.

#: Derivatives of the law that are kept: enough where a turn has ten periods of the vibration.
DERIVATIVES = 14
#: Points of a turn, and how many a period of the vibration needs: with fewer its envelope is taken.
TURN_POINTS, PER_PERIOD = 640, 16


@dataclass(frozen=True, eq=False)
class Rigs:
    """Two-mass followers side by side, each number ``(b,)``, SI; damped below critical."""

    roller_mass: FloatArray
    end_mass: FloatArray
    stem_stiffness: FloatArray
    spring_stiffness: FloatArray
    stem_damping: FloatArray
    damping: FloatArray
    preload: FloatArray

    @classmethod
    def of(cls, follower: TwoMassParameters, count: int) -> Rigs:
        """One follower so many times."""
        numbers = (getattr(follower, field.name) for field in fields(cls))
        return cls(*(np.full(count, number) for number in numbers))

    @cached_property
    def stiffness(self) -> FloatArray:
        """k₁ + k₂, N/m."""
        return self.stem_stiffness + self.spring_stiffness

    @cached_property
    def rate(self) -> ComplexArray:
        """λ of the end mass in contact, 1/s, with positive imaginary part."""
        half = 0.5 * (self.stem_damping + self.damping) / self.end_mass
        return np.asarray(-half + 1j * np.sqrt(self.stiffness / self.end_mass - half**2))

    def end_series(self, count: int) -> FloatArray:
        """What each derivative of s contributes to the end mass's place, ``(b, count)``.

        Taylor coefficients of (k₁ + c₁ D)/(k₁ + k₂ + (c₁ + c₂) D + m₂ D²), eq. 16.
        """
        inverse = np.zeros((count, self.preload.size))
        square = self.stiffness / self.end_mass
        two_half = -2.0 * self.rate.real
        inverse[0] = 1.0 / square
        inverse[1] = -two_half * inverse[0] / square
        for k in range(2, count):
            inverse[k] = -(two_half * inverse[k - 1] + inverse[k - 2]) / square
        series = self.stem_stiffness / self.end_mass * inverse
        series[1:] += self.stem_damping / self.end_mass * inverse[:-1]
        return np.asarray(series.T)

    def force_series(self, count: int) -> FloatArray:
        """The same for the contact force, eq. 17, ``(b, count)``."""
        end = self.end_series(count).T
        force = -self.stem_stiffness * end
        force[1:] -= self.stem_damping * end[:-1]
        force[0] = self.stem_stiffness * self.spring_stiffness / self.stiffness
        force[1] += self.stem_damping
        force[2] += self.roller_mass
        return np.asarray(force.T)


@dataclass(frozen=True, eq=False)
class ShapeTable:
    """A law's derivatives in u of each piece at its points, whatever the pieces' spans are.

    ``pieces``: for each piece ``(count, q)``, d^k s/du^k at q points from u = 0 to 1; ``ends``:
    ``(2, count + 1, n)``, the same at both ends of each piece, with one derivative more.
    """

    pieces: tuple[FloatArray, ...]
    ends: FloatArray

    @classmethod
    def of(cls, law: Law, points: int = TURN_POINTS) -> ShapeTable:
        """The table of a law, with so many points a turn."""
        count = max(2, min(law.degree, DERIVATIVES)) + 1
        pieces, ends = [], np.zeros((2, count + 1, law.spans.size))
        each = [max(24, round(points * span / TURN)) for span in law.spans]
        ordinates = [law.derivative_ordinates(k) for k in range(count + 1)]
        for i, span in enumerate(law.spans):
            basis = bernstein.basis(law.degree, np.linspace(0.0, 1.0, each[i]))
            rows = np.array([basis @ o[:, i] * span**k for k, o in enumerate(ordinates)])
            pieces.append(rows[:-1])
            ends[:, :, i] = rows[:, 0], rows[:, -1]
        return cls(tuple(pieces), ends)

    @cached_property
    def largest(self) -> FloatArray:
        """The largest |d^k s/du^k| of each piece, ``(n, count)``."""
        return np.array([np.abs(piece).max(axis=1) for piece in self.pieces])

    def powers(self, scale: FloatArray, series: FloatArray) -> FloatArray:
        """``(b, n, count)``: (du/dt)^k, zero where the series ``(b, count)`` has settled.

        What comes after two terms below `SERIES_RTOL` of the largest is rounding of a fitted law.
        """
        powers = np.asarray(scale[:, :, None] ** np.arange(series.shape[1]))
        sizes = (np.abs(series)[:, None, :] * powers * self.largest).sum(axis=1)
        small = sizes <= SERIES_RTOL * np.maximum.accumulate(sizes, axis=1)
        over = np.logical_or.accumulate((small[:, :-1] & small[:, 1:])[:, 2:], axis=1)
        powers[:, :, 3:] *= ~over[:, None, :]
        return powers


class TurnMinima(NamedTuple):
    """Least force (N) of each turn and the cam angle (rad) in the turn, ``(b, turns)`` each."""

    force: FloatArray
    angle: FloatArray


def turn_minima(
    shape: ShapeTable, spans: FloatArray, rigs: Rigs, speed: FloatArray | float, turns: int
) -> TurnMinima:
    """The least contact force of each turn of runs from rest at θ = 0.

    Where a piece has fewer points than the vibration needs, its envelope stands for it: the force
    is then a lower bound, and a near one where many periods fit in a piece.

    ``spans``: ``(b, n)``, rad, of the law's pieces on each rig; ``speed``: rad/s, one or ``(b,)``.
    """
    speed = np.broadcast_to(speed, rigs.preload.shape)
    scale = speed[:, None] / spans
    jumps, start = _amplitudes(shape, scale, rigs)
    times = spans / speed[:, None]
    own = np.zeros((scale.shape[0], scale.shape[1] + 1), dtype=complex)
    for i in range(scale.shape[1]):
        fading = np.exp(rigs.rate * times[:, i])
        own[:, i + 1] = own[:, i] * fading + jumps[:, (i + 1) % scale.shape[1]]
    flow = np.exp(rigs.rate * TURN / speed)
    amplitude = np.zeros((start.size, turns), dtype=complex)
    for turn in range(turns):
        amplitude[:, turn] = start
        start = start * flow + own[:, -1]
    return _least(shape, scale, times, rigs, amplitude, own)


def _amplitudes(
    shape: ShapeTable, scale: FloatArray, rigs: Rigs
) -> tuple[ComplexArray, ComplexArray]:
    """What the joint before each piece adds to the vibration, ``(b, n)``, and that at the start."""
    count = shape.ends.shape[1] - 1
    series = rigs.end_series(count)
    weights = series[:, None, :] * shape.powers(scale, rigs.force_series(count))
    place = np.einsum("bnk,ekn->ebn", weights, shape.ends[:, :-1])
    rate = np.einsum("bnk,ekn->ebn", weights * scale[:, :, None], shape.ends[:, 1:])

    def amplitude(y: FloatArray, v: FloatArray) -> ComplexArray:
        half, pulse = -rigs.rate.real[:, None], rigs.rate.imag[:, None]
        return np.asarray(y - 1j * (v + half * y) / pulse)

    jumps = amplitude(np.roll(place[1], 1, 1) - place[0], np.roll(rate[1], 1, 1) - rate[0])
    share = (rigs.stem_stiffness / rigs.stiffness)[:, None]  # without vibration the end mass has it
    static, along = share * shape.ends[0, 0], share * scale * shape.ends[0, 1]
    return jumps, amplitude(static - place[0], along - rate[0])[:, 0]


def _least(
    shape: ShapeTable,
    scale: FloatArray,
    times: FloatArray,
    rigs: Rigs,
    amplitude: ComplexArray,
    own: ComplexArray,
) -> TurnMinima:
    """The least force of all pieces, from the amplitude at the start of each turn."""
    found = np.full(amplitude.shape, np.inf)
    angle = np.zeros(amplitude.shape)
    shown = -(rigs.stem_stiffness + rigs.stem_damping * rigs.rate)
    constant = rigs.preload * rigs.stem_stiffness / rigs.stiffness
    before = np.zeros(amplitude.shape[0])
    series = rigs.force_series(shape.pieces[0].shape[0])
    powers = shape.powers(scale, series)
    for i, piece in enumerate(shape.pieces):
        forced = (series * powers[:, i]) @ piece + constant[:, None]
        u = np.linspace(0.0, 1.0, piece.shape[1])
        start = amplitude * np.exp(rigs.rate * before)[:, None] + own[:, i : i + 1]
        force = _force(forced, start * shown[:, None], rigs.rate[:, None] * times[:, i : i + 1], u)
        at = force.argmin(axis=2)
        least = np.take_along_axis(force, at[:, :, None], 2)[:, :, 0]
        here = before[:, None] + times[:, i : i + 1] * u[at]
        lower = least < found
        found, angle = np.where(lower, least, found), np.where(lower, here, angle)
        before = before + times[:, i]
    return TurnMinima(found, angle * TURN / before[:, None])


def _force(
    forced: FloatArray, start: ComplexArray, exponent: ComplexArray, u: FloatArray
) -> FloatArray:
    """``(b, turns, q)``: forced response ``(b, q)`` and vibration from ``start`` ``(b, turns)``."""
    fading = np.exp(exponent * u)
    parts = np.stack([fading.real, -fading.imag, forced], axis=1)
    force = np.stack([start.real, start.imag, np.ones(start.shape)], axis=2) @ parts
    coarse = exponent.imag[:, 0] * PER_PERIOD > TURN * u.size
    envelope = np.abs(start[coarse])[:, :, None] * np.abs(fading[coarse])[:, None, :]
    force[coarse] = forced[coarse][:, None, :] - envelope
    return np.asarray(force)


#: The first speed looked at, rpm, and the last, as a multiple of the printed one.
FIRST_RPM, LAST = 200.0, 1.3
#: Contact is lost far too early below this part of the printed speed.
EARLY = 0.9
#: Speeds about the printed one at which the time of the first loss is looked at, and at a time.
SPEEDS, TOGETHER = 501, 16
#: Points a turn there: 16 a period up to 3 kHz at 600 rpm.
POINTS = 4800
#: A solver of ordinary differential equations knows a speed, or a force, to the first part of it.
SOLVER, BEYOND = 1e-6, 1e-3


@dataclass(frozen=True)
class ReadRow:
    """What a reading makes of one cam.

    ``jump`` is the jump speed (rpm) at any speed, ``rpm`` the first of the table's grid at which
    contact is lost, and ``time`` (s) when it is first lost there, NaN where it is not; ``at_limit``
    and ``beyond`` (s) the same at speeds `SOLVER` and `BEYOND` of it above the jump speed;
    ``window`` the range of speeds (rpm) that give the printed time; ``force`` (N) the least of a
    run at the printed speed, which vibration would have to take from it.
    """

    cam: str
    printed: PublishedJump
    jump: float
    rpm: float
    time: float
    at_limit: float
    beyond: float
    window: float
    force: float

    @property
    def speed_holds(self) -> bool:
        """Whether the printed speed is the one that comes out."""
        return self.rpm == self.printed.rpm

    @property
    def time_holds(self) -> bool:
        """Whether the printed time comes out at the printed speed, within half a turn."""
        half_turn = 30.0 / self.printed.rpm
        return self.speed_holds and abs(self.time - self.printed.time_s) <= half_turn


@dataclass(frozen=True)
class Read:
    """A reading and what it makes of every cam."""

    name: str
    reading: TableReading
    rows: tuple[ReadRow, ...]

    @property
    def rms(self) -> float:
        """Of the jump speeds' relative differences to the printed ones, the r.m.s."""
        return rms([row.jump / row.printed.rpm - 1.0 for row in self.rows])

    @property
    def hidden(self) -> list[ReadRow]:
        """Rows with a jump between slower speeds of the grid, which shows a faster one."""
        return [row for row in self.rows if row.jump < row.rpm - ROUNDED_TO]

    @property
    def moved(self) -> int:
        """How many times change by half a turn or more from `SOLVER` to `BEYOND`."""
        return sum(not abs(row.at_limit - row.beyond) < 30.0 / row.jump for row in self.rows)

    @property
    def limit_times(self) -> int:
        """How many printed times come out just above the jump speed, within half a turn."""
        return sum(abs(row.at_limit - row.printed.time_s) <= 30.0 / row.jump for row in self.rows)

    @property
    def early(self) -> list[ReadRow]:
        """Rows with loss of contact far below the printed speed, on the grid."""
        return [row for row in self.rows if row.rpm < EARLY * row.printed.rpm]

    @property
    def speeds(self) -> int:
        """How many printed speeds come out."""
        return sum(row.speed_holds for row in self.rows)

    @property
    def times(self) -> int:
        """How many printed times do."""
        return sum(row.time_holds for row in self.rows)


#: The numbers of a follower behind its two masses.
OF_FOLLOWER = ("stem_stiffness", "spring_stiffness", "stem_damping", "damping", "preload")


def follower_of(reading: TableReading) -> TwoMassParameters:
    """The two-mass follower of a reading, with plastic landings."""
    roller = reading.mass.si * reading.roller_share.si
    numbers = (getattr(reading, name).si for name in OF_FOLLOWER)
    return TwoMassParameters(roller, reading.mass.si - roller, *numbers)


def read(
    name: str,
    reading: TableReading,
    cams: dict[str, CamConfig],
    printed: dict[str, PublishedJump],
    run: float,
) -> Read:
    """Every cam on a reading's rig, with its event angle and high dwell, in runs of ``run`` s."""
    follower = follower_of(reading)
    rows = []
    for cam, row in printed.items():
        law = build_law(with_event(cams[cam], reading.event.si, reading.high_dwell.si))
        rows.append(_row(cam, law, follower, row, run))
    return Read(name, reading, tuple(rows))


def first_on_grid(law: Law, follower: TwoMassParameters, last_rpm: float, run: float) -> float:
    """The first speed (rpm) of the grid at which a run from rest loses contact; NaN for none."""
    grid = np.arange(FIRST_RPM, last_rpm + 0.5 * ROUNDED_TO, ROUNDED_TO)
    force = force_run(law, follower, run)
    lost = (rpm for rpm in grid.tolist() if force.min_output(rpm * RPM) <= 0.0)
    return float(next(lost, math.nan))


def window(law: Law, follower: TwoMassParameters, printed: PublishedJump, run: float) -> float:
    """Over how many rpm within `ROUNDED_TO` the printed time comes out within half a turn."""
    shape, near = ShapeTable.of(law, POINTS), []
    speeds = RPM * np.linspace(printed.rpm - ROUNDED_TO, printed.rpm + ROUNDED_TO, SPEEDS)
    for few in np.array_split(speeds, SPEEDS // TOGETHER):
        spans = np.broadcast_to(law.spans, (few.size, law.spans.size))
        turns = math.ceil(run * to_rpm(float(few[-1])) / 60.0)
        force, angle = turn_minima(shape, spans, Rigs.of(follower, few.size), few, turns)
        lost = force <= 0.0
        first = lost.argmax(axis=1)
        times = (TURN * first + angle[np.arange(few.size), first]) / few
        near.append(lost.any(axis=1) & (np.abs(times - printed.time_s) <= 30.0 / printed.rpm))
    return 2.0 * ROUNDED_TO * float(np.concatenate(near).mean())


def _row(
    cam: str, law: Law, follower: TwoMassParameters, printed: PublishedJump, run: float
) -> ReadRow:
    rpm = first_on_grid(law, follower, LAST * printed.rpm, run)
    jump = find_jump_speed(law, follower, run, FIRST_RPM)
    speeds = rpm * RPM, jump * (1.0 + SOLVER), jump * (1.0 + BEYOND)
    there, at_limit, beyond = (_first_loss(law, follower, speed, run) for speed in speeds)
    near = window(law, follower, printed, run)
    force = force_run(law, follower, run).min_output(printed.rpm * RPM)
    return ReadRow(cam, printed, to_rpm(jump), rpm, there, at_limit, beyond, near, force)


def _first_loss(law: Law, follower: TwoMassParameters, speed: float, run: float) -> float:
    """When (s) contact is first lost; NaN where it is not."""
    if np.isnan(speed):
        return float("nan")
    found = first_lift_off(law, follower, speed, np.zeros(2), run)
    return float("nan") if found is None else found
