"""A follower's course through an interval, as the models read it: its phases and its events.

And the tables of laws, free systems and contact that the search takes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from cam_rig.dynamics.events import contact as stem
from cam_rig.dynamics.events import free_flight as air
from cam_rig.dynamics.events import law_table as cam
from cam_rig.dynamics.events import runs as at
from cam_rig.dynamics.events.runs import Jumps, RunRecord, RunTable, fly_from, run_events
from cam_rig.dynamics.events.search import call
from cam_rig.dynamics.interval import (
    Block,
    Event,
    EventKind,
    FollowerState,
    SampleGrid,
    show_impulses,
)
from cam_rig.dynamics.linear.exponential import REACH, Flight, FreeSystem, window_series
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, Part, polynomial_part
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump, velocity_jumps_ahead
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import NS, TURN, FloatArray

#: Phases that are found in one call: in the first, and in the longest, each having twice the room
#: of the one before.
FIRST_ROOM, MOST_ROOM = 32, 4096
#: So little of a turn more is rounding.
WHOLE_TURN = 1e-6
#: A change of the cam's velocity below this fraction of (cam speed x lift) is rounding: no step.
NO_IMPACT = 1e-12
#: A bounce is contact when it is lower than this fraction of the lift, or than so many metres,
#: a hundred thousandth of an atom.
MIN_OF_LIFT, MIN_HEIGHT = 1e-12, 1e-15


@dataclass(frozen=True, eq=False)
class Phase:
    """Contact or a flight."""

    begin: float  #: s
    end: float  #: s
    vibration: FloatArray  #: (η, η̇) of two masses in contact
    flight: Flight | None = None


class EndlessEventsError(DynamicsError):
    """A follower leaves its cam and lands again without end: it has no motion in this model."""


class Course:
    """Finds phase after phase on one law at one speed (rad/s); times since the start, in s.

    Nothing is stepped: contact ends where the force falls to zero, flight where the gap closes, and
    between these the motion is known in closed form. Both also end at a joint where the law's
    velocity jumps: up is an impact on what is in contact, down lifts it off with the velocity it
    had. The search itself is `cam_rig.dynamics.events.runs`.
    """

    #: More events than any physical series has in a turn.
    most_events: ClassVar[int]

    def __init__(
        self, law: Law, system: FreeSystem, speed: float, angle: float, turns: int = 0
    ) -> None:
        self.law, self.speed, self.angle = law, speed, angle
        self.events: list[Event] = []
        self.system, self._turns = system, turns
        self._rows: list[list[float]] = []
        self._phases: list[Phase] = []
        #: What the follower is after the last phase: a vibration (η, η̇) on the cam, or a flight.
        self.last: FloatArray | Flight = np.zeros(2)

    @property
    def phases(self) -> list[Phase]:
        """All phases so far, in order; each is made when it is asked for first."""
        for row in self._rows[len(self._phases) :]:
            state = self._state(row)
            flight = state if isinstance(state, Flight) else None
            vibration = np.zeros(2) if isinstance(state, Flight) else state
            self._phases.append(Phase(row[at.TIME], row[at.END], vibration, flight))
        return self._phases

    def _state(self, row: list[float]) -> FloatArray | Flight:
        """What the follower is in a row of a run's numbers."""
        if not row[at.FLYING]:
            return np.array(row[at.STATE : at.STATE + 2])
        known = (row[at.GAP], row[at.GAP_RATE]) if row[at.KNOWN] else ()
        state = np.array(row[at.STATE : at.STATE + self.system.load.size])
        return Flight(self.system, state, *known)

    def _begin(self, state: FloatArray | Flight, step: float) -> FloatArray:
        """Where a run begins: in contact with a state, or in flight; ṡ has gained ``step`` m/s."""
        now = np.zeros(at.STATE + self.system.load.size)
        now[at.STEP] = step
        if isinstance(state, Flight):
            now[at.STATE :] = state.start
            gap, gap_rate = state.known or (0.0, 0.0)
            fly_from(now, bool(state.known), gap, gap_rate)
        else:
            now[at.STATE : at.STATE + state.size] = state
        return now

    def _find(self, table: RunTable, now: FloatArray, duration: float) -> None:
        """Phases and events up to ``duration`` s from ``now`` on."""
        room = FIRST_ROOM
        most = self.most_events * max(1, math.ceil(self.speed * duration / TURN - WHOLE_TURN))
        while room == FIRST_ROOM or now[at.TIME] < duration:
            record = record_of(now, room)
            call(run_events, table, record)
            count, met = map(int, record.counts)
            self._rows += record.phases[:count].tolist()
            self.events += [self._event(*row) for row in record.events[:met].tolist()]
            if len(self.events) > most:  # an endless series would be the model's fault
                raise EndlessEventsError(
                    f"more than {most} events in {duration:g} s at {self.speed:g} rad/s; "
                    f"allowed: {self.most_events} a turn"
                )
            room = min(2 * room, MOST_ROOM)
        self.last = self._state(now.tolist())

    def _event(self, landing: float, time: float, impulse: float, lost: float) -> Event:
        kind: EventKind = "landing" if landing else "lift-off"
        angle = self._turns * TURN + (self.angle + self.speed * time)
        return Event(kind, time, angle, impulse, lost)

    def _table(self, duration: float, *follower: Any) -> RunTable:
        """The run's table; ``follower`` from `RunTable.mass` on, up to ``force_noise``."""
        law, speed = self.law, self.speed
        return RunTable(
            cam.Cam(law_table(law), speed, self.angle),
            free_table(self.system),
            jumps_table(law, self.angle, speed, duration),
            *follower,
            float(max(MIN_OF_LIFT * law.lift, MIN_HEIGHT)),
            float(NO_IMPACT * speed * law.lift),
        )

    def shown(
        self, block: Block, grid: SampleGrid, before: FollowerState | None, end: FollowerState
    ) -> tuple[FollowerState, Block]:
        """The end of an interval and its block, flights and impulses written, events in rig time.

        The samples of ``block`` are those of contact; the follower was ``before``.
        """
        for phase in self.phases:
            if phase.flight is not None and (within := grid.within(phase.begin, phase.end)):
                here, times = within
                block.motion[:, here] = phase.flight.motion(times - phase.begin)
                block.force[here] = 0.0
        pending = 0.0 if before is None else before.pending_impulse
        pending = show_impulses(block.rows, grid, self.events, pending)
        begun = block.interval.start_ns / NS
        events = tuple(event._replace(time=begun + event.time) for event in self.events)
        return replace(end, pending_impulse=pending), replace(block, events=events)


