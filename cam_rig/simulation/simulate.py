"""The scene without ROS: the same core as the nodes, in one process."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from cam_rig.acoustics import MicrophoneState, RadiationParameters, level_db, rms_pressure
from cam_rig.acoustics.pressure import structure_response
from cam_rig.dynamics import MODELS, Block, FollowerState, Interval, Model, Samples
from cam_rig.dynamics.interval import NamedRows
from cam_rig.dynamics.steady_rules import LEVEL_TURNS, is_settled
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.units import NS, TURN, FloatArray, to_rpm


@dataclass(frozen=True)
class MeasuredTick:
    """Measurement of the microphone over one tick."""

    start: CamState
    stop_ns: int
    pressure: float | None  #: r.m.s., Pa; None if the rig has no numbers of its sound
    samples: int  #: of which the pressure is the mean
    steady: bool = True  #: False along a ramp

    @classmethod
    def between(
        cls, start: CamState, end: CamState, pressure: float, sample_rate: int
    ) -> MeasuredTick:
        """The tick from one cam state to the next, of samples at ``sample_rate`` (Hz)."""
        interval = start.until(end)
        count = interval.grid(sample_rate).count
        return cls(start, end.time_ns, pressure, count, interval.acceleration == 0.0)


#: Rig time (s) beyond what a cam takes from tick to tick at its speed, after which it stood
#: meanwhile: a halted one stands a second, and else it is off by rounding.
STOOD_S = 0.1


@dataclass
class Settling:
    """Which ticks of a run are settled; a step is a run of one cam at one speed, ramps left out."""

    turns: float  #: of each step, left out
    first: CamState | None = field(default=None, init=False)  #: of the present step
    _last: CamState | None = field(default=None, init=False)

    def is_over(self, start: CamState, steady: bool) -> bool:
        """Whether the tick that begins at ``start`` is settled; to be asked of each in order."""
        if not steady:
            self.first = None
            return False
        if self.first is None or self._last is None or not _goes_on(self._last, start):
            self.first = start
        self._last = start
        return is_settled(start.since(self.first) / TURN, self.turns)


def _goes_on(last: CamState, start: CamState) -> bool:
    """Whether a cam at its speed went on from one state to another, seen or not."""
    if (start.cam, start.speed) != (last.cam, last.speed):
        return False
    return abs((start.time_ns - last.time_ns) / NS - start.since(last) / last.speed) < STOOD_S


Part = TypeVar("Part")


@dataclass
class WholeTurns(Generic[Part]):
    """Puts a run's settled ticks together to whole turns: less than one has no mean."""

    settling: Settling
    _parts: list[Part] = field(default_factory=list, init=False)
    _turned: float = field(default=0.0, init=False)  #: of the present step, turns
    _of: tuple[CamState | None, int] = field(default=(None, 0), init=False)

    def take(
        self, start: CamState, steady: bool, turned: float, span: tuple[int, int], part: Part
    ) -> list[Part]:
        """The parts of the turns that this tick completes, else none; of each tick in order.

        The tick turned by an angle (rad) from the first to the second of ``span``: whatever counts
        so that the next tick begins where this one ends.
        """
        settled, first = self.settling.is_over(start, steady), self.settling.first
        if not settled or self._of != (first, span[0]):
            self._parts, self._turned = [], 0.0
        self._of = first, span[1]
        if not settled:
            return []
        before, self._turned = self._turned, self._turned + turned / TURN
        self._parts.append(part)
        if math.floor(self._turned + 1e-6) == math.floor(before + 1e-6):
            return []
        whole, self._parts = self._parts, []
        return whole


