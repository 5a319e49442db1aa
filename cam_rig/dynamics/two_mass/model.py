"""The two-mass model as states at any times and as blocks of samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cam_rig.dynamics.interval import (
    Block,
    FollowerState,
    Interval,
    SampleGrid,
    Samples,
    show_impulses,
)
from cam_rig.dynamics.linear.exponential import Flight
from cam_rig.dynamics.linear.sampling import sample
from cam_rig.dynamics.parameters import times_of
from cam_rig.dynamics.speed_ramp import with_ramps
from cam_rig.dynamics.two_mass.masses import TwoMassParameters, contact_response, force_output
from cam_rig.dynamics.two_mass.trajectory import Separation, TwoMassPhase
from cam_rig.laws import Law
from cam_rig.laws.sampling import sample as sample_law
from cam_rig.units import NS, FloatArray


def states(course: Separation, times: FloatArray) -> FloatArray:
    """(z, ż, y, ẏ, F) at ascending times in s of a course, ``(5, len(times))``."""
    end = course.phases[-1].end if course.phases else 0.0
    times = times_of(times, last=end * (1.0 + 1e-12))
    out = np.empty((5, times.size))
    for phase in course.phases:
        last = phase is course.phases[-1]
        a = int(np.searchsorted(times, phase.begin))
        b = times.size if last else int(np.searchsorted(times, phase.end))
        if a < b:
            out[:, a:b] = _phase_states(course, phase, times[a:b])
    return out


def _phase_states(course: Separation, phase: TwoMassPhase, times: FloatArray) -> FloatArray:
    if phase.flight is not None:
        flight = course.fly(phase.flight, times - phase.begin)
        return np.vstack([flight, np.zeros(times.size)])
    response = contact_response(course.law, course.parameters, course.speed)
    angle = course.angle + course.speed * phase.begin
    vibration = response.states(phase.vibration, angle, times - phase.begin)
    cam = course.cam(times)
    end_mass = course.parameters.static_place(cam) + vibration
    return np.vstack([cam[:2], end_mass, course.force(vibration, times)])


@with_ramps
def advance(
    law: Law,
    parameters: TwoMassParameters,
    state: FollowerState | None,
    interval: Interval,
    sample_rate: int,
    step: float,
) -> tuple[FollowerState, Block]:
    """Take the follower through the interval; None puts it on the cam without vibration.

    The block's motion is that of the roller mass, which meets the cam. ``step`` is by how much ṡ
    is more than where ``state`` ended, m/s.
    """
    course = Separation(law, parameters, interval.speed, interval.angle)
    course.go(interval.duration, _start(course, state), step)
    grid = interval.grid(sample_rate)
    rows = grid.rows()
    for phase in course.phases:
        _show(rows, grid, course, phase)
    begun = interval.start_ns / NS
    pending = state.pending_impulse if state is not None else 0.0
    pending = show_impulses(rows, grid, course.events, pending)
    events = tuple(
        replace(event, time=begun + event.time, angle=interval.unwrapped_at(event.time))
        for event in course.events
    )
    end = _end(course, interval.duration, pending)
    return end, Block(interval, rows, events)


def _end(course: Separation, duration: float, pending: float) -> FollowerState:
    last = course.last
    if isinstance(last, Flight):
        z, v, _, _ = course.fly(last, np.zeros(1))[:, 0].tolist()
        return FollowerState(z, v, 0.0, False, pending, (*last.start.tolist(), *last.known))
    cam = course.cam_at_end(duration)
    force = course.force_of(last, cam)
    return FollowerState(cam[0], cam[1], force, True, pending, tuple(last.tolist()))


def _start(course: Separation, state: FollowerState | None) -> FloatArray | Flight:
    """A vibration (η, η̇) in contact; else a flight from (w, ẇ, Y, Ẏ), its gap and its rate."""
    if state is None:
        return np.zeros(2)
    if state.in_contact:
        return np.array(state.inner)
    return course.lifted_off(np.array(state.inner[:4]), *state.inner[4:])


def _show(rows: FloatArray, grid: SampleGrid, course: Separation, phase: TwoMassPhase) -> None:
    """Fill the samples of one phase."""
    first = grid.index_after(phase.begin)
    end = min(grid.index_after(phase.end), grid.count)
    if first >= end:
        return
    times = grid.offset + np.arange(first, end) / grid.sample_rate
    shown = Samples(rows)
    if phase.flight is None:
        response = contact_response(course.law, course.parameters, course.speed)
        angle = course.angle + course.speed * phase.begin
        shown.motion[:, first:end] = sample_law(
            course.law,
            course.angle + course.speed * float(times[0]),
            course.speed / grid.sample_rate,
            end - first,
            np.diag(course.speed ** np.arange(3.0)),
            np.zeros(3),
        )
        shown.force[first:end] = sample(
            response,
            phase.vibration,
            angle,
            float(times[0]) - phase.begin,
            1.0 / grid.sample_rate,
            end - first,
            force_output(course.parameters),
        )
    else:
        shown.motion[:, first:end] = phase.flight.motion(times - phase.begin)
