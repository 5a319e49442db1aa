"""Bounce maps: what a follower does above its jump speed, turn after turn, over what is swept."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.acoustics import MicrophoneState, RadiationParameters, level_db, rms_pressure
from cam_rig.arguments import checked
from cam_rig.bounce.branches import Branch, branches
from cam_rig.bounce.motion import IN_CONTACT, ONE_MASS, SEEN, TWO_MASS, bouncing, motion_of
from cam_rig.bounce.result import ABOVE, BEGUN, REST, BounceMap, BounceRow
from cam_rig.bounce.sweep import RESTITUTION, SPEED, SWEPT, OperatingPoint, Sweep
from cam_rig.dynamics import MODELS, Interval, TwoMassParameters
from cam_rig.dynamics.events.search import expect_many
from cam_rig.dynamics.parameters import told
from cam_rig.dynamics.turn_map import ON_THE_CAM, State, StroboscopicMap, TurnsRun
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import SILENT, Progress
from cam_rig.simulation.asked import MAX_SPEEDS, Speeds, asked_speeds, speeds_within
from cam_rig.simulation.simulate import TURN_RATE_HZ
from cam_rig.units import NS, RPM

#: Turns of which the level is the mean, at most, after one that begins the sound.
LEVEL_TURNS = 16
#: Rows that are sent to a process together.
TOGETHER = 4
#: Fewest turns that can be told to be periodic or not.
LEAST_TURNS = 5 * SEEN
#: Most turns of a row: some 40 s, 240 MB.
MOST_TURNS = 2_000_000


@dataclass(frozen=True)
class BounceRuns:
    """What is turned, how long, and how it is heard."""

    law: Law
    sweep: Sweep
    radiation: RadiationParameters | None  #: None where the rig does not tell it
    settle: int  #: turns before those that are kept
    turns: int  #: kept

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


@checked
def bounce_map(
    law: Law,
    rig: RigConfig,
    *,
    rpm: Speeds,
    restitution: float | None = None,
    model: str = ONE_MASS,
    over: str = SPEED,
    values: Speeds | None = None,
    turns: int = 200,
    settle: int = 300,
    start: str = REST,
    follow: bool = False,
    executor: Executor | None = None,
    progress: Progress = SILENT,
) -> BounceMap:
    """What a follower does above its jump speed, turn after turn: at rest, periodic or irregular.

    Impacts are roots and flights closed forms, so each turn's derivative is exact, and the Lyapunov
    exponent is no estimate from a time series. Where its error hides zero, it is "not told".

    Parameters
    ----------
    rpm : cam speeds; one where something else is swept
    restitution : of a landing, from 0 to below 1; None is the rig's
    model : ``one_mass``, rigid; or ``two_mass``, a roller and an end mass on an elastic stem
    over : what is swept: ``rpm``, or at one speed ``restitution``, ``preload`` or ``mass``
    values : of what is swept where that is no speed: none, N or kg
    turns : kept in each row
    settle : turns before these
    start : ``rest``: each row from the cam; ``below`` or ``above``: where the row below or above
        has ended, which shows hysteresis
    follow : follow each periodic motion that is met in one of the rows, and does not rest, over
        all of them, stable or not, and find where it changes; more rows meet more motions
    executor : where the rows of ``rest`` are computed; None is this process
    progress : told how far it is

    Raises
    ------
    ConfigError : an argument out of range, or the rig tells no restitution
    DynamicsError : a restitution or a speed that is none, or a turn of more than 10 000 landings

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law(cam_rig.load_cam("tm21"))
    >>> rig = cam_rig.load_rig("tm21")
    >>> found = cam_rig.bounce_map(law, rig, rpm=[420, 450], restitution=0.7, turns=40, settle=60)
    >>> [row.motion for row in found.rows]
    ['irregular', 'periodic']
    """
    sweep, swept = _sweep(rig, model, speeds_within(rpm), restitution, over, values)
    _check(len(swept), turns, settle, start, follow)
    heard = rig.radiation is not None and rig.follower.stem_stiffness is not None
    sound = RadiationParameters.from_rig(rig) if heard else None
    runs = BounceRuns(law, sweep, sound, settle, turns)
    expect_many()
    progress.begin(len(swept), law.name)
    chained = swept[::-1] if start == ABOVE else swept
    chain = _from_rest(runs, swept, executor) if start == REST else _continued(runs, chained)
    found = []
    for row in chain:
        found.append(row)
        progress.advance()
    found.sort(key=lambda row: sweep.value(row.point))
    lines = _followed(runs, found, progress) if follow else ()
    return BounceMap(law, rig, sweep, start, sweep.lift_off(law, swept), tuple(found), lines)


def _sweep(
    rig: RigConfig,
    model: str,
    rpm: list[float],
    restitution: float | None,
    over: str,
    values: Speeds | None,
) -> tuple[Sweep, list[float]]:
    """What is swept, and its values, SI, that rise."""
    if model not in (ONE_MASS, TWO_MASS):
        raise ConfigError(f"model: is {model!r}; allowed: {ONE_MASS}, {TWO_MASS}")
    if over not in SWEPT:
        raise ConfigError(f"over: is {over!r}; allowed: {', '.join(SWEPT)}")
    if over == SPEED and values is not None:
        raise ConfigError(
            "values: are of what is swept at one speed; allowed: over another than rpm"
        )
    if over == SPEED:
        swept = sorted(one * RPM for one in rpm)
        return Sweep(OperatingPoint(bouncing(rig, restitution, model), swept[0])), swept
    if len(rpm) > 1:
        raise ConfigError(f"rpm: are {len(rpm)} speeds over {over}; allowed: one speed")
    swept = [] if values is None else sorted(asked_speeds(values))
    if not 1 <= len(swept) <= MAX_SPEEDS:
        raise ConfigError(f"values: are {len(swept)} of {over}; allowed: 1 to {MAX_SPEEDS}")
    if over == RESTITUTION:
        if restitution is not None:
            raise ConfigError("restitution: is what is swept; allowed: its values alone")
        restitution = swept[0]
    sweep = Sweep(OperatingPoint(bouncing(rig, restitution, model), rpm[0] * RPM), over)
    for one in swept:  # one that is none is refused before any is turned
        sweep.at(one)
    return sweep, swept


def _followed(
    runs: BounceRuns, rows: Sequence[BounceRow], progress: Progress
) -> tuple[Branch, ...]:
    """The branches of the periodic motions of some rows, over all of them."""
    progress.tell("periodic motions")
    sweep = runs.sweep
    free = [row for row in rows if row.period is not None and not row.rests]
    seen = [(sweep.value(row.point), row.end, row.period or 1) for row in free]
    low, high = (sweep.value(rows[i].point) for i in (0, -1))
    return branches(runs.law, sweep, seen, low, high)


def _check(rows: int, turns: int, settle: int, start: str, follow: bool) -> None:
    """Refuse arguments out of range."""
    if start not in BEGUN:
        raise ConfigError(f"start: is {start!r}; allowed: {', '.join(BEGUN)}")
    if turns < LEAST_TURNS:
        raise ConfigError(f"turns: is {turns}; allowed: {LEAST_TURNS} or more")
    if settle < 0:
        raise ConfigError(f"settle: is {settle}; allowed: 0 or more turns")
    if follow and rows < 2:
        raise ConfigError("follow: over one value; allowed: two or more, as 385:480:5")
    if settle + turns > MOST_TURNS:
        raise ConfigError(
            f"turns: are {turns} after {settle} to settle; allowed: {MOST_TURNS} together"
        )


def _from_rest(
    runs: BounceRuns, values: Sequence[float], executor: Executor | None
) -> Iterator[BounceRow]:
    if executor is None:
        yield from map(runs.row, values)
        return
    parts = [values[i : i + TOGETHER] for i in range(0, len(values), TOGETHER)]
    sent: list[Future[list[BounceRow]]] = [executor.submit(runs.rows, part) for part in parts]
    for one in sent:
        yield from one.result()


def _continued(runs: BounceRuns, values: Sequence[float]) -> Iterator[BounceRow]:
    begin: State = ON_THE_CAM
    for one in values:
        row = runs.row(one, begin)
        begin = row.end
        yield row
