"""Runs the event search over an interval, in plain Python or compiled, piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar

import numpy as np

from cam_rig.dynamics.events.compiled import form_of, plain_time
from cam_rig.dynamics.events.course import EVENT_SIZE, PHASE_SIZE, STATE, STEP, TIME, Record
from cam_rig.dynamics.events.rows import zero_rows

T = TypeVar("T")

#: Phases that are found in one call: of plain Python, and compiled.
ROOM, COMPILED_ROOM = 32, 1024


class Found(NamedTuple):
    """Phases and events that a call has found, as rows of numbers (see `course`)."""

    phases: list[list[float]]
    events: list[list[float]]


def search(
    run: Callable[[Any, Record], None],
    table: Callable[[bool], Any],
    now: list[float],
    duration: float,
) -> Iterator[Found]:
    """Phases and events up to ``duration`` s; ``now`` is where the run is, and is kept so.

    Parameters
    ----------
    run : `run_one_mass` or `run_two_mass`
    table : what it takes, of arrays or of lists
    """
    begun = False
    while not begun or now[TIME] < duration:
        begun, compiled = True, form_of(run)
        yield _compiled(compiled, table(True), now) if compiled else _plain(run, table(False), now)


def _plain(run: Callable[[Any, Record], None], table: Any, now: list[float]) -> Found:
    record = Record(now, zero_rows(ROOM, PHASE_SIZE), zero_rows(2 * ROOM, EVENT_SIZE), [0.0, 0.0])
    with plain_time():
        run(table, record)
    phases, events = (int(count) for count in record.counts)
    return Found(record.phases[:phases], record.events[:events])


def _compiled(run: Callable[[Any, Any], None], table: Any, now: list[float]) -> Found:
    place, counts = np.array(now), np.zeros(2)
    rows, events = np.zeros((COMPILED_ROOM, PHASE_SIZE)), np.zeros((2 * COMPILED_ROOM, EVENT_SIZE))
    record: Any = Record(place, rows, events, counts)  # type: ignore[arg-type]
    run(table, record)
    now[:] = place.tolist()
    return Found(rows[: int(counts[0])].tolist(), events[: int(counts[1])].tolist())


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
