"""Simulation of a scene in one process, with the classes that the nodes use too."""

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
from cam_rig.dynamics.steady_rules import LEVEL_TURNS, is_steady
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.units import NS, TURN, FloatArray, to_rpm


@dataclass(frozen=True)
class MeasuredTick:
    """Sound pressure at the microphone over one tick, the time between two cam states."""

    start: CamState
    stop_ns: int
    pressure: float | None  #: r.m.s. sound pressure, Pa; None without acoustic constants
    samples: int  #: number of samples in the r.m.s. value
    steady: bool = True  #: True at constant cam speed, False on a ramp

    @classmethod
    def between(
        cls, start: CamState, end: CamState, pressure: float, sample_rate: int
    ) -> MeasuredTick:
        """Return the measurement between two cam states.

        `pressure` is the r.m.s. sound pressure (Pa), `sample_rate` is in Hz.
        """
        interval = start.until(end)
        count = interval.grid(sample_rate).count
        return cls(start, end.time_ns, pressure, count, interval.acceleration == 0.0)


#: Largest difference (s) between the rig time from one state to the next and the time that the
#: turned angle takes. A larger difference is a stop of the cam, which takes 1 s. Rounding is far
#: smaller.
STOP_ATOL_S = 0.1


@dataclass
class TransientFilter:
    """Detector of the settled ticks of a run.

    A tick is the time between two cam states, and a step is the time of one cam at one speed. A
    tick is settled if it follows after the first `turns` turns of its step.
    """

    turns: float  #: number of turns left out at the start of each step
    first: CamState | None = field(default=None, init=False)  #: first state of the present step
    _last: CamState | None = field(default=None, init=False)

    def is_over(self, start: CamState, steady: bool) -> bool:
        """Return True if the tick that starts at `start` is settled.

        It must be called for each tick in order, with `steady` False on a ramp. A tick is the time
        between two cam states.
        """
        if not steady:
            self.first = None
            return False
        if self.first is None or self._last is None or not _continues(self._last, start):
            self.first = start
        self._last = start
        return is_steady(start.since(self.first) / TURN, self.turns)


def _continues(last: CamState, start: CamState) -> bool:
    """Return True if the cam turned at one speed from one cam state to another.

    The states may belong to adjacent ticks (times between two cam states) or not. If the rig time
    between them is longer than the turned angle takes, the cam was stopped.
    """
    if (start.cam, start.speed) != (last.cam, last.speed):
        return False
    return abs((start.time_ns - last.time_ns) / NS - start.since(last) / last.speed) < STOP_ATOL_S


Part = TypeVar("Part")


@dataclass
class WholeTurns(Generic[Part]):
    """Collector that groups the data of settled ticks by whole turns.

    A tick is the time between two cam states. Means are formed over whole turns only. The last,
    incomplete turn at each speed is left out.
    """

    settling: TransientFilter
    _parts: list[Part] = field(default_factory=list, init=False)
    _turned: float = field(default=0.0, init=False)  #: turns of the present step
    _step: CamState | None = field(default=None, init=False)  #: first state of the present step
    _stop: int = field(default=0, init=False)  #: end of the last tick, on the scale of `span`

    def add(
        self, start: CamState, steady: bool, turned: float, span: tuple[int, int], part: Part
    ) -> list[Part]:
        """Add the data of the next tick, and return those of the turns it completes.

        The result is empty if no turn is complete. `steady` is False on a ramp, and `turned` is the
        angle of the tick in rad. `span` is its start and end on any scale of whole numbers on which
        successive ticks are adjacent. `part` is the data. A tick is the time between two cam
        states.
        """
        settled, first = self.settling.is_over(start, steady), self.settling.first
        if not settled or (self._step, self._stop) != (first, span[0]):
            self._parts, self._turned = [], 0.0
        self._step, self._stop = first, span[1]
        if not settled:
            return []
        previous, self._turned = self._turned, self._turned + turned / TURN
        self._parts.append(part)
        if math.floor(self._turned + 1e-6) == math.floor(previous + 1e-6):
            return []
        completed, self._parts = self._parts, []
        return completed


