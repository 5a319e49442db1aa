"""Labs of the panel: set-ups, observations, question and true answer of each."""

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
    find_contact_loss_speed,
    find_jump,
    follower_of,
)
from cam_rig.dynamics.jump.rigid_mass import rigid_jump
from cam_rig.dynamics.steady_rules import LAB_TURNS
from cam_rig.dynamics.vibration import find_max_rpm, residual_vibration, steady_turn
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.files import shorten
from cam_rig.laws import Law
from cam_rig.panel.bench.live_state import FULL_SCALE_PA, MIN_RATE_HZ
from cam_rig.panel.lab.sheet import (
    CURVE_POINTS,
    LabReading,
    LabSetup,
    LabSheet,
    LabTurn,
    Span,
    hidden_factor,
)
from cam_rig.quantities.steady import vibrating_state
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.load import cam_path, load_cam
from cam_rig.simulation.simulate import Acoustics, simulate_steady_turns
from cam_rig.units import NS, RPM, RPM_PER_RAD_S, TURN, FloatArray

# Observation of the rig at a speed: contact force and sound over one turn of the steady state.

#: Sample rate (Hz) of the force and of the sound.
RATE_HZ = MIN_RATE_HZ
#: Number of points of a turn that is displayed.
TURN_POINTS = 720
#: Resolution of the simulated force sensor of a lab, N.
RESOLUTION_N = 0.1
#: Resolution of the lift in the picture, mm: less than the width of a line.
DRAWN_LIFT_MM = 0.01
#: Resolution of the gap in the picture, µm.
DRAWN_GAP_UM = 1.0
#: Lowest speed of the knob, as a fraction of the lowest expected jump speed.
KNOB_FROM = 0.5
#: Highest speed of the speed knob, as a multiple of the highest expected jump speed.
KNOB_TO = 1.25


def observe(law: Law, follower: AnyFollower, radiation: RadiationParameters, rpm: float) -> LabTurn:
    """Return the turn at a speed (rpm) as the sensors of a lab observe it.

    The result contains the contact force (N) over the turn, the sound, and whether contact was
    lost.
    """
    speed = rpm * RPM
    blocks = _turns(law, follower, speed)
    block = blocks[-1]
    grid = block.interval.grid(RATE_HZ)
    angles = block.interval.angle + speed * grid.sample_times()
    source = SoundSource(radiation, RATE_HZ, MIN_RATE_HZ)
    # The second pass starts with the structure in motion, so that the sound is periodic.
    for _ in range(2):
        pressure = source.pressure(block.force, block.impulse, speed)
    curve = over_turn(angles, block.force, RESOLUTION_N)
    is_lost = len(blocks) > 1
    gap = np.where(block.force > 0.0, 0.0, np.maximum(block.lift - law(angles), 0.0))
    return LabTurn(
        contact_lost=is_lost,
        was_lost=is_lost,
        curve=curve,
        sound=np.asarray(pressure / FULL_SCALE_PA),
        lift=over_turn(angles, 1e3 * (law(angles) + gap), DRAWN_LIFT_MM),
        gap=over_turn(angles, 1e6 * gap, DRAWN_GAP_UM),
    )


def over_turn(angles: FloatArray, values: FloatArray, resolution: float) -> FloatArray:
    """Return the values of a turn as a sensor with a resolution shows them.

    The result has the shape ``(TURN_POINTS,)``, at equal steps of the cam angle. `angles` are those
    of the values, rad.
    """
    grid = np.arange(TURN_POINTS) * (TURN / TURN_POINTS)
    sampled = np.interp(grid, angles, values, period=TURN)
    return np.asarray(np.round(sampled / resolution)) * resolution


def _round_to(value: float, resolution: float) -> float:
    """Return a number as an instrument with this resolution displays it."""
    return round(round(value / resolution) * resolution, 6)


def _turns(law: Law, follower: AnyFollower, speed: float) -> list[Block]:
    """Return the simulated turns of a follower at a speed (rad/s).

    There is one turn if contact is kept, else `LAB_TURNS` turns, of which the last is observed.
    """
    model, state = MODELS["one_mass"], None
    if isinstance(follower, TwoMassParameters):  # start from the steady state in contact
        model = MODELS["two_mass"]
        state = vibrating_state(contact_response(law, follower, speed).periodic())
    turn, blocks = round(TURN / speed * NS), list[Block]()
    for i in range(LAB_TURNS):
        # Each turn starts at angle 0, so that the rounding to nanoseconds does not accumulate.
        interval = Interval(i * turn, (i + 1) * turn, 0.0, speed, turns=i)
        state, block = model.advance(law, follower, state, interval, RATE_HZ)
        blocks.append(block)
        if i == 0 and not any(event.kind == "lift-off" for event in block.events):
            break
    return blocks


