"""The labs that there are: what each measures, what it asks, and what is true of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from statistics import NormalDist
from typing import Any, ClassVar

import numpy as np

from cam_rig.acoustics import RadiationParameters, SoundSource
from cam_rig.dynamics import MODELS, Block, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.free_masses import contact_response
from cam_rig.dynamics.jump.any_follower import (
    AnyFollower,
    contact_lost_speed,
    find_jump,
    follower_of,
)
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.dynamics.steady_rules import LAB_TURNS
from cam_rig.dynamics.vibration import fastest, residual_vibration, steady_turn
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.files import shown
from cam_rig.laws import Law
from cam_rig.panel.bench.live_state import FULL_SCALE_PA, MIN_RATE_HZ
from cam_rig.panel.lab.sheet import (
    CURVE,
    KNOB_FROM,
    KNOB_TO,
    LabReading,
    LabSetup,
    LabSheet,
    LabTurn,
    Span,
    drawn,
)
from cam_rig.quantities.steady import vibrating
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import cam_path, load_cam
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import NS, RPM, RPM_PER_RAD_S, TURN, FloatArray

# What one sees and hears of the rig at a speed: a turn of its steady state, and its contact.

#: Samples of the force a second, Hz; the sound has as many.
RATE_HZ = MIN_RATE_HZ
#: Points of a turn that are shown.
POINTS = 720
#: What the force sensor resolves, N.
RESOLUTION_N = 0.1


def observe(law: Law, follower: AnyFollower, radiation: RadiationParameters, rpm: float) -> LabTurn:
    """A turn of a follower at a speed (rpm): its force (N), and the sound."""
    speed = rpm * RPM
    blocks = _turns(law, follower, speed)
    block = blocks[-1]
    grid = block.interval.grid(RATE_HZ)
    angles = block.interval.angle + speed * grid.since_start()
    source = SoundSource(radiation, RATE_HZ, MIN_RATE_HZ)
    # Heard twice: the second time the structure is already in motion, and the ends meet.
    for _ in range(2):
        pressure = source.pressure(block.force, block.impulse, speed)
    seen = over_turn(angles, block.force, RESOLUTION_N)
    lost = len(blocks) > 1
    return LabTurn(lost, lost, seen, np.asarray(pressure / FULL_SCALE_PA))


def over_turn(angles: FloatArray, values: FloatArray, resolution: float) -> FloatArray:
    """``(POINTS,)`` of values at cam angles (rad) of a turn, as a sensor resolves them."""
    at = np.arange(POINTS) * (TURN / POINTS)
    read = np.interp(at, angles, values, period=TURN)
    return np.asarray(np.round(read / resolution)) * resolution


def _read(value: float, resolution: float) -> float:
    """A number as an instrument shows it."""
    return round(round(value / resolution) * resolution, 6)


def _turns(law: Law, follower: AnyFollower, speed: float) -> list[Block]:
    """One turn that keeps contact, or some in which it is lost."""
    model, state = MODELS["one_mass"], None
    if isinstance(follower, TwoMassParameters):  # from the steady state in which they are held
        model = MODELS["two_mass"]
        state = vibrating(contact_response(law, follower, speed).periodic())
    turn, blocks = round(TURN / speed * NS), list[Block]()
    for i in range(LAB_TURNS):
        # Each turn begins at angle 0: what a turn in whole nanoseconds leaves is not added up.
        interval = Interval(i * turn, (i + 1) * turn, 0.0, speed, turns=i)
        state, block = model.advance(law, follower, state, interval, RATE_HZ)
        blocks.append(block)
        if i == 0 and not any(event.kind == "lift-off" for event in block.events):
            break
    return blocks


#: By which part the numbers of a hidden rig may differ, where its stem is not what is asked for.
TOLERANCES = {"spring_stiffness": 0.08, "mass": 0.04, "preload": 0.15, "damping": 0.25}

# The jump speed of springs, masses and preloads.

#: rpm² of one unit of the plot: 400 rpm are 160.
SQUARE_RPM = 1000.0


class JumpSheet(LabSheet):
    """The lowest speed at which the follower leaves the cam, for springs, masses and preloads."""

    name = "jump"
    parts: ClassVar = {
        "spring_stiffness": (0.75, 1.0, 1.5),
        "added_mass": (0.0, 0.5, 1.0),
        "preload": (1.0, 2.0),
    }
    tolerances: ClassVar = TOLERANCES
    asked, unit, filled = "jump speed", "rpm", "preload"
    truth = "the lowest speed at which the steady state loses contact"

    def true(self, setup: LabSetup) -> float:
        """The jump speed (rpm): the lowest at which the steady state is off."""
        return _jump_rpm(self.law, follower_of(self.true_rig(setup, self.seed)))

    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """The force, by two masses where the rig says how they split.

        The lamp stays on above a speed at which contact was lost: between two resonances of the
        stem the follower may stay on again, but whoever comes from below has seen it leave.
        """
        rig = self.true_rig(setup, self.seed)
        radiation = RadiationParameters.from_rig(rig)
        seen = observe(self.law, follower_of(rig), radiation, rpm)
        return replace(seen, was_lost=seen.contact_lost or rpm > self.true(setup))

    @cached_property
    def knob(self) -> Span:
        """By what one rigid mass with the sheet's numbers does."""
        if not self.rig.follower.preload.si:
            raise ConfigError(
                f"lab {self.name!r}: rig {self.rig.name!r} has a preload of 0 N; allowed: above 0, "
                "for the sheet doubles it, and asks for it"
            )
        rigs = [self.true_rig(setup, None) for setup in self.setups]
        return _knob(self, [_rigid_rpm(self.law, rig) for rig in rigs], KNOB_TO)

    @cached_property
    def critical(self) -> tuple[float, float]:
        """S (m) and s'' (m/rad²) where a rigid follower without damping leaves the cam first."""
        own = FollowerParameters.from_rig(self.rig)
        _, angle = rigid_jump(self.law, replace(own, damping=0.0))
        lift, _, curvature = self.law.at(angle)
        return float(lift), float(curvature)

    def load(self, setup: LabSetup) -> float:
        """What presses the follower on, over its mass: (k s + preload) / m by the sheet, m/s²."""
        f = FollowerParameters.from_rig(self.true_rig(setup, None))
        return (f.spring_stiffness * self.critical[0] + f.preload) / f.mass

    @property
    def plot(self) -> tuple[Span, Span]:
        """n² over the load."""
        most = 50.0 * math.ceil(max(map(self.load, self.setups)) / 50.0)
        return (0.0, most), (0.0, self.knob[1] ** 2 / SQUARE_RPM)

    def point(self, reading: LabReading) -> tuple[float, float]:
        """The load (m/s²), and n² in 1000 rpm²."""
        return self.load(reading.setup), (reading.rpm or 0.0) ** 2 / SQUARE_RPM

    def theory(self) -> list[FloatArray]:
        """The straight line of one rigid mass."""
        slope = RPM_PER_RAD_S**2 / abs(self.critical[1]) / SQUARE_RPM
        return [slope * np.linspace(*self.plot[0], CURVE)]