class StepLevels:
    """Level in dB by cam and speed (rad/s): the energy mean over the step's whole settled turns.

    Each tick counts by its samples, not by its time: short ticks of one length may have two or
    three, and every sample weighs the same however the turn is divided.
    """

    def __init__(self, settle_turns: float) -> None:
        self.levels: dict[str, dict[float, float]] = {}
        self._energy: dict[tuple[str, float], tuple[float, int]] = {}
        self._turns = WholeTurns[MeasuredTick](Settling(settle_turns))

    def add(self, tick: MeasuredTick) -> float | None:
        """The level with the next tick, where it completes a turn."""
        if tick.pressure is None:
            return None
        start, span = tick.start, (tick.start.time_ns, tick.stop_ns)
        turned = start.speed * (tick.stop_ns - start.time_ns) / NS
        whole = self._turns.take(start, tick.steady, turned, span, tick)
        if not whole:
            return None
        square, samples = self._energy.get((start.cam, start.speed), (0.0, 0))
        for part in whole:
            assert part.pressure is not None  # it would not be in here
            square, samples = square + part.pressure**2 * part.samples, samples + part.samples
        self._energy[start.cam, start.speed] = square, samples
        level = float(level_db(np.sqrt(square / samples)))
        self.levels.setdefault(start.cam, {})[start.speed] = level
        return level


def step_levels(
    ticks: Iterable[MeasuredTick], settle_turns: float
) -> dict[str, dict[float, float]]:
    """The `StepLevels` of a run's ticks."""
    found = StepLevels(settle_turns)
    for tick in ticks:
        found.add(tick)
    return found.levels


def require_ticks(levels: dict[str, dict[float, float]], where: str) -> None:
    """Raise when nothing was measured, naming where it was looked for."""
    if not levels:
        raise CamRigError(f"{where}: no whole settled turn to measure; run at least one whole step")


#: Speeds nearer than this part of each other are one.
SAME = 1e-9


@dataclass(frozen=True, eq=False)
class TickSamples(NamedRows):
    """Samples ``(6, n)`` of one tick, rows as in `COLUMNS`, and θ, rpm and cam beside them."""

    start: CamState
    interval: Interval  #: from ``start`` on; it may go on beyond the samples
    rows: FloatArray

    @property
    def cam(self) -> str:
        """The mounted cam."""
        return self.start.cam

    @property
    def steady(self) -> bool:
        """Whether the speed is held, and not ramped."""
        return self.interval.acceleration == 0.0

    def is_of(self, cam: str | None, rpm: float | None) -> bool:
        """Whether it is of a cam (None: of any) at a speed that is held (None: or ramped)."""
        if cam is not None and cam != self.cam:
            return False
        return rpm is None or (self.steady and abs(to_rpm(self.start.speed) - rpm) <= SAME * rpm)

    @cached_property
    def _since(self) -> FloatArray:
        """Times since the tick began, s."""
        return self.time - self.interval.start_ns / NS

    @property
    def angle(self) -> FloatArray:
        """``(n,)`` cam angle with all its turns, rad."""
        return self.interval.unwrapped_at(self._since)

    @cached_property
    def angle_in_turn(self) -> FloatArray:
        """``(n,)`` cam angle in [0, 2π), rad: it has all its digits however long the cam turned."""
        angle = self.interval.angle_at(self._since)
        inside = angle - np.floor(angle / TURN) * TURN
        return np.where(inside < TURN, inside, 0.0)  # TURN itself by rounding

    def turned(self, rate: int) -> float:
        """Angle (rad) that the cam turned under the samples, at ``rate`` Hz."""
        part = self.time.size / self.interval.grid(rate).count
        return part * self.interval.mean_speed * self.interval.duration

    @property
    def rpm(self) -> FloatArray:
        """``(n,)`` cam speed, rpm."""
        return np.round(to_rpm(self.interval.speed_at(self._since)), 9)