#: Largest relative differences between the numbers of the hidden rig and those on the sheet, in
#: labs whose question does not concern the stem.
TOLERANCES = {"spring_stiffness": 0.08, "mass": 0.04, "preload": 0.15, "damping": 0.25}

# Lab of the jump speed for several springs, masses and preloads.

#: Unit of the y axis of the plot of squared speeds, rpm²: 400 rpm is plotted at 160.
SQUARE_RPM = 1000.0


class JumpSheet(LabSheet):
    """Lab of the lowest speed at which the follower leaves the cam.

    Springs, masses and preloads are varied.
    """

    name = "jump"
    multiples: ClassVar = {
        "spring_stiffness": (0.75, 1.0, 1.5),
        "added_mass": (0.0, 0.5, 1.0),
        "preload": (1.0, 2.0),
    }
    tolerances: ClassVar = TOLERANCES
    question, unit, filled = "jump speed", "rpm", "preload"
    truth = "the lowest speed at which the steady state loses contact"

    def true(self, setup: LabSetup) -> float:
        """Return the jump speed (rpm): the lowest at which the steady state loses contact."""
        return _jump_rpm(self.law, follower_of(self.true_rig(setup, self.seed)))

    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """Return the observed turn at a speed (rpm).

        The model has two masses if the rig splits its mass. The field `was_lost` switches on the
        lamp of the page, also at speeds above one at which contact was lost. Between two resonances
        of the stem the follower may be in contact again, but on the way up to this speed it has
        left the cam before.
        """
        rig = self.true_rig(setup, self.seed)
        radiation = RadiationParameters.from_rig(rig)
        turn = observe(self.law, follower_of(rig), radiation, rpm)
        return replace(turn, was_lost=turn.contact_lost or rpm > self.true(setup))

    @cached_property
    def knob(self) -> Span:
        """Range of the speed knob, rpm.

        It follows from the jump speeds of one rigid mass with the numbers on the sheet.
        """
        if not self.rig.follower.preload.si:
            raise ConfigError(
                f"lab {self.name!r}: rig {self.rig.name!r} has a preload of 0 N; allowed: above 0, "
                "because the sheet varies it"
            )
        rigs = [self.true_rig(setup, None) for setup in self.setups]
        return _knob_range(self, [_rigid_rpm(self.law, rig) for rig in rigs], KNOB_TO)

    @cached_property
    def critical(self) -> tuple[float, float]:
        """Lift (m) and s'' (m/rad²) at the critical angle of the cam.

        A rigid follower without damping leaves the cam there first.
        """
        follower = FollowerParameters.from_rig(self.rig)
        _, angle = rigid_jump(self.law, replace(follower, damping=0.0))
        lift, _, curvature = self.law.at(angle)
        return float(lift), float(curvature)

    def load(self, setup: LabSetup) -> float:
        """Return the closing acceleration (k s + preload)/m (m/s²) of a set-up.

        It is computed from the numbers on the sheet.
        """
        f = FollowerParameters.from_rig(self.true_rig(setup, None))
        return (f.spring_stiffness * self.critical[0] + f.preload) / f.mass

    @property
    def plot(self) -> tuple[Span, Span]:
        """Ranges of the plot: load (m/s²), and square of the speed n² (1000 rpm²)."""
        max_load = 50.0 * math.ceil(max(map(self.load, self.setups)) / 50.0)
        return (0.0, max_load), (0.0, self.knob[1] ** 2 / SQUARE_RPM)

    def point(self, reading: LabReading) -> tuple[float, float]:
        """Return the position of a reading in the plot: load (m/s²) and n² (1000 rpm²)."""
        return self.load(reading.setup), (reading.rpm or 0.0) ** 2 / SQUARE_RPM

    def theory(self) -> list[FloatArray]:
        """Return the theoretical curve of the plot, the straight line of one rigid mass."""
        slope = RPM_PER_RAD_S**2 / abs(self.critical[1]) / SQUARE_RPM
        return [slope * np.linspace(*self.plot[0], CURVE_POINTS)]