def _rigid_rpm(law: Law, rig: RigConfig) -> float:
    return rigid_jump(law, FollowerParameters.from_rig(rig))[0] / RPM


def _knob(sheet: LabSheet, speeds: list[float], to: float) -> Span:
    """Ends (rpm) of a knob over these jump speeds."""
    if not (min(speeds) > 1.0 and math.isfinite(max(speeds))):
        cams = " and ".join(map(repr, sheet.cams))
        raise ConfigError(
            f"lab {sheet.name!r}: cam {cams} on rig {sheet.rig.name!r} has no jump "
            "speed; allowed: a cam on which contact is lost, and a rig with a preload"
        )
    return (
        10.0 * math.floor(0.1 * KNOB_FROM * min(speeds)),
        10.0 * math.ceil(0.1 * to * max(speeds)),
    )


#: One for each set-up of some sheets.
@lru_cache(maxsize=256)
def _jump_rpm(law: Law, follower: AnyFollower) -> float:
    return find_jump(law, follower, None).rpm


# The stem's natural frequency, of residual vibration over speed.

#: What the sensor on the stem resolves, µm.
RESOLUTION_UM = 0.1
#: Periods of the stem in a turn at the knob's end, at most: peaks lie 1/60 of the speed apart.
MOST_PERIODS = 60.0