@dataclass
class FollowerSimulator:
    """The follower under the mounted cam: takes cam states, gives blocks. Used by the node too."""

    model: Model
    parameters: Any
    sample_rate: int
    laws: dict[str, Law] = field(default_factory=dict)
    #: Last cam state, and the follower's state there; None before the first cam state, and if the
    #: follower is put on the cam anew.
    last: CamState | None = None
    state: FollowerState | None = None
    owed: float = 0.0  #: impulse of a landing that no sample has shown, N·s

    @classmethod
    def of(cls, loaded: LoadedScene) -> FollowerSimulator:
        """The follower of a scene."""
        model, rate = MODELS[loaded.scene.model], int(loaded.scene.sample_rate.si)
        return cls(model, model.parameters(loaded.rig), rate, dict(loaded.laws))

    def turn_to(self, state: CamState) -> tuple[FollowerState, Block] | None:
        """The tick that ends at ``state``, None at the first; on a new cam it is put down."""
        start, begin, owed = self.last, self.state, self.owed
        self.put_down(state)
        if start is None or not start.turns_until(state):
            return None
        law = self.laws[start.cam]
        end, block = self.model.advance(
            law, self.parameters, begin, start.until(state), self.sample_rate
        )
        if state.cam == start.cam:
            self.state = end
        else:
            self.owed = end.pending_impulse
        return end, block.with_impulse(owed)

    def put_down(self, last: CamState | None = None, state: FollowerState | None = None) -> None:
        """Continue from a cam state, with the follower in `state`, or at rest on the cam."""
        self.last, self.state, self.owed = last, state, 0.0


@dataclass
class MicrophoneSimulator:
    """The microphone with its state: takes blocks, gives r.m.s. pressure. Used by the node too."""

    parameters: RadiationParameters
    sample_rate: int
    state: MicrophoneState | None = None

    @classmethod
    def of(cls, loaded: LoadedScene) -> MicrophoneSimulator:
        """The microphone of a scene."""
        return cls(loaded.radiation, int(loaded.scene.sample_rate.si))

    def listen(self, block_rows: FloatArray, speed: float) -> float:
        """r.m.s. pressure (Pa) over a block, ``(6, n)`` rows, at cam speed ``speed`` (rad/s)."""
        block = Samples(block_rows)
        self.state, pressure = rms_pressure(
            self.parameters, self.state, block.force, block.impulse, self.sample_rate, speed
        )
        return pressure

    def measure(self, tick: TickSamples) -> MeasuredTick:
        """The same of a tick's samples."""
        return _measured(tick, self.listen(tick.rows, tick.interval.mean_speed))


def _measured(tick: TickSamples, pressure: float | None) -> MeasuredTick:
    stop, count = tick.interval.stop_ns, tick.rows.shape[1]
    return MeasuredTick(tick.start, stop, pressure, count, tick.steady)


def turned_ticks(
    loaded: LoadedScene,
    begin: FollowerState | None = None,
    states: Iterable[CamState] | None = None,
) -> Iterator[TickSamples]:
    """Samples tick by tick, ``begin`` None: put down; of the drive's or ``states``."""
    follower = FollowerSimulator.of(loaded)
    start: CamState | None = None
    for state in cam_states(loaded.scene) if states is None else states:
        turned = follower.turn_to(state)
        if start is None:
            follower.put_down(state, begin)
        if turned is not None and start is not None:
            yield TickSamples(start, turned[1].interval, turned[1].rows)
        start = state


def simulate(
    loaded: LoadedScene,
    take: Callable[[TickSamples], None] = lambda _: None,
    begin: FollowerState | None = None,
    states: Iterable[CamState] | None = None,
) -> Iterator[MeasuredTick]:
    """Run the scene as `turned_ticks`; ``take`` gets each tick's samples, which are not kept.

    Ticks have no pressure if the rig has no numbers of its sound.
    """
    microphone = None if loaded.missing_for_sound else MicrophoneSimulator.of(loaded)
    for tick in turned_ticks(loaded, begin, states):
        take(tick)
        yield _measured(tick, None) if microphone is None else microphone.measure(tick)


#: Hz: levels are within 0.003 dB of those at 384 kHz (docs/accuracy.md).
TURN_RATE_HZ = 12_000
#: The speed response is a polynomial of (rpm − 300)/100.
RESPONSE_AT, RESPONSE_PER = 300.0, 100.0