class StepLevels:
    """Energy mean sound level (dB) over whole settled turns, by cam and speed (rad/s).

    Each tick (time between two cam states) is weighted by its number of samples, not by its
    duration: ticks of equal duration may differ by one sample, and the level must not depend on the
    number of ticks per turn.
    """

    def __init__(self, transient_turns: float) -> None:
        self.levels: dict[str, dict[float, float]] = {}
        self._energy: dict[tuple[str, float], tuple[float, int]] = {}
        self._turns = WholeTurns[MeasuredTick](TransientFilter(transient_turns))

    def add(self, tick: MeasuredTick) -> float | None:
        """Add a tick, and return the new mean level (dB) if the tick completes a turn.

        A tick is the time between two cam states. The result is None if no turn is complete.
        """
        if tick.pressure is None:
            return None
        start, span = tick.start, (tick.start.time_ns, tick.stop_ns)
        turned = start.speed * (tick.stop_ns - start.time_ns) / NS
        completed = self._turns.add(start, tick.steady, turned, span, tick)
        if not completed:
            return None
        square, samples = self._energy.get((start.cam, start.speed), (0.0, 0))
        for part in completed:
            assert part.pressure is not None  # checked above for each tick
            square, samples = square + part.pressure**2 * part.samples, samples + part.samples
        self._energy[start.cam, start.speed] = square, samples
        level = float(level_db(np.sqrt(square / samples)))
        self.levels.setdefault(start.cam, {})[start.speed] = level
        return level


def step_levels(
    ticks: Iterable[MeasuredTick], transient_turns: float
) -> dict[str, dict[float, float]]:
    """Return the sound level (dB) of a run by cam and speed (rad/s).

    It is the mean that `StepLevels` computes. `transient_turns` is the number of turns that are
    left out at the start of each speed.
    """
    step = StepLevels(transient_turns)
    for tick in ticks:
        step.add(tick)
    return step.levels


def require_ticks(levels: dict[str, dict[float, float]], source: str) -> None:
    """Raise `CamRigError` if a run has no sound levels.

    The error message starts with `source`, the name of the run.
    """
    if not levels:
        raise CamRigError(
            f"{source}: no whole settled turn to measure; run at least one whole step"
        )


#: Relative difference below which two speeds are equal. It allows for the rounding of rpm.
SPEED_RTOL = 1e-9


@dataclass(frozen=True, eq=False)
class TickSamples(NamedRows):
    """Samples of one tick (time between two cam states), with cam, angle and speed."""

    start: CamState
    interval: Interval  #: starts at `start`, may end after the last sample
    rows: FloatArray  #: ``(6, n)``, rows in the order of `cam_rig.dynamics.interval.COLUMNS`

    @property
    def cam(self) -> str:
        """Name of the cam that is mounted during the samples."""
        return self.start.cam

    @property
    def steady(self) -> bool:
        """True if the cam speed is constant during the samples, False on a ramp."""
        return self.interval.acceleration == 0.0

    def is_of(self, cam: str | None, rpm: float | None) -> bool:
        """Return True if the tick has this cam and this constant speed (rpm).

        None accepts any cam or any speed. A tick is the time between two cam states.
        """
        if cam is not None and cam != self.cam:
            return False
        difference = 0.0 if rpm is None else abs(to_rpm(self.start.speed) - rpm)
        return rpm is None or (self.steady and difference <= SPEED_RTOL * rpm)

    @cached_property
    def _time_in_tick(self) -> FloatArray:
        """Times of the samples since the start of the tick, s, shape `(n,)`.

        A tick is the time between two cam states.
        """
        return self.time - self.interval.start_ns / NS

    @property
    def angle(self) -> FloatArray:
        """Cam angle of the samples with all turns, rad, shape `(n,)`."""
        return self.interval.unwrapped_at(self._time_in_tick)

    @cached_property
    def angle_in_turn(self) -> FloatArray:
        """Cam angle of the samples in [0, 2π), rad, shape `(n,)`.

        It is accurate after any number of turns.
        """
        angle = self.interval.angle_at(self._time_in_tick)
        wrapped = angle - np.floor(angle / TURN) * TURN
        return np.where(wrapped < TURN, wrapped, 0.0)  # equal to TURN by rounding

    def angle_span(self, rate: int) -> float:
        """Return the angle (rad) that the cam turns during the samples of the tick.

        `rate` is the sample rate, Hz. A tick is the time between two cam states.
        """
        fraction = self.time.size / self.interval.grid(rate).count
        return fraction * self.interval.mean_speed * self.interval.duration

    @property
    def rpm(self) -> FloatArray:
        """Cam speed of the samples, rpm, shape `(n,)`."""
        return np.round(to_rpm(self.interval.speed_at(self._time_in_tick)), 9)


