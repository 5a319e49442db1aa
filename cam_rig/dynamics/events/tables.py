"""Laws, free systems and contact as tables, in the form that the search takes: lists or arrays."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from cam_rig.dynamics.events.contact import (
    FLOW,
    FORCE,
    NUMBERS,
    PART,
    PLACES,
    RATES,
    VELOCITIES,
    WEIGHTED,
    StemContactTable,
)
from cam_rig.dynamics.events.course import Jumps
from cam_rig.dynamics.events.free_flight import (
    DAMPING,
    DRIFT,
    ENERGY,
    INVERSE,
    LOAD,
    MATRIX,
    ROW,
    SEEN,
    SERIES,
    SHAPES,
    STIFFNESS,
    FreeTable,
)
from cam_rig.dynamics.events.law_table import ACCELERATION, BEND, LIFT, PLACE, LawTable
from cam_rig.dynamics.linear.free_system import FreeSystem
from cam_rig.dynamics.linear.response import LinearResponse, Part
from cam_rig.dynamics.linear.sampling import Outputs, polynomial_part
from cam_rig.dynamics.velocity_jumps import short_of_velocity_jump, velocity_jumps_ahead
from cam_rig.laws import Law, bernstein

Table = TypeVar("Table")
#: A rounded force is known to so many rounding errors.
ROUNDING_ERRORS = 64.0


def table_of(kind: Callable[..., Table], arrays: bool, *values: Any) -> Table:
    """A table whose numbers are floats, its arrays contiguous arrays or lists of them.

    Compiled code is for one type each; a table inside it is in form already.
    """
    return kind(*(_in_form(value, arrays) for value in values))


def _in_form(value: Any, arrays: bool) -> Any:
    if isinstance(value, np.ndarray):
        return np.array(value, dtype=np.float64, order="C") if arrays else value.tolist()
    return value if isinstance(value, bool | int | tuple | list) else float(value)


@lru_cache(maxsize=64)
def law_table(law: Law, arrays: bool) -> LawTable:
    """The table of a law."""
    size = law.degree + 1
    pieces = np.zeros((law.spans.size, 5, max(size, 3)))
    pieces[:, PLACE, :3] = np.stack([law.breaks[:-1], law.spans, law.bends], axis=1)
    weighted = law.motion * bernstein.binomials(law.degree)[:, None]
    pieces[:, LIFT : BEND + 1, :size] = np.transpose(weighted, (2, 0, 1))
    pieces[:, ACCELERATION, :size] = law.motion[2].T
    largest, steepest, _ = law.bounds
    jumps = bool(law.velocity_jumps)
    return table_of(LawTable, arrays, pieces, size, largest, steepest, law.largest_step, jumps)


@lru_cache(maxsize=128)
def free_table(system: FreeSystem, arrays: bool) -> FreeTable:
    """The table of masses in the air."""
    pairs, size = system.pairs, system.load.size
    rows = np.zeros((SERIES + len(system.series), size))
    blocks = {MATRIX: system.matrix, LOAD: system.load, ROW: system.row, ENERGY: system.energy}
    if pairs is not None:
        blocks |= {SHAPES: pairs.shapes, INVERSE: pairs.inverse, DRIFT: pairs.inverse @ system.load}
        shown = np.vstack([system.row, system.energy]) @ pairs.shapes
        blocks |= {SEEN: shown}
        rows[DAMPING, : size // 2], rows[STIFFNESS, : size // 2] = pairs.damping, pairs.stiffness
    for first, block in (blocks | {SERIES: system.series}).items():
        rows[first : first + len(np.atleast_2d(block))] = block
    return table_of(FreeTable, arrays, rows, system.window, pairs is not None)


@lru_cache(maxsize=64)
def contact_table(
    response: LinearResponse, output: Outputs, arrays: bool, only: Part | None = None
) -> StemContactTable:
    """The table of a response of two states whose output is the contact force; or of one part."""
    known = response.parts if only is None else (only,)
    sizes = [part.particular.shape[1] for part in known]
    parts = np.zeros((len(sizes), 6, max(*sizes, NUMBERS)))
    for rows, part, size in zip(parts, known, sizes, strict=True):
        force = polynomial_part(response, part, output)[0]
        rates = bernstein.derivative(force) / part.length
        bend = np.abs(bernstein.derivative(rates)).max() / part.length
        rounding = ROUNDING_ERRORS * bernstein.EPS * np.abs(force).max()
        rows[PART, :FLOW] = part.low, part.span, part.length, size, force.min(), rounding, bend
        rows[PART, FLOW:NUMBERS] = part.flow.ravel()
        rows[PLACES : VELOCITIES + 1, :size], rows[FORCE, :size] = part.particular, force
        rows[WEIGHTED, :size] = bernstein.binomials(size - 1) * force
        rows[RATES, : rates.size] = bernstein.binomials(rates.size - 1) * rates
    _, (spring, damper) = response.matrix
    return table_of(StemContactTable, arrays, parts, -spring, -damper, *output.state[0])


def jumps_table(law: Law, angle: float, speed: float, duration: float, arrays: bool) -> Jumps:
    """The velocity jumps that an interval owns; see `cam_rig.dynamics.velocity_jumps`."""
    ahead = velocity_jumps_ahead(law, angle, speed, duration)
    end = angle + speed * duration
    before = short_of_velocity_jump(law, end)
    # By rounding an interval may end behind a joint of the next one; a lift-off there is not its.
    clear = duration if before == end else min(duration, (before - angle) / speed)
    rows = np.array([(jump.time, speed * jump.step) for jump in ahead]).reshape(-1, 2)
    return table_of(Jumps, arrays, rows, duration, clear)