def record_of(now: FloatArray, room: int) -> RunRecord:
    """What a run from a place writes, with room for so many phases."""
    rows = np.empty((room, at.PHASE_SIZE)), np.empty((2 * room, at.EVENT_SIZE))
    return RunRecord(now, *rows, np.zeros(2))


#: A rounded force is known to so many rounding errors.
ROUNDING_ERRORS = 64.0


@lru_cache(maxsize=64)
def law_table(law: Law) -> cam.LawTable:
    """The table of a law."""
    size = law.degree + 1
    pieces = np.zeros((law.spans.size, 5, max(size, 2)))
    pieces[:, cam.SIZES, :2] = np.stack([law.spans, law.largest_curvatures], axis=1)
    weighted = law.motion * bernstein.binomials(law.degree)[:, None]
    pieces[:, cam.LIFT : cam.BEND + 1, :size] = np.transpose(weighted, (2, 0, 1))
    pieces[:, cam.ACCELERATION, :size] = law.motion[2].T
    numbers = (*map(float, (*law.bounds[:2], law.largest_step)), bool(law.velocity_jumps))
    return cam.LawTable(law.breaks[:-1].copy(), pieces, size, *numbers)


@lru_cache(maxsize=128)
def free_table(system: FreeSystem) -> air.FreeTable:
    """The table of masses in the air."""
    pairs, size = system.pairs, system.load.size
    rows = np.zeros((air.SERIES + len(system.series), size))
    blocks = [(air.MATRIX, system.matrix), (air.LOAD, system.load), (air.ROW, system.row)]
    blocks += [(air.ENERGY, system.energy), (air.SERIES, system.series)]
    if pairs is not None:
        shown = np.vstack([system.row, system.energy]) @ pairs.shapes
        blocks += [(air.SHAPES, pairs.shapes), (air.INVERSE, pairs.inverse), (air.SEEN, shown)]
        rows[air.DRIFT] = pairs.inverse @ system.load
        rows[air.DAMPING, : size // 2] = pairs.damping
        rows[air.STIFFNESS, : size // 2] = pairs.stiffness
    for first, block in blocks:
        rows[first : first + len(np.atleast_2d(block))] = block
    return air.FreeTable(rows, float(system.window), pairs is not None)


@lru_cache(maxsize=64)
def contact_table(
    response: LinearResponse, output: Outputs, only: Part | None = None
) -> stem.StemContactTable:
    """The table of a response of two states whose output is the contact force; or of one part."""
    known = response.parts if only is None else (only,)
    sizes = [part.particular.shape[1] for part in known]
    parts = np.zeros((len(sizes), 7, max(*sizes, stem.NUMBERS)))
    begins = np.array([part.low for part in known])
    for rows, part, size in zip(parts, known, sizes, strict=True):
        force = polynomial_part(response, part, output)[0]
        rates = bernstein.derivative(force) / part.length
        bend = np.abs(bernstein.derivative(rates)).max() / part.length
        rounding = ROUNDING_ERRORS * bernstein.EPS * np.abs(force).max()
        numbers = part.span, part.length, size, rounding, bend
        rows[stem.PART, : stem.NUMBERS] = *numbers, *part.flow.ravel()
        rows[stem.PLACES : stem.VELOCITIES + 1, :size] = part.particular
        rows[stem.FORCE, :size] = force
        rows[stem.WEIGHTED, :size] = bernstein.binomials(size - 1) * force
        rows[stem.RATES, : rates.size] = bernstein.binomials(rates.size - 1) * rates
        cells = bernstein.parts(size - 1, stem.CELLS) @ force
        rows[stem.LEAST, : stem.CELLS] = cells.min(axis=1) - rounding
    vibration = (*(-response.matrix[1]).tolist(), *output.state[0].tolist())
    return stem.StemContactTable(begins, parts, *vibration, *_window(*vibration))


@lru_cache(maxsize=64)
def _window(
    spring: float, damper: float, place: float, velocity: float
) -> tuple[FloatArray, float]:
    """Ordinates of a vibration's share of the force in a window, and its length (s)."""
    window = REACH / (math.sqrt(spring) + damper)
    matrix, row = np.array([[0.0, 1.0], [-spring, -damper]]), np.array([place, velocity])
    return window_series(matrix, row, window), window


#: The same of a follower without a stem.
NO_CONTACT = stem.StemContactTable(
    np.zeros(0), np.zeros((0, 7, stem.NUMBERS)), 0.0, 0.0, 0.0, 0.0, np.zeros((0, 2)), 0.0
)


def jumps_table(law: Law, angle: float, speed: float, duration: float) -> Jumps:
    """The velocity jumps that an interval owns; see `cam_rig.dynamics.velocity_jumps`."""
    ahead = velocity_jumps_ahead(law, angle, speed, duration)
    end = angle + speed * duration
    before = short_of_velocity_jump(law, end)
    # By rounding an interval may end behind a joint of the next one; a lift-off there is not its.
    clear = duration if before == end else min(duration, (before - angle) / speed)
    rows = np.array([(jump.time, speed * jump.step) for jump in ahead]).reshape(-1, 2)
    return Jumps(rows, float(duration), float(clear))