@dataclass
class FollowerSimulator:
    """Simulator of the follower on the mounted cam.

    The follower node uses it too. It computes a block of samples for each cam state after the
    first.
    """

    model: Model
    parameters: Any  #: parameters of the model
    sample_rate: int  #: Hz
    laws: dict[str, Law] = field(default_factory=dict)  #: by cam
    last: CamState | None = None  #: last cam state, None before the first
    state: FollowerState | None = None  #: at the last cam state, None for rest on the cam
    pending_impulse: float = 0.0  #: impulse of a landing on the last cam after its last sample, N·s

    @classmethod
    def of(cls, loaded: LoadedScene) -> FollowerSimulator:
        """Return the simulator for the model, the rig and the cams of a scene."""
        model, rate = MODELS[loaded.scene.model], int(loaded.scene.sample_rate.si)
        return cls(model, model.parameters(loaded.rig), rate, dict(loaded.laws))

    def turn_to(self, state: CamState) -> tuple[FollowerState, Block] | None:
        """Simulate the tick that ends at a cam state.

        A tick is the time from one cam state to the next. Returns the follower's state and the
        block of samples, or None at the first cam state and if the cam does not turn. On a new cam
        the next tick starts at rest.
        """
        start, start_state, pending_impulse = self.last, self.state, self.pending_impulse
        self.continue_from(state)
        if start is None or not start.turns_until(state):
            return None
        law = self.laws[start.cam]
        end, block = self.model.advance(
            law, self.parameters, start_state, start.until(state), self.sample_rate
        )
        if state.cam == start.cam:
            self.state = end
        else:
            self.pending_impulse = end.pending_impulse
        return end, block.with_impulse(pending_impulse)

    def continue_from(
        self, last: CamState | None = None, state: FollowerState | None = None
    ) -> None:
        """Set the cam state and the follower's state from which the simulation continues.

        None for the follower's state means at rest on the cam.
        """
        self.last, self.state, self.pending_impulse = last, state, 0.0


@dataclass
class MicrophoneSimulator:
    """Simulator of the microphone.

    The microphone node uses it too.
    """

    parameters: RadiationParameters
    sample_rate: int
    state: MicrophoneState | None = None

    @classmethod
    def of(cls, loaded: LoadedScene) -> MicrophoneSimulator:
        """Return the simulator of the microphone for the rig of a scene."""
        return cls(loaded.radiation, int(loaded.scene.sample_rate.si))

    def listen(self, block_rows: FloatArray, speed: float) -> float:
        """Return the r.m.s. sound pressure (Pa) over a block of samples.

        `block_rows` contains time, lift, velocity, acceleration, contact force and landing impulse
        in SI units, shape (6, n). `speed` is the cam speed in rad/s. The state of the filter
        continues from the block before.
        """
        block = Samples(block_rows)
        self.state, pressure = rms_pressure(
            self.parameters, self.state, block.force, block.impulse, self.sample_rate, speed
        )
        return pressure

    def measure(self, tick: TickSamples) -> MeasuredTick:
        """Return the measured sound pressure over a tick.

        A tick is the time between two cam states.
        """
        return _measure(tick, self.listen(tick.rows, tick.interval.mean_speed))


def _measure(tick: TickSamples, pressure: float | None) -> MeasuredTick:
    stop, count = tick.interval.stop_ns, tick.rows.shape[1]
    return MeasuredTick(tick.start, stop, pressure, count, tick.steady)


def simulate_ticks(
    loaded: LoadedScene,
    start_state: FollowerState | None = None,
    states: Iterable[CamState] | None = None,
) -> Iterator[TickSamples]:
    """Simulate a scene, and yield the samples of each tick.

    A tick is the time between two cam states. `start_state` is the follower's state at the first
    cam state (default: at rest on the cam). `states` are the cam states (default: those of the
    scene's schedule).
    """
    follower = FollowerSimulator.of(loaded)
    start: CamState | None = None
    for state in cam_states(loaded.scene) if states is None else states:
        turned = follower.turn_to(state)
        if start is None:
            follower.continue_from(state, start_state)
        if turned is not None and start is not None:
            yield TickSamples(start, turned[1].interval, turned[1].rows)
        start = state


def simulate(
    loaded: LoadedScene,
    take: Callable[[TickSamples], None] = lambda _: None,
    start_state: FollowerState | None = None,
    states: Iterable[CamState] | None = None,
) -> Iterator[MeasuredTick]:
    """Simulate a scene, and yield the measured sound pressure of each tick.

    `take` is called with the samples of each tick, which are not stored. The other parameters are
    those of `simulate_ticks`. Ticks have no pressure if the rig has no acoustic constants. A tick
    is the time between two cam states.
    """
    microphone = None if loaded.missing_for_sound else MicrophoneSimulator.of(loaded)
    for tick in simulate_ticks(loaded, start_state, states):
        take(tick)
        yield _measure(tick, None) if microphone is None else microphone.measure(tick)


#: Sample rate of `simulate_steady_turns`, Hz. Levels are within 0.003 dB of those at 384 kHz
#: (docs/accuracy.md).
TURN_RATE_HZ = 12_000
#: Speed (rpm) at which the speed response is 0 dB: the middle of the range 200 to 400 rpm. The
#: response is a polynomial of (rpm − 300)/100.
RESPONSE_CENTRE_RPM = 300.0
#: Scale of the speed in the polynomial of the speed response (see `RESPONSE_CENTRE_RPM`), rpm: half
#: the range 200 to 400 rpm.
RESPONSE_SCALE_RPM = 100.0