def _rigid_rpm(law: Law, rig: RigConfig) -> float:
    return rigid_jump(law, FollowerParameters.from_rig(rig))[0] / RPM


def _knob_range(sheet: LabSheet, speeds: list[float], max_factor: float) -> Span:
    """Return the range of the speed knob (rpm) for given jump speeds (rpm).

    It is from `KNOB_FROM` times the lowest to `max_factor` times the highest speed, rounded
    outwards to 10 rpm. Raises ConfigError if a cam has no jump speed.
    """
    if not (min(speeds) > 1.0 and math.isfinite(max(speeds))):
        cams = " and ".join(map(repr, sheet.cams))
        raise ConfigError(
            f"lab {sheet.name!r}: cam {cams} on rig {sheet.rig.name!r} has no jump "
            "speed; allowed: a cam on which contact is lost, and a rig with a preload"
        )
    return (
        10.0 * math.floor(0.1 * KNOB_FROM * min(speeds)),
        10.0 * math.ceil(0.1 * max_factor * max(speeds)),
    )


# The cache has room for all set-ups of several sheets.
@lru_cache(maxsize=256)
def _jump_rpm(law: Law, follower: AnyFollower) -> float:
    return find_jump(law, follower, None).rpm


# Lab of the natural frequency of the stem, from the residual vibration over speed.

#: Resolution of the simulated sensor on the stem, µm.
RESOLUTION_UM = 0.1
#: Largest number of periods of the stem per turn at the highest speed of the knob. The speeds of
#: neighbouring peaks then differ by at least 1/60.
MAX_PERIODS_PER_TURN = 60.0


class VibrationSheet(LabSheet):
    """Lab of the natural frequency of the stem for several masses.

    A mass on its stem stays in contact with the cam (eq. 5 of the paper). The free vibration that
    remains after a turn adds in phase to that of the next turn if a whole number k of periods fills
    the turn, which is at the speeds n = f/k. The residual vibration has its peaks there. If the
    fall of a law mirrors its rise, every second peak is missing.
    """

    name = "vibration"
    multiples: ClassVar = {"added_mass": (0.0, 0.5, 1.0)}
    tolerances: ClassVar = {"stem_stiffness": 0.2, "mass": 0.04, "damping": 0.25}
    measured, answer = "residual_um", "frequency_Hz"
    question, unit, has_sound, shows_force = "natural frequency", "Hz", False, False
    truth = "√((k + k_stem)/m)/2π"

    def _follower(self, setup: LabSetup, seed: str | None) -> FollowerParameters:
        return FollowerParameters.on_stem(self.true_rig(setup, seed), "lab 'vibration'")

    def true(self, setup: LabSetup) -> float:
        """Return the natural frequency √((k + k_stem)/m)/2π, Hz."""
        return _stem_frequency(self._follower(setup, self.seed))

    @cached_property
    def contact_lost_rpm(self) -> dict[LabSetup, float]:
        """True speed (rpm) above which the follower leaves the cam, for each set-up."""
        return self._contact_limits(self.seed)

    def _contact_limits(self, seed: str | None) -> dict[LabSetup, float]:
        return {
            setup: find_contact_loss_speed(self.law, self.true_rig(setup, seed)) / RPM
            for setup in self.setups
        }

    @cached_property
    def knob(self) -> Span:
        """Range of the speed knob, rpm, in which contact is kept.

        It is computed from the numbers on the sheet.
        """
        followers = [self._follower(setup, None) for setup in self.setups]
        # the stem of the hidden rig may be softer, and its periods must fit in a turn too
        limit = 0.8 * min(map(find_max_rpm, followers))
        speeds = [min(rpm, limit) for rpm in self._contact_limits(None).values()]
        low, high = _knob_range(self, speeds, 1.0)
        periods = _stem_frequency(followers[0]) * 60.0 / high
        if periods > MAX_PERIODS_PER_TURN:
            raise ConfigError(
                f"lab 'vibration': rig {self.rig.name!r}: {periods:.0f} periods of the stem in a "
                f"turn at {high:g} rpm; allowed: {MAX_PERIODS_PER_TURN:g}, so that peaks "
                "are separate; use a rig with a softer stem, such as paper_table2"
            )
        return low, high

    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """Return the observed turn: the stem's vibration (µm) and its residual amplitude.

        The residual amplitude (µm) is that in the low dwell.
        """
        if rpm > self.contact_lost_rpm[setup]:
            return LabTurn(contact_lost=True, was_lost=True)
        follower = self._follower(setup, self.seed)
        turn = steady_turn(self.law, follower, rpm * RPM)
        curve = over_turn(turn.angle, 1e6 * turn.vibration, RESOLUTION_UM)
        residual = 1e6 * float(residual_vibration(self.law, follower, np.array([rpm * RPM]))[0])
        lift = over_turn(turn.angle, 1e3 * self.law(turn.angle), DRAWN_LIFT_MM)
        shown = _round_to(residual, RESOLUTION_UM)
        return LabTurn(False, False, curve, measured=shown, lift=lift, gap=np.zeros_like(lift))

    @property
    def plot(self) -> tuple[Span, Span]:
        """Ranges of the plot: speed (rpm) and residual vibration (µm)."""
        return self.knob, (0.0, 50.0)

    def point(self, reading: LabReading) -> tuple[float, float]:
        """Return the position of a reading in the plot: speed (rpm) and vibration (µm).

        The vibration is the residual vibration.
        """
        return reading.rpm or 0.0, reading.measured or 0.0

    def theory(self) -> list[FloatArray]:
        """Return the plot's theoretical curves of residual vibration (µm), one per mass.

        They end at the loss of contact.
        """
        rpm = np.linspace(*self.knob, CURVE_POINTS)
        return [
            1e6 * residual_vibration(self.law, self._follower(setup, None), rpm[rpm <= limit] * RPM)
            for setup, limit in self._contact_limits(None).items()
        ]


