"""Bounce maps: what a follower does at each speed above its jump speed, turn after turn."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cam_rig.acoustics import MicrophoneState, RadiationParameters, level_db, rms_pressure
from cam_rig.arguments import checked
from cam_rig.bounce.branches import LIFT_OFF, WORDS, Bifurcation, Branch, branches
from cam_rig.bounce.motion import (
    IN_CONTACT,
    IRREGULAR,
    NOT_TOLD,
    PERIODIC,
    SEEN,
    bouncing,
    motion_of,
)
from cam_rig.dynamics import MODELS, FollowerState, Interval
from cam_rig.dynamics.events.search import expect_many
from cam_rig.dynamics.jump.jump_speed import rigid_jump
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.dynamics.turn_map import ON_THE_CAM, StroboscopicMap, TurnsRun
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.show.result import SILENT, Arrays, Column, Footnote, Progress, Records, Result
from cam_rig.simulation.asked import Speeds, speeds_within
from cam_rig.simulation.simulate import TURN_RATE_HZ
from cam_rig.units import NS, RPM, FloatArray

#: Where each speed begins: on the cam, or where the speed below, or above, has ended.
REST, BELOW, ABOVE = "rest", "below", "above"
#: Turns of which the level is the mean, at most, after one that begins the sound.
LEVEL_TURNS = 16
#: Speeds that are sent to a process together.
TOGETHER = 4
#: Fewest turns that can be told to be periodic or not.
LEAST_TURNS = 5 * SEEN
#: Most turns at a speed: some 40 s, 240 MB.
MOST_TURNS = 2_000_000


@dataclass(frozen=True, eq=False)
class BounceRow:
    """What the follower does at one speed; `TurnMotion` says what each is."""

    rpm: float
    motion: str
    period: int | None
    landings_per_turn: float
    rests: bool  #: whether it comes to rest on the cam in the turns that are kept
    exponent: float
    exponent_error: float
    settled: int | None
    level_db: float | None
    level_spread_db: float | None  #: loudest less quietest turn
    hardest: FloatArray  #: ``(n,)`` m/s of each turn's fastest landing: of a period, or all kept
    states: FloatArray  #: ``(n, 2)`` gap (m) and its rate (m/s) at those turns' ends

    @property
    def end(self) -> tuple[float, float]:
        """The last of them."""
        return float(self.states[-1, 0]), float(self.states[-1, 1])


RESTS = Footnote(
    "It comes to rest on the cam, where it has no freedom: every change dies out, and the exponent "
    "is −∞. Its landings are those higher than rounding; in the limit they are without number.",
    lambda row: row.rests and row.motion == PERIODIC,
    "*",
)
UNTOLD = Footnote(
    "Not told: the turns have not come to repeat, and no exponent above its error says that they "
    "never will; or none lands. More turns to settle may tell.",
    lambda row: row.motion == NOT_TOLD,
    "?",
)


@dataclass(frozen=True, repr=False)
class BounceMap(Result):
    """What one rigid mass does turn after turn, speed by speed: ``rows``."""

    schema = "cam_rig.bounce.1"
    drawn_by = "cam_rig.bounce.figures:figure"
    columns: ClassVar = {
        "speeds": (
            Column(
                "motion",
                about="in contact, periodic, irregular in the turns that are kept, or not told",
            ),
            Column("rpm", "rpm", ".6g", "speed"),
            Column("period", "", "d", about="in turns"),
            Column("landings_per_turn", "1/turn", ".3g", "landings"),
            Column("rests", hidden=True, about="whether it comes to rest on the cam"),
            Column(
                "exponent",
                "1/turn",
                ".3f",
                cell=lambda row: "−∞" if row.exponent == -math.inf else row.exponent,
                about="Lyapunov's, the largest; nothing where it is −∞",
            ),
            Column("exponent_error", "1/turn", ".1g", "error", about="95 %"),
            Column("settled", "", "d", "settled after", about="turns from the start"),
            Column("level_db", "dB", ".1f", "level", about="re 20 µPa, unweighted"),
            Column("level_spread_db", "dB", ".1f", "spread", about="loudest less quietest turn"),
        ),
        "bifurcations": (
            Column("kind", heading="what happens"),
            Column("rpm", "rpm", ".5f", "speed"),
            Column("period", "", "d", about="in turns"),
            Column("landings", "", "d", about="in the period, before it"),
        ),
        "orbits": (
            Column("rpm", "rpm"),
            Column("period"),
            Column("landings", about="in the period"),
            Column("stable"),
            Column("hardest", "m/s", about="fastest landing against the cam"),
            Column("softest", "m/s", about="slowest"),
            Column("gap", "mm", of="state.0", about="at cam angle 0"),
            Column("opening", "m/s", of="state.1", about="its rate there"),
            Column("multiplier", of="leading.real", about="of the largest the real part"),
            Column("multiplier_imaginary", of="leading.imag"),
        ),
        "turns": (
            Column("rpm", "rpm", of=lambda found: found.per_turn(lambda row: row.rpm)),
            Column("hardest", "m/s", of=lambda found: _joined(r.hardest for r in found.rows)),
            Column("gap", "mm", of=lambda found: _joined(r.states[:, 0] for r in found.rows)),
            Column("opening", "m/s", of=lambda found: _joined(r.states[:, 1] for r in found.rows)),
        ),
    }

    law: Law
    rig: RigConfig
    parameters: FollowerParameters
    start: str  #: ``rest``, ``below`` or ``above``
    jump_rpm: float  #: at which the follower first lifts off
    rows: tuple[BounceRow, ...]
    branches: tuple[Branch, ...] = ()  #: where they were asked for

    def per_turn(self, of: Callable[[BounceRow], float]) -> FloatArray:
        """A number of each speed, as often as the speed has turns."""
        return np.repeat([of(row) for row in self.rows], [row.hardest.size for row in self.rows])

    def tables(self) -> list[Records]:
        """``speeds``; in data ``turns`` too: of a period each once, else all that are kept."""
        e = self.parameters.restitution
        caption = f"{self.law.name} on rig {self.rig.name}, restitution {e:g}, {BEGUN[self.start]}"
        motions = [one for branch in self.branches for one in branch.motions]
        found = self.bifurcations if self.branches else []
        words = (f"{kind}: {WORDS[kind]}." for kind in dict.fromkeys(one.kind for one in found))
        shown = _changes(self.rows) if len(self.rows) > MOST_SHOWN else self.rows
        notes: list[Footnote | str] = [RESTS, UNTOLD]
        if len(shown) < len(self.rows):
            notes.append(f"{len(self.rows)} speeds; here those at which the motion changes.")
        return [
            self.table("speeds", caption, self.rows, *notes, seen=lambda row: row in shown),
            self.table("bifurcations", "Where a motion changes", found, *words),
            self.table("orbits", "", motions, hidden=True),
            Arrays.of("turns", self.columns["turns"], self),
        ]

    @property
    def bifurcations(self) -> list[Bifurcation]:
        """The first lift-off, and what happens on the branches, by speed."""
        low, high = self.rows[0].rpm, self.rows[-1].rpm
        found = [Bifurcation(LIFT_OFF, self.jump_rpm, None, 0)]
        for one in (one for branch in self.branches for one in branch.bifurcations):
            if not any(one.same_as(other) for other in found):
                found.append(one)
        return sorted((one for one in found if low <= one.rpm <= high), key=lambda one: one.rpm)

    def summary(self) -> list[str]:
        """The jump speed, and how many speeds of each kind."""
        kinds = [row.motion for row in self.rows]
        counts = (f"{kinds.count(kind)} {kind}" for kind in KINDS if kind in kinds)
        return [f"contact is first lost at {self.jump_rpm:.2f} rpm; speeds: {', '.join(counts)}"]

    def __repr__(self) -> str:
        return f"BounceMap({self.law.name} on {self.rig.name}: {self.summary()[0]})"


def _changes(rows: Sequence[BounceRow]) -> list[BounceRow]:
    """The first and the last of those in a row that are of one kind, period and rest."""
    kinds = [(row.motion, row.period, row.rests) for row in rows]
    last = len(rows) - 1
    return [
        row
        for i, row in enumerate(rows)
        if i in (0, last) or kinds[i] != kinds[i - 1] or kinds[i] != kinds[i + 1]
    ]


#: Speeds that a terminal shows all of.
MOST_SHOWN = 40
KINDS = (IN_CONTACT, PERIODIC, IRREGULAR, NOT_TOLD)
BEGUN = {
    REST: "each speed from the cam",
    BELOW: "each speed from the one below",
    ABOVE: "each speed from the one above",
}


def _joined(parts: Iterable[FloatArray]) -> FloatArray:
    return np.concatenate(list(parts))


@dataclass(frozen=True)
class BounceRuns:
    """What is turned, how long, and how it is heard."""

    law: Law
    parameters: FollowerParameters
    radiation: RadiationParameters | None  #: None where the rig does not tell it
    settle: int  #: turns before those that are kept
    turns: int  #: kept

    def row(self, rpm: float, begin: tuple[float, float] = ON_THE_CAM) -> BounceRow:
        """What the follower does at a speed, from a gap (m) and its rate (m/s)."""
        turn_map = StroboscopicMap(self.law, self.parameters, rpm * RPM)
        run = turn_map.run(self.settle + self.turns, begin)
        found = motion_of(turn_map, run, self.turns)
        shown = 1 if found.kind == IN_CONTACT else found.period or self.turns
        level, spread = self._level(turn_map, run, min(shown, LEVEL_TURNS))
        return BounceRow(
            rpm=rpm,
            motion=found.kind,
            period=found.period,
            landings_per_turn=float(run.landings[-(found.period or self.turns) :].mean()),
            rests=bool(run.on_cam[-self.turns :].any()),
            exponent=found.exponent,
            exponent_error=found.error,
            settled=found.settled,
            level_db=level,
            level_spread_db=spread,
            hardest=run.hardest[-shown:],
            states=run.states[-shown:],
        )

    def rows(self, rpm: Sequence[float]) -> list[BounceRow]:
        """The same at each of some speeds, from the cam."""
        return [self.row(one) for one in rpm]

    def _level(
        self, turn_map: StroboscopicMap, run: TurnsRun, turns: int
    ) -> tuple[float | None, float | None]:
        """Level (dB) of the last turns, and the loudest of them less the quietest."""
        if self.radiation is None:
            return None, None
        gap, opening, flies, place, velocity = run.rows[-turns - 2, :5].tolist()
        after: FollowerState | None = None
        if flies:
            after = FollowerState(place, velocity, 0.0, in_contact=False, inner=(gap, opening))
        speed, advance = turn_map.speed, MODELS["one_mass"].advance
        sound: MicrophoneState | None = None
        turn, pressures = round(NS * turn_map.duration), []
        for i in range(turns + 1):
            interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
            after, block = advance(self.law, self.parameters, after, interval, TURN_RATE_HZ)
            heard = block.force, block.impulse, TURN_RATE_HZ, speed
            sound, pressure = rms_pressure(self.radiation, sound, *heard)
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
    turns: int = 200,
    settle: int = 300,
    start: str = REST,
    follow: bool = False,
    executor: Executor | None = None,
    progress: Progress = SILENT,
) -> BounceMap:
    """What one rigid mass does above its jump speed, turn after turn: at rest, periodic, irregular.

    Impacts are roots and flights closed forms, so each turn's derivative is exact, and the Lyapunov
    exponent is no estimate from a time series. Where its error hides zero, it is "not told".

    Parameters
    ----------
    rpm : cam speeds
    restitution : of a landing, from 0 to below 1; None is the rig's
    turns : kept at each speed
    settle : turns before these
    start : ``rest``: each speed from the cam; ``below`` or ``above``: where the speed below or
        above has ended, which shows hysteresis
    follow : follow each periodic motion that is met at one of the speeds, and does not rest, over
        all of them, stable or not, and find where it changes; more speeds meet more motions
    executor : where the speeds of ``rest`` are computed; None is this process
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
    speeds = sorted(speeds_within(rpm), reverse=start == ABOVE)
    _check(len(speeds), turns, settle, start, follow)
    p = bouncing(rig, restitution)
    told = rig.radiation is not None and p.stem_stiffness is not None
    runs = BounceRuns(law, p, RadiationParameters.from_rig(rig) if told else None, settle, turns)
    expect_many()
    progress.begin(len(speeds), law.name)
    chain = _from_rest(runs, speeds, executor) if start == REST else _continued(runs, speeds)
    found = []
    for row in chain:
        found.append(row)
        progress.advance()
    found.sort(key=lambda row: row.rpm)
    lines = _followed(runs, found, progress) if follow else ()
    return BounceMap(law, rig, p, start, first_lift_off(law, p), tuple(found), lines)