class Sounding(Protocol):
    """What a cam gives to the rig's structure at each of ``speeds`` (rad/s)."""

    @property
    def speeds(self) -> FloatArray:
        """Of the cam, rad/s, ``(n,)``."""

    def every(self, step: int) -> Sounding:
        """Only each ``step``-th speed."""

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Mean square of ω_c (F − q), ``(n,)`` in (N/s)², for ω_c in rad/s."""

    def landing_power(self, radiation: RadiationParameters) -> FloatArray:
        """Mean square pressure of the landings, ``(n,)`` in Pa²."""


@dataclass(frozen=True, eq=False)
class Turns:
    """The last turn of a run at each speed."""

    speeds: FloatArray  #: rad/s
    forces: tuple[FloatArray, ...]  #: N
    impulses: tuple[FloatArray, ...]  #: N·s

    @property
    def rpm(self) -> FloatArray:
        """The speeds in rpm."""
        return to_rpm(self.speeds)

    def every(self, step: int) -> Turns:
        """Only each ``step``-th speed."""
        return Turns(self.speeds[::step], self.forces[::step], self.impulses[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """⟨(ω_c (F − q))²⟩ over a turn repeated for ever, ``(n,)`` in (N/s)²."""
        blocks = zip(self.forces, self.impulses, strict=True)
        return np.array([_contact_power(corner_rate, *block) for block in blocks])

    def landing_power(self, radiation: RadiationParameters) -> FloatArray:
        """Mean square pressure of the landings, ``(n,)`` in Pa²."""
        energy = [float(radiation.landing_energy(impulse).sum()) for impulse in self.impulses]
        return np.array(energy) * self.speeds / TURN


def _contact_power(rate: float, force: FloatArray, impulse: FloatArray) -> float:
    """The structure is linear: a turn from rest, and the start that comes back to itself."""
    started = structure_response(rate, TURN_RATE_HZ, 0.0, float(force[-1]), force, impulse)
    fading = np.exp(-rate / TURN_RATE_HZ * np.arange(1, force.size + 1))
    structure = started + fading * started[-1] / (1.0 - fading[-1])
    return float(np.mean((rate * (force - structure)) ** 2))


def settled_turns(
    law: Law, model: str, parameters: Any, speeds: Sequence[float] | FloatArray
) -> Turns:
    """The second turn at each speed; of a rigid follower that ends on the cam the first."""
    forces, impulses = [], []
    for speed in map(float, speeds):
        turn, state = round(TURN / speed * NS), None
        for i in range(LEVEL_TURNS):
            interval = Interval(i * turn, (i + 1) * turn, speed * i * turn / NS, speed)
            state, block = MODELS[model].advance(law, parameters, state, interval, TURN_RATE_HZ)
            if model == "one_mass" and state.in_contact and state.pending_impulse == 0.0:
                break
        forces.append(block.force)
        impulses.append(block.impulse)
    return Turns(np.array(speeds, dtype=float), tuple(forces), tuple(impulses))


@dataclass(frozen=True)
class Acoustics:
    """The fitted constants of a rig's sound."""

    radiation: RadiationParameters
    #: Empty, or dB of the contact's sound over powers 1, 2, 3 of (rpm − 300)/100: how much better
    #: the rig passes sound on at one speed than at another, whatever the cam.
    response: tuple[float, ...] = ()

    def levels(self, turns: Sounding) -> FloatArray:
        """Level in dB at each speed, ``(n,)``.

        Landings do not pass through the speed response: it is measured on a cam that has none,
        at some tens of Hz, and they sound at some kHz.
        """
        r = self.radiation
        background = np.array([r.background_power(float(speed)) for speed in turns.speeds])
        x = (to_rpm(turns.speeds) - RESPONSE_AT) / RESPONSE_PER
        response = np.polynomial.polynomial.polyval(x, (0.0, *self.response))
        contact = r.gain**2 * turns.contact_power(r.corner_rate) * 10.0 ** (response / 10)
        return level_db(np.sqrt(background + contact + turns.landing_power(r)))

    def with_constants(
        self, gain: float, corner: float, response: tuple[float, ...] = ()
    ) -> Acoustics:
        """The same background, other constants."""
        return Acoustics(replace(self.radiation, gain=gain, corner=corner), response)