class Sounding(Protocol):
    """Sources of the sound of a cam at several speeds: contact force and landings."""

    @property
    def speeds(self) -> FloatArray:
        """Cam speeds, rad/s, shape `(n,)`."""

    def every(self, step: int) -> Sounding:
        """Return the same sources of sound at every `step`-th cam speed only."""

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Return the mean square of ω_c (F − q) at each speed, (N/s)², shape `(n,)`.

        F is the contact force and q its low-pass filtered value. ω_c is `corner_rate` in rad/s.
        """

    def landing_power(self, radiation: RadiationParameters) -> FloatArray:
        """Return the mean square sound pressure of the landings, Pa², shape `(n,)`."""


@dataclass(frozen=True, eq=False)
class Turns:
    """Samples of the last simulated turn at each speed."""

    speeds: FloatArray  #: rad/s, ``(n,)``
    forces: tuple[FloatArray, ...]  #: N, for each speed
    impulses: tuple[FloatArray, ...]  #: N·s, for each speed

    @property
    def rpm(self) -> FloatArray:
        """Cam speeds of the simulated turns, rpm."""
        return to_rpm(self.speeds)

    def every(self, step: int) -> Turns:
        """Return the samples of the simulated turns at every `step`-th cam speed only."""
        return Turns(self.speeds[::step], self.forces[::step], self.impulses[::step])

    def contact_power(self, corner_rate: float) -> FloatArray:
        """Return the mean square of ω_c (F − q) of the turn at each speed, (N/s)².

        F is the contact force and q its low-pass filtered value. ω_c is `corner_rate` in rad/s. The
        shape is `(n,)`.
        """
        blocks = zip(self.forces, self.impulses, strict=True)
        return np.array([_contact_power(corner_rate, *block) for block in blocks])

    def landing_power(self, radiation: RadiationParameters) -> FloatArray:
        """Return the mean square sound pressure of the landings, Pa², shape `(n,)`."""
        energy = [float(radiation.landing_energy(impulse).sum()) for impulse in self.impulses]
        return np.array(energy) * self.speeds / TURN


def _contact_power(rate: float, force: FloatArray, impulse: FloatArray) -> float:
    """Return the mean square of ω_c (F − q) over one periodic turn, (N/s)².

    F is the contact force, and q its low-pass filtered value, the response of the structure. `rate`
    is ω_c in rad/s. `force` (N) and `impulse` (N·s) are the samples of the turn. The periodic
    response is that from rest plus a decaying term, because the filter is linear.
    """
    from_rest = structure_response(rate, TURN_RATE_HZ, 0.0, float(force[-1]), force, impulse)
    decay = np.exp(-rate / TURN_RATE_HZ * np.arange(1, force.size + 1))
    structure = from_rest + decay * from_rest[-1] / (1.0 - decay[-1])
    return float(np.mean((rate * (force - structure)) ** 2))


def simulate_steady_turns(
    law: Law, model: str, parameters: Any, speeds: Sequence[float] | FloatArray
) -> Turns:
    """Return the samples of a nearly steady turn at each speed (rad/s).

    It is the second turn from rest. For a rigid follower that is in contact at the end of the first
    turn, it is the first turn, because the second is equal. `model` is the name of the dynamic
    model, and `parameters` are its parameters.
    """
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
    """Fitted acoustic constants of a rig."""

    radiation: RadiationParameters
    #: Speed response of the rig to the sound of the contact of any cam: factors (dB) of the powers
    #: 1, 2 and 3 of (rpm − 300)/100. An empty tuple means no response.
    response: tuple[float, ...] = ()

    def levels(self, turns: Sounding) -> FloatArray:
        """Return the sound level (dB) at each speed, shape `(n,)`.

        The speed response is not applied to landings. It is measured on a cam without landings at
        some tens of Hz, and the sound of landings is at some kHz.
        """
        r = self.radiation
        background = np.array([r.background_power(float(speed)) for speed in turns.speeds])
        x = (to_rpm(turns.speeds) - RESPONSE_CENTRE_RPM) / RESPONSE_SCALE_RPM
        response = np.polynomial.polynomial.polyval(x, (0.0, *self.response))
        contact = r.gain**2 * turns.contact_power(r.corner_rate) * 10.0 ** (response / 10)
        return level_db(np.sqrt(background + contact + turns.landing_power(r)))

    def with_constants(
        self, gain: float, corner: float, response: tuple[float, ...] = ()
    ) -> Acoustics:
        """Return the acoustic constants with another gain, corner and speed response.

        ``corner`` is the corner frequency in Hz.
        """
        return Acoustics(replace(self.radiation, gain=gain, corner_frequency=corner), response)