def _followed(
    runs: BounceRuns, rows: Sequence[BounceRow], progress: Progress
) -> tuple[Branch, ...]:
    """The branches of the periodic motions of some speeds, over all of them."""
    progress.tell("periodic motions")
    free = [row for row in rows if row.period is not None and not row.rests]
    seen = [(row.rpm * RPM, row.end, row.period or 1) for row in free]
    return branches(runs.law, runs.parameters, seen, rows[0].rpm * RPM, rows[-1].rpm * RPM)


def _check(speeds: int, turns: int, settle: int, start: str, follow: bool) -> None:
    """Refuse arguments out of range."""
    if start not in BEGUN:
        raise ConfigError(f"start: is {start!r}; allowed: {', '.join(BEGUN)}")
    if turns < LEAST_TURNS:
        raise ConfigError(f"turns: is {turns}; allowed: {LEAST_TURNS} or more")
    if settle < 0:
        raise ConfigError(f"settle: is {settle}; allowed: 0 or more turns")
    if follow and speeds < 2:
        raise ConfigError("follow: over one speed; allowed: two speeds or more, as 385:480:5")
    if settle + turns > MOST_TURNS:
        raise ConfigError(
            f"turns: are {turns} after {settle} to settle; allowed: {MOST_TURNS} together"
        )


def first_lift_off(law: Law, parameters: FollowerParameters) -> float:
    """The jump speed (rpm): 0 where a velocity jump of the cam throws the follower at any speed."""
    return 0.0 if law.velocity_jumps else rigid_jump(law, parameters)[0] / RPM


def _from_rest(
    runs: BounceRuns, rpm: Sequence[float], executor: Executor | None
) -> Iterator[BounceRow]:
    if executor is None:
        yield from map(runs.row, rpm)
        return
    parts = [rpm[i : i + TOGETHER] for i in range(0, len(rpm), TOGETHER)]
    sent: list[Future[list[BounceRow]]] = [executor.submit(runs.rows, part) for part in parts]
    for one in sent:
        yield from one.result()


def _continued(runs: BounceRuns, rpm: Sequence[float]) -> Iterator[BounceRow]:
    begin = ON_THE_CAM
    for one in rpm:
        row = runs.row(one, begin)
        begin = row.end
        yield row