class VibrationSheet(LabSheet):
    """The stem's natural frequency for several masses, of the peaks of its residual vibration.

    A mass on its stem that is held on the cam (eq. 5 of the paper). What a turn leaves of the free
    vibration adds to the next one's in phase where a whole number k of periods fills the turn: at
    speeds n = f/k. Of a law whose fall mirrors its rise every second one is missing.
    """

    name = "vibration"
    parts: ClassVar = {"added_mass": (0.0, 0.5, 1.0)}
    tolerances: ClassVar = {"stem_stiffness": 0.2, "mass": 0.04, "damping": 0.25}
    measured, answer = "residual_um", "frequency_Hz"
    asked, unit, heard = "natural frequency", "Hz", False
    truth = "√((k + k_stem)/m)/2π"

    def _follower(self, setup: LabSetup, seed: str | None) -> FollowerParameters:
        return FollowerParameters.on_stem(self.true_rig(setup, seed), "lab 'vibration'")

    def true(self, setup: LabSetup) -> float:
        """√((k + k_stem)/m)/2π, Hz."""
        return _stem_frequency(self._follower(setup, self.seed))

    @cached_property
    def held_to(self) -> dict[LabSetup, float]:
        """Speed (rpm) of each set-up above which the follower leaves the cam in truth."""
        return self._held_to(self.seed)

    def _held_to(self, seed: str | None) -> dict[LabSetup, float]:
        return {
            setup: contact_lost_speed(self.law, self.true_rig(setup, seed)) / RPM
            for setup in self.setups
        }

    @cached_property
    def knob(self) -> Span:
        """Where the follower is held on the cam, by the sheet's numbers."""
        followers = [self._follower(setup, None) for setup in self.setups]
        # of the hidden rig's stem, which may be softer, periods must fit in a turn too
        limit = 0.8 * min(map(fastest, followers))
        low, high = _knob(self, [min(n, limit) for n in self._held_to(None).values()], 1.0)
        periods = _stem_frequency(followers[0]) * 60.0 / high
        if periods > MOST_PERIODS:
            raise ConfigError(
                f"lab 'vibration': rig {self.rig.name!r}: {periods:.0f} periods of the stem in a "
                f"turn at {high:g} rpm; allowed: {MOST_PERIODS:g}, or peaks cannot be told apart; "
                "remedy: a rig with a softer stem, as paper_table2"
            )
        return low, high

    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """The stem's vibration (µm), and its residual amplitude in the low dwell."""
        if rpm > self.held_to[setup]:
            return LabTurn(contact_lost=True, was_lost=True)
        follower = self._follower(setup, self.seed)
        turn = steady_turn(self.law, follower, rpm * RPM)
        curve = over_turn(turn.angle, 1e6 * turn.vibration, RESOLUTION_UM)
        residual = 1e6 * float(residual_vibration(self.law, follower, np.array([rpm * RPM]))[0])
        return LabTurn(False, False, curve, measured=_read(residual, RESOLUTION_UM))

    @property
    def plot(self) -> tuple[Span, Span]:
        """Residual vibration over speed."""
        return self.knob, (0.0, 50.0)

    def point(self, reading: LabReading) -> tuple[float, float]:
        """Speed (rpm) and residual vibration (µm)."""
        return reading.rpm or 0.0, reading.measured or 0.0

    def theory(self) -> list[FloatArray]:
        """Residual vibration (µm) of each mass, up to where it leaves the cam."""
        rpm = np.linspace(*self.knob, CURVE)
        return [
            1e6 * residual_vibration(self.law, self._follower(setup, None), rpm[rpm <= most] * RPM)
            for setup, most in self._held_to(None).items()
        ]


def _stem_frequency(follower: FollowerParameters) -> float:
    return math.sqrt((follower.spring_stiffness + follower.stem) / follower.mass) / TURN


# The speed at which two cams are equally loud.

#: Standard deviation (dB) of a reading of the sound level meter: assumed, as no source prints it.
SCATTER_DB = 0.3
#: What the meter shows, dB.
RESOLUTION_DB = 0.1
#: Speeds over the knob at which a crossing is looked for, and halvings that then find it.
LOOKED_AT, HALVINGS = 80, 24