def _stem_frequency(follower: FollowerParameters) -> float:
    return math.sqrt((follower.spring_stiffness + follower.stem) / follower.mass) / TURN


# Lab of the speed at which two cams are equally loud.

#: Standard deviation of a reading of the sound-level meter, dB. It is assumed, because no source
#: states it.
SCATTER_DB = 0.3
#: Resolution of the simulated sound-level meter, dB.
RESOLUTION_DB = 0.1
#: Number of speeds over the range of the knob at which the levels are compared to locate a
#: crossing.
CROSSING_SPEEDS = 80
#: Number of bisections that refine the speed of the crossing.
BISECTIONS = 24


class NoiseSheet(LabSheet):
    """Lab of the lowest speed at which two cams are equally loud.

    The readings of the sound-level meter scatter.
    """

    name = "noise"
    tolerances: ClassVar = TOLERANCES
    measured, answer = "level_dB", "crossing_rpm"
    question, unit, marker, default_other_cam = "crossing speed", "rpm", "cam", "arcs_convex"
    truth = "the lowest speed at which both cams are equally loud, without the meter's scatter"
    default_tolerance = 2.0

    @cached_property
    def options(self) -> dict[str, list[Any]]:
        """Options of a set-up: the names of the two cams."""
        return {"cam": list(self.cams)}

    def level(self, cam: str, rpm: FloatArray, seed: str | None) -> FloatArray:
        """Return the sound levels (dB) of a cam at speeds (rpm), without scatter."""
        rig = self.true_rig(LabSetup(), seed)
        follower = FollowerParameters.from_rig(rig)
        turns = simulate_steady_turns(self.laws[cam], "one_mass", follower, rpm * RPM)
        return Acoustics(RadiationParameters.from_rig(rig)).levels(turns)

    def _level_difference(self, rpm: FloatArray) -> FloatArray:
        """Return the sound level (dB) of the second cam minus that of the first."""
        first, second = (self.level(cam, rpm, self.seed) for cam in self.cams)
        return second - first

    @cached_property
    def _crossing(self) -> float:
        rpm = np.linspace(*self.knob, CROSSING_SPEEDS)
        is_louder = self._level_difference(rpm) > 0.0
        changes = np.flatnonzero(is_louder[1:] != is_louder[:-1])
        if not changes.size:
            names = " and ".join(map(repr, self.cams))
            raise ConfigError(
                f"lab 'noise': cams {names} on rig {self.rig.name!r}: the same cam is louder from "
                f"{rpm[0]:g} to {rpm[-1]:g} rpm; allowed: cams whose levels cross, such as poly345 "
                "and arcs_convex on tm21"
            )
        i = int(changes[0])
        low, high = float(rpm[i]), float(rpm[i + 1])
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            is_below = bool(self._level_difference(np.array([middle]))[0] > 0.0) == is_louder[i]
            low, high = (middle, high) if is_below else (low, middle)
        return low

    def true(self, setup: LabSetup) -> float:
        """Return the speed (rpm) of equal levels, which does not depend on the set-up."""
        return self._crossing

    def turn(self, setup: LabSetup, rpm: float, number: int) -> LabTurn:
        """Return the observed turn: the force, and the level (dB) that the meter displays.

        The level scatters from reading to reading. Equal reading numbers give equal scatter.
        """
        cam, rig = setup.cam or self.cam.name, self.true_rig(setup, self.seed)
        follower, radiation = FollowerParameters.from_rig(rig), RadiationParameters.from_rig(rig)
        turn = observe(self.laws[cam], follower, radiation, rpm)
        key = f"meter {number} {cam} {rpm:.2f}"
        probability = 0.5 * hidden_factor(self.name, self.seed or "", key, 1.0)
        level = float(self.level(cam, np.array([rpm]), self.seed)[0])
        level += SCATTER_DB * NormalDist().inv_cdf(probability)
        return replace(turn, measured=_round_to(level, RESOLUTION_DB))

    @cached_property
    def knob(self) -> Span:
        """Range of the speed knob (rpm), from half the lower to the higher jump speed.

        The jump speeds are those of one rigid mass with the numbers on the sheet.
        """
        return _knob_range(self, [_rigid_rpm(law, self.rig) for law in self.laws.values()], 1.0)

    @property
    def plot(self) -> tuple[Span, Span]:
        """Ranges of the plot: speed (rpm) and sound level (dB)."""
        return self.knob, (70.0, 90.0)

    def point(self, reading: LabReading) -> tuple[float, float]:
        """Return the position of a reading in the plot: speed (rpm) and sound level (dB)."""
        return reading.rpm or 0.0, reading.measured or 0.0

    def theory(self) -> list[FloatArray]:
        """Return the theoretical curves of the plot: the sound levels (dB) of each cam."""
        rpm = np.linspace(*self.knob, CURVE_POINTS)
        return [self.level(cam, rpm, None) for cam in self.cams]


