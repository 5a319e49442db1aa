"""Runs the event search over an interval, in plain Python or compiled, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cam_rig.dynamics.events.compiled import form_of, plain_time
from cam_rig.dynamics.events.course import EVENT_SIZE, PHASE_SIZE, STATE, STEP, TIME, RunRecord
from cam_rig.dynamics.events.rows import zero_rows, zeros

T = TypeVar("T")

#: Phases that are found in one call: in the first, and in the longest, each having twice the room
#: of the one before; compiled so many times more.
FIRST_ROOM, MOST_ROOM, COMPILED_ROOM = 4, 128, 32


class FoundPhases(NamedTuple):
    """Phases and events that a call has found, as rows of numbers (see `course`)."""

    phases: list[list[float]]
    events: list[list[float]]


def search(
    run: Callable[[Any, RunRecord], None],
    table: Callable[[bool], Any],
    now: list[float],
    duration: float,
) -> Iterator[FoundPhases]:
    """Phases and events up to ``duration`` s; ``now`` is where the run is, and is kept so.

    Parameters
    ----------
    run : `run_one_mass` or `run_two_mass`
    table : what it takes, of arrays or of lists
    """
    room, tables = FIRST_ROOM, cache(table)
    while room == FIRST_ROOM or now[TIME] < duration:
        compiled = form_of(run)
        if compiled is None:
            yield _plain(run, tables(False), now, room)
        else:
            yield _compiled(compiled, tables(True), now, COMPILED_ROOM * room)
        room = min(2 * room, MOST_ROOM)


def _plain(
    run: Callable[[Any, RunRecord], None], table: Any, now: list[float], room: int
) -> FoundPhases:
    phases, events, counts = zero_rows(room, PHASE_SIZE), zero_rows(2 * room, EVENT_SIZE), zeros(2)
    with plain_time():
        run(table, RunRecord(now, phases, events, counts))
    return FoundPhases(phases[: int(counts[0])], events[: int(counts[1])])


def _compiled(
    run: Callable[[Any, Any], None], table: Any, now: list[float], room: int
) -> FoundPhases:
    place, counts = np.array(now), np.zeros(2)
    phases, events = np.empty((room, PHASE_SIZE)), np.empty((2 * room, EVENT_SIZE))
    record: Any = (place, phases, events, counts)
    run(table, RunRecord(*record))
    now[:] = place.tolist()
    return FoundPhases(phases[: int(counts[0])].tolist(), events[: int(counts[1])].tolist())


def at_start(size: int, state: list[float], step: float) -> list[float]:
    """Where a run begins: in contact with a state of up to ``size`` numbers, ṡ gaining ``step``."""
    now = [0.0] * STATE + state + [0.0] * (size - len(state))
    now[STEP] = step
    return now


def call(function: Callable[..., T], table: Callable[[bool], Any], *arguments: Any) -> T:
    """A function of the search, of a table and plain numbers, in plain Python or compiled."""
    compiled = form_of(function)
    if compiled is not None:
        out: T = compiled(table(True), *arguments)
        return out
    lists = table(False)
    with plain_time():
        return function(lists, *arguments)