class NoiseSheet(LabSheet):
    """The lowest speed at which two cams are equally loud, by readings that scatter."""

    name = "noise"
    tolerances: ClassVar = TOLERANCES
    measured, answer = "level_dB", "crossing_rpm"
    asked, unit, marker, beside = "crossing speed", "rpm", "cam", "arcs_convex"
    truth = "the lowest speed at which both cams are equally loud, without the meter's scatter"
    within = 2.0

    @cached_property
    def options(self) -> dict[str, list[Any]]:
        """The two cams."""
        return {"cam": list(self.cams)}

    def level(self, cam: str, rpm: FloatArray, seed: str | None) -> FloatArray:
        """Levels (dB) of a cam at speeds, without scatter."""
        rig = self.true_rig(LabSetup(), seed)
        follower = FollowerParameters.from_rig(rig)
        turns = settled_turns(self.laws[cam], "one_mass", follower, rpm * RPM)
        return Acoustics(RadiationParameters.from_rig(rig)).levels(turns)

    def _louder(self, rpm: FloatArray) -> FloatArray:
        """By how much (dB) the second cam is louder than the first."""
        one, two = (self.level(cam, rpm, self.seed) for cam in self.cams)
        return two - one

    @cached_property
    def _crossing(self) -> float:
        rpm = np.linspace(*self.knob, LOOKED_AT)
        louder = self._louder(rpm) > 0.0
        changes = np.flatnonzero(louder[1:] != louder[:-1])
        if not changes.size:
            names = " and ".join(map(repr, self.cams))
            raise ConfigError(
                f"lab 'noise': cams {names} on rig {self.rig.name!r}: the same is the louder from "
                f"{rpm[0]:g} to {rpm[-1]:g} rpm; allowed: cams whose levels cross, as poly345 and "
                "arcs_convex on tm21"
            )
        i = int(changes[0])
        low, high = float(rpm[i]), float(rpm[i + 1])
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            as_low = bool(self._louder(np.array([middle]))[0] > 0.0) == bool(louder[i])
            low, high = (middle, high) if as_low else (low, middle)
        return low

    def true(self, setup: LabSetup) -> float:
        """The crossing (rpm), of the one set-up that there is."""
        return self._crossing

    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """The force, and the level as the meter reads it: it scatters from reading to reading."""
        cam, rig = setup.cam or self.cam.name, self.true_rig(setup, self.seed)
        follower, radiation = FollowerParameters.from_rig(rig), RadiationParameters.from_rig(rig)
        seen = observe(self.laws[cam], follower, radiation, rpm)
        words = f"meter {number} {cam} {rpm:.2f}"
        part = 0.5 * drawn(self.name, self.seed or "", words, 1.0)
        level = float(self.level(cam, np.array([rpm]), self.seed)[0])
        level += SCATTER_DB * NormalDist().inv_cdf(part)
        return replace(seen, measured=_read(level, RESOLUTION_DB))

    @cached_property
    def knob(self) -> Span:
        """From half the lower to the higher of the jump speeds by the sheet's numbers."""
        return _knob(self, [_rigid_rpm(law, self.rig) for law in self.laws.values()], 1.0)

    @property
    def plot(self) -> tuple[Span, Span]:
        """Level over speed."""
        return self.knob, (70.0, 90.0)

    def point(self, reading: LabReading) -> tuple[float, float]:
        """Speed (rpm) and level (dB)."""
        return reading.rpm or 0.0, reading.measured or 0.0

    def theory(self) -> list[FloatArray]:
        """Each cam's level (dB)."""
        rpm = np.linspace(*self.knob, CURVE)
        return [self.level(cam, rpm, None) for cam in self.cams]


#: By the names that are given to --lab; a page has the task of each in its texts.
LABS: dict[str, type[LabSheet]] = {
    sheet.name: sheet for sheet in (JumpSheet, VibrationSheet, NoiseSheet)
}


def lab_of(name: str) -> type[LabSheet]:
    """The lab of a name."""
    if name not in LABS:
        like = did_you_mean(name, LABS)
        raise ConfigError(f"--lab: is {shown(name)}; allowed: {', '.join(LABS)}{like}")
    return LABS[name]


def lab_sheet(
    name: str, cams: Sequence[CamConfig], rig: RigConfig, seed: str | None = None
) -> LabSheet:
    """The sheet of a lab; one that compares two cams takes a shipped one beside a single one."""
    lab = lab_of(name)
    own = list(cams)
    if lab.beside and len(own) == 1:
        own.append(load_cam(cam_path(lab.beside)))
    names, count = [cam.name for cam in own], 2 if lab.beside else 1
    if not len(set(names)) == len(names) == count:
        words = "two that differ" if lab.beside else "one"
        raise ConfigError(f"cam: is {' '.join(names)}; allowed in lab {name!r}: {words}")
    return lab(own[0], rig, seed, own[1] if lab.beside else None)
