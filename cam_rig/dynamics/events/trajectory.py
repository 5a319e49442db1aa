"""Trajectory of a follower through contacts and flights, and the arrays for its search.

The search for lift-offs and landings (`cam_rig.dynamics.events.runs`) works on arrays and tuples.
This module creates them from the law and the follower, and converts the result.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.events.backend import dispatch
from cam_rig.dynamics.events.contact import CELLS, CONTACT_PART, StemContactRow, StemContactTable
from cam_rig.dynamics.events.free_flight import FREE_SYSTEM
from cam_rig.dynamics.events.law_table import LAW_PIECE, Cam, LawRow, LawTable
from cam_rig.dynamics.events.run_table import (
    COUNTS,
    EVENT,
    JUMP,
    RUN_STATE,
    EventCode,
    Jumps,
    RunMode,
    RunRecord,
    RunTable,
)
from cam_rig.dynamics.events.runs import run_events, start_flight
from cam_rig.dynamics.interval import (
    Block,
    Event,
    EventKind,
    FollowerState,
    SampleGrid,
    add_impulses,
)
from cam_rig.dynamics.linear.exponential import REACH, Flight, FreeSystem, window_series
from cam_rig.dynamics.linear.response import LinearResponse, Outputs, Part, polynomial_part
from cam_rig.dynamics.velocity_jumps import step_before_velocity_jump, velocity_jumps_ahead
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import NS, TURN, FloatArray

#: Number of phases (contact or flight) that the arrays of the first call of the event search can
#: contain. Each further call has room for twice as many.
FIRST_ROOM = 32
#: Largest number of phases (contact or flight) that the arrays of a call of the event search can
#: contain.
MAX_ROOM = 4096
#: To limit the number of lift-offs and landings per turn, the duration of a run is rounded up to
#: whole turns. A smaller fraction of a turn than this is neglected.
TURN_ROUNDING = 1e-6
#: Smallest abrupt change of the cam's velocity that is not rounding, relative to cam speed × lift
#: (rad/s × m).
MIN_VELOCITY_STEP = 1e-12
#: Smallest height of a bounce as a fraction of the cam's lift. A lower bounce counts as contact.
MIN_BOUNCE_RATIO = 1e-12
#: Smallest height of a bounce in m, for very small lifts: 1e-5 of the size of an atom.
MIN_BOUNCE_HEIGHT = 1e-15
#: Upper bound of the rounding error of a contact force, as a multiple of the float epsilon of its
#: largest Bernstein ordinate.
ROUNDING_ERRORS = 64.0


@dataclass(frozen=True, eq=False)
class Phase:
    """Phase of a trajectory: contact with the cam, or a flight."""

    begin: float  #: start time, s since the start of the interval
    end: float  #: end time, s since the start of the interval
    #: Vibration (η, η̇) of the end mass at the start, ``(2,)``: 0 in flight, unused for one mass.
    vibration: FloatArray
    flight: Flight | None = None  #: free motion of the follower, or None in contact


class EndlessEventsError(DynamicsError):
    """Error of a run with more lift-offs and landings per turn than ``max_events``."""


class Trajectory:
    """Trajectory of a follower on one law at one cam speed (rad/s), in one interval.

    Times are in s since the start of the interval.

    There is no time stepping. Contact ends at a zero of the contact force, a flight at a zero of
    the gap to the cam, and between these the motion is known in closed form. Both also end at a
    joint of the law at which its velocity jumps. `cam_rig.dynamics.events.runs` describes the state
    machine.
    """

    #: Number of lift-offs and landings per turn above which a run fails with an
    #: `EndlessEventsError`. No physical series of bounces reaches this number.
    max_events: ClassVar[int]

    def __init__(
        self, law: Law, system: FreeSystem, speed: float, angle: float, turns: int = 0
    ) -> None:
        self.law, self.speed, self.angle = law, speed, angle
        self.events: list[Event] = []
        self.system, self._turns = system, turns
        self._recorded: list[NDArray[np.void]] = []  # records of `RUN_STATE`
        self._phases: list[Phase] = []
        #: State after the last phase: a vibration (η, η̇) in contact, or a flight.
        self.last: FloatArray | Flight = np.zeros(2)

    @property
    def records(self) -> NDArray[np.void]:
        """Phases (contact or flight) in the order of time, as records of `RUN_STATE`."""
        if len(self._recorded) != 1:
            self._recorded = [np.concatenate([np.empty(0, RUN_STATE), *self._recorded])]
        return self._recorded[0]

    @property
    def phases(self) -> list[Phase]:
        """Phases (contact or flight) of the trajectory in the order of time.

        The list is created at the first access.
        """
        records = self.records[len(self._phases) :]
        starts, ends = records["time"].tolist(), records["phase_end"].tolist()
        for start, end, state in zip(starts, ends, self._states(records), strict=True):
            flight = state if isinstance(state, Flight) else None
            vibration = np.zeros(2) if isinstance(state, Flight) else state
            self._phases.append(Phase(start, end, vibration, flight))
        return self._phases

    def flights_at(self, times: FloatArray) -> tuple[NDArray[np.bool], FloatArray, FloatArray]:
        """Return the flights at times (s), ``(m,)``.

        The results are True for each time in flight, ``(m,)``, the states at the start of the
        flight for these k times, ``(n, k)``, and the times since then (s), ``(k,)``. A time at the
        border of two phases belongs to the later one.
        """
        records = self.records
        phase = np.searchsorted(records["time"], times, side="right") - 1
        is_flying = records["mode"][phase] == RunMode.FLIGHT
        flights = records[phase[is_flying]]
        starts = flights["vector"][:, : self.system.load.size].T
        return is_flying, starts, times[is_flying] - flights["time"]

    def _states(self, records: NDArray[np.void]) -> list[FloatArray | Flight]:
        """Return the state of the follower in each record of `RUN_STATE`.

        A state in contact is the vibration (η, η̇) of the end mass, ``(2,)``. A state in flight is a
        `Flight`.
        """
        names = ("mode", "gap_known", "gap", "gap_rate")
        columns = (records[name].tolist() for name in names)
        states: list[FloatArray | Flight] = []
        for vector, mode, gap_known, gap, gap_rate in zip(records["vector"], *columns, strict=True):
            if mode == RunMode.CONTACT:
                states.append(vector[:2].copy())
            else:
                known_gap = (gap, gap_rate) if gap_known else ()
                start = vector[: self.system.load.size].copy()
                states.append(Flight(self.system, start, *known_gap))
        return states

    def _start_record(self, state: FloatArray | Flight, step: float) -> NDArray[np.void]:
        """Return the initial state of a run as an array of one record of `RUN_STATE`.

        ``state`` is the vibration (η, η̇) of the end mass in contact, or a flight. ``step`` is an
        abrupt change of the cam's velocity ṡ (m/s) that is applied when the run starts.
        """
        records = np.zeros(1, RUN_STATE)
        record, vector = records[0], records[0]["vector"]
        record["initial_step"] = step
        if isinstance(state, Flight):
            vector[: state.start.size] = state.start
            gap, gap_rate = state.gap_state or (0.0, 0.0)
            start_flight(record, bool(state.gap_state), gap, gap_rate)
        else:
            vector[: state.size] = state
        return records

    def _search(self, table: RunTable, state: NDArray[np.void], duration: float) -> None:
        """Search for lift-offs and landings from ``state`` up to ``duration`` s.

        The phases and events are appended to the trajectory, and the final state becomes ``last``.
        ``state`` is one record of `RUN_STATE`, which the search updates.

        Raises
        ------
        EndlessEventsError
            If there are more than ``max_events`` events per turn.
        """
        room = FIRST_ROOM
        turns = max(1, math.ceil(self.speed * duration / TURN - TURN_ROUNDING))
        max_events = self.max_events * turns
        while room == FIRST_ROOM or state[0]["time"] < duration:
            record = new_record(state, room)
            dispatch(run_events, table, record)
            phase_count, event_count = record.counts[0].tolist()
            self._recorded.append(record.phases[:phase_count])
            for code, time, impulse, lost in record.events[:event_count].tolist():
                kind: EventKind = "landing" if code == EventCode.LANDING else "lift-off"
                angle = self._turns * TURN + (self.angle + self.speed * time)
                self.events.append(Event(kind, time, angle, impulse, lost))
            if len(self.events) > max_events:
                raise EndlessEventsError(
                    f"more than {max_events} events in {duration:g} s at {self.speed:g} rad/s; "
                    f"allowed: {self.max_events} per turn"
                )
            room = min(2 * room, MAX_ROOM)
        self.last = self._states(state)[0]

    def _table(self, duration: float, **follower: Any) -> RunTable:
        """Return the coefficients for the event search in an interval of ``duration`` s.

        ``follower`` contains the fields of `RunTable` that depend on the follower model.
        """
        law, speed = self.law, self.speed
        return RunTable(
            cam=Cam(law=law_table(law), speed=speed, angle=self.angle),
            free=free_table(self.system),
            jumps=jumps_table(law, self.angle, speed, duration),
            min_bounce_height=float(max(MIN_BOUNCE_RATIO * law.lift, MIN_BOUNCE_HEIGHT)),
            min_velocity_step=float(MIN_VELOCITY_STEP * speed * law.lift),
            **follower,
        )

    def finish(
        self, block: Block, grid: SampleGrid, before: FollowerState | None, end: FollowerState
    ) -> tuple[FollowerState, Block]:
        """Add flights, impulses and events to the state and the block of an interval.

        ``block`` contains the samples of contact, ``before`` is the state at the start of the
        interval, ``end`` the state at its end. Returns the completed state and block. Events are in
        rig time. An event is a lift-off or a landing.
        """
        for phase in self.phases:
            if phase.flight is not None and (within := grid.find_samples(phase.begin, phase.end)):
                samples, times = within
                block.motion[:, samples] = phase.flight.motion(times - phase.begin)
                block.force[samples] = 0.0
        pending = 0.0 if before is None else before.pending_impulse
        pending = add_impulses(block.rows, grid, self.events, pending)
        start = block.interval.start_ns / NS
        events = tuple(event._replace(time=start + event.time) for event in self.events)
        return replace(end, pending_impulse=pending), replace(block, events=events)


def new_record(state: NDArray[np.void], room: int) -> RunRecord:
    """Return the empty output arrays of an event search that starts in ``state``.

    They have room for ``room`` phases and twice as many events. ``state`` is one record of
    `RUN_STATE`.
    """
    return RunRecord(
        state=state,
        phases=np.empty(room, RUN_STATE),
        events=np.empty(2 * room, EVENT),
        counts=np.zeros(1, COUNTS),
    )


@lru_cache(maxsize=64)
def law_table(law: Law) -> LawTable:
    """Return the polynomials of a law as arrays, for the search for events.

    An event is a lift-off or a landing.
    """
    pieces = np.zeros(law.spans.size, LAW_PIECE)
    pieces["start"], pieces["span"] = law.breaks[:-1], law.spans
    pieces["max_curvature"] = law.largest_curvatures
    polynomials = np.zeros((law.spans.size, len(LawRow), law.degree + 1))
    weighted = law.motion * bernstein.binomials(law.degree)[:, None]
    polynomials[:, LawRow.LIFT : LawRow.CURVATURE + 1] = np.transpose(weighted, (2, 0, 1))
    polynomials[:, LawRow.CURVATURE_ORDINATES] = law.motion[2].T
    max_lift, max_slope, _ = map(float, law.bounds)
    return LawTable(
        pieces=pieces,
        polynomials=polynomials,
        size=law.degree + 1,
        max_lift=max_lift,
        max_slope=max_slope,
        max_lift_step=float(law.largest_step),
        has_velocity_jumps=bool(law.velocity_jumps),
    )


@lru_cache(maxsize=128)
def free_table(system: FreeSystem) -> NDArray[np.void]:
    """Return the coefficients of the masses in flight, as one record of `FREE_SYSTEM`.

    ``system`` is their equation of motion. The search for events uses the record. An event is a
    lift-off or a landing.
    """
    table, pairs, n = np.zeros(1, FREE_SYSTEM), system.pairs, system.load.size
    record = table[0]
    record["size"], record["window"], record["has_pairs"] = n, system.window, pairs is not None
    record["matrix"][:n, :n], record["load"][:n] = system.matrix, system.load
    record["contact_row"][:n], record["energy"][:n, :n] = system.row, system.energy
    record["series"][:, :n] = system.series
    if pairs is not None:
        record["modes"][:n, :n], record["inverse"][:n, :n] = pairs.shapes, pairs.inverse
        record["modal_load"][:n] = pairs.inverse @ system.load
        record["pair_damping"][: n // 2] = pairs.damping
        record["pair_stiffness"][: n // 2] = pairs.stiffness
        modal = np.vstack([system.row, system.energy]) @ pairs.shapes
        record["modal_contact_row"][:n], record["modal_energy"][:n, :n] = modal[0], modal[1:]
    return table


@lru_cache(maxsize=64)
def contact_table(
    response: LinearResponse, output: Outputs, only: Part | None = None
) -> StemContactTable:
    """Return the coefficients for the search for a loss of contact of two masses.

    ``response`` is the forced response of the end mass, with the two states (η, η̇). ``output`` is
    the contact force. If ``only`` is given, the result contains only this part of the turn.
    """
    used = response.parts if only is None else (only,)
    sizes = [part.particular.shape[1] for part in used]
    records = np.zeros(len(used), CONTACT_PART)
    polynomials = np.zeros((len(used), len(StemContactRow), max(sizes)))
    for record, rows, part, size in zip(records, polynomials, used, sizes, strict=True):
        force = polynomial_part(response, part, output)[0]
        rates = bernstein.derivative(force) / part.length
        rounding = ROUNDING_ERRORS * bernstein.EPS * np.abs(force).max()
        record["start"], record["span"], record["duration"] = part.low, part.span, part.length
        record["size"], record["force_rounding"], record["flow"] = size, rounding, part.flow
        curvature = np.abs(bernstein.derivative(rates)).max() / part.length
        record["max_force_curvature"] = curvature
        cells = bernstein.parts(size - 1, CELLS) @ force
        record["cell_minima"] = cells.min(axis=1) - rounding
        rows[: StemContactRow.VELOCITY + 1, :size] = part.particular
        rows[StemContactRow.FORCE, :size] = force
        rows[StemContactRow.WEIGHTED_FORCE, :size] = bernstein.binomials(size - 1) * force
        weighted_rates = bernstein.binomials(rates.size - 1) * rates
        rows[StemContactRow.WEIGHTED_FORCE_RATE, : rates.size] = weighted_rates
    stiffness, damping = (-response.matrix[1]).tolist()
    p, q = output.state[0].tolist()
    series, window = _window(stiffness, damping, p, q)
    return StemContactTable(
        parts=records,
        polynomials=polynomials,
        stiffness=stiffness,
        damping=damping,
        force_per_displacement=p,
        force_per_velocity=q,
        series=series,
        window=window,
    )


@lru_cache(maxsize=64)
def _window(stiffness: float, damping: float, p: float, q: float) -> tuple[FloatArray, float]:
    """Return the series of a free vibration's force p η + q η̇ over a short time.

    The first result is the matrix from (η, η̇) at the start to the Bernstein ordinates of the force,
    ``(d + 1, 2)``. The second is the duration (s) for which the truncated series is exact to
    rounding. ``stiffness`` (1/s²) and ``damping`` (1/s) are those of η̈ = −κ η − 2δ η̇.
    """
    window = REACH / (math.sqrt(stiffness) + damping)
    matrix, row = np.array([[0.0, 1.0], [-stiffness, -damping]]), np.array([p, q])
    return window_series(matrix, row, window), window


#: Empty contact coefficients for a follower of one mass, which does not use them.
NO_CONTACT = StemContactTable(
    parts=np.zeros(0, CONTACT_PART),
    polynomials=np.zeros((0, len(StemContactRow), 0)),
    stiffness=0.0,
    damping=0.0,
    force_per_displacement=0.0,
    force_per_velocity=0.0,
    series=np.zeros((0, 2)),
    window=0.0,
)


def jumps_table(law: Law, angle: float, speed: float, duration: float) -> Jumps:
    """Return the velocity jumps of a law in an interval of constant cam speed.

    The interval starts at the cam angle ``angle`` (rad) and takes ``duration`` s at ``speed``
    rad/s. `cam_rig.dynamics.velocity_jumps` describes which jumps at its ends belong to it.
    """
    jumps = velocity_jumps_ahead(law, angle, speed, duration)
    ahead = np.array([(jump.time, speed * jump.step) for jump in jumps], dtype=JUMP)
    end = angle + speed * duration
    before = step_before_velocity_jump(law, end)
    limit = duration if before == end else min(duration, (before - angle) / speed)
    return Jumps(ahead=ahead, duration=float(duration), contact_limit=float(limit))
