"""What is turned for a bounce map: a row a value of what is swept, with how loud it is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.acoustics import MicrophoneState, RadiationParameters, level_db, rms_pressure
from cam_rig.bounce.motion import IN_CONTACT, ONE_MASS, TWO_MASS, motion_of
from cam_rig.bounce.result import BounceRow
from cam_rig.bounce.sweep import OperatingPoint, Sweep
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.parameters import told
from cam_rig.dynamics.turn_map import ON_THE_CAM, State, StroboscopicMap, TurnsRun
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.simulation.simulate import TURN_RATE_HZ
from cam_rig.units import NS

#: Turns of which the level is the mean, at most, after one that begins the sound.
LEVEL_TURNS = 16


@dataclass(frozen=True)
class BounceRuns:
    """What is turned, how long, and how it is heard."""

    law: Law
    sweep: Sweep
    radiation: RadiationParameters | None  #: None where the rig does not tell it
    settle: int  #: turns before those that are kept
    turns: int  #: kept

    @classmethod
    def of(cls, law: Law, rig: RigConfig, sweep: Sweep, settle: int, turns: int) -> BounceRuns:
        """Those on a rig; it is heard where the rig tells how it sounds and what it lands with."""
        heard = rig.radiation is not None and rig.follower.stem_stiffness is not None
        sound = RadiationParameters.from_rig(rig) if heard else None
        return cls(law, sweep, sound, settle, turns)

    def row(self, value: float, begin: State = ON_THE_CAM) -> BounceRow:
        """What the follower does at a value (SI), from a state as `TurnsRun` has it."""
        point = self.sweep.at(value)
        turn_map = StroboscopicMap(self.law, point.parameters, point.speed)
        run = turn_map.run(self.settle + self.turns, begin)
        found = motion_of(turn_map, run, self.turns)
        shown = 1 if found.kind == IN_CONTACT else found.period or self.turns
        level, spread = self._level(point, turn_map, run, min(shown, LEVEL_TURNS))
        return BounceRow(
            point=point,
            motion=found.kind,
            period=found.period,
            landings_per_turn=float(run.landings[-(found.period or self.turns) :].mean()),
            rests=bool(run.on_cam[-self.turns :].any()),
            exponents=found.exponents,
            exponent_error=found.error,
            settled=found.settled,
            level_db=level,
            level_spread_db=spread,
            hardest=run.hardest[-shown:],
            states=run.states[-shown:],
        )

    def rows(self, values: Sequence[float]) -> list[BounceRow]:
        """The same at each of some values, from the cam."""
        return [self.row(one) for one in values]

    def _level(
        self, point: OperatingPoint, turn_map: StroboscopicMap, run: TurnsRun, turns: int
    ) -> tuple[float | None, float | None]:
        """Level (dB) of the last turns, and the loudest of them less the quietest."""
        if self.radiation is None:
            return None, None
        after = turn_map.follower(run.states[-turns - 2].tolist())
        # A landing lasts as the mass makes it: half a period on the stem.
        pulse = math.pi * math.sqrt(
            point.mass / told("stem_stiffness", point.parameters.stem_stiffness)
        )
        radiation = replace(self.radiation, contact_time=pulse)
        two = isinstance(point.parameters, TwoMassParameters)
        speed, advance = turn_map.speed, MODELS[TWO_MASS if two else ONE_MASS].advance
        sound: MicrophoneState | None = None
        turn, pressures = round(NS * turn_map.duration), []
        for i in range(turns + 1):
            interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
            after, block = advance(self.law, turn_map.parameters, after, interval, TURN_RATE_HZ)
            heard = block.force, block.impulse, TURN_RATE_HZ, speed
            sound, pressure = rms_pressure(radiation, sound, *heard)
            pressures.append(pressure)
        by_turn = np.array(pressures[1:])
        levels = level_db(by_turn)
        return float(level_db(math.sqrt(np.mean(by_turn**2)))), float(np.ptp(levels))