#: Lab sheets by the name that `cam-rig lab` accepts. The text of each task is in the page's texts.
LABS: dict[str, type[LabSheet]] = {
    sheet.name: sheet for sheet in (JumpSheet, VibrationSheet, NoiseSheet)
}


def lab_of(name: str) -> type[LabSheet]:
    """Return the lab with a name.

    Raises
    ------
    ConfigError
        If there is no such lab.
    """
    if name not in LABS:
        hint = did_you_mean(name, LABS)
        raise ConfigError(f"lab: is {shorten(name)}; allowed: {', '.join(LABS)}{hint}")
    return LABS[name]


def lab_sheet(
    name: str, cams: Sequence[CamConfig], rig: RigConfig, seed: str | None = None
) -> LabSheet:
    """Return the sheet of a lab.

    Parameters
    ----------
    name : str
        Name of the lab, a key of `LABS`.
    cams : sequence of CamConfig
        One cam. A lab that compares two cams accepts two, and adds a shipped cam to a single one.
    rig : RigConfig
        Rig with the numbers on the sheet.
    seed : str or None
        Name of the hidden rig that is measured, or None for `rig` itself (default).

    Returns
    -------
    LabSheet
        The sheet.

    Raises
    ------
    ConfigError
        If the lab, the cams or the seed are not allowed.
    """
    lab = lab_of(name)
    sheet_cams = list(cams)
    if lab.default_other_cam and len(sheet_cams) == 1:
        sheet_cams.append(load_cam(cam_path(lab.default_other_cam)))
    names, count = [cam.name for cam in sheet_cams], 2 if lab.default_other_cam else 1
    if not len(set(names)) == len(names) == count:
        rule = "two different cams" if lab.default_other_cam else "one cam"
        raise ConfigError(f"cam: is {' '.join(names)}; allowed in lab {name!r}: {rule}")
    return lab(sheet_cams[0], rig, seed, sheet_cams[1] if lab.default_other_cam else None)
