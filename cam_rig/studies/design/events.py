"""The events of a law: what lies between its dwells, and how it begins and ends there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.units import TURN

#: A piece of a law whose ordinates differ by no more than this part of the lift is a dwell.
FLAT = 1e-12
#: A turn's end meets its start where they differ by no more than this part of a derivative.
MEETS = 1e-9


@dataclass(frozen=True)
class LawEvent:
    """A stretch of the turn that a design may change.

    ``start`` and ``span`` in rad; ``first`` and ``last`` are s and its derivatives (m/radᵏ) at
    both ends, as many as stay.
    """

    start: float
    span: float
    first: tuple[float, ...]
    last: tuple[float, ...]


def dwells(law: Law) -> list[tuple[float, float]]:
    """Where a law rests, from and to (rad), joined where pieces meet at one level."""
    flat = np.ptp(law.ordinates, axis=0) <= FLAT * law.lift
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(flat):
        begin, end = float(law.breaks[i]), float(law.breaks[i + 1])
        if found and found[-1][1] == begin:
            begin = found.pop()[0]
        found.append((begin, end))
    return found


def events(law: Law, joints: int) -> list[LawEvent]:
    """What lies between the dwells of a law; their ends are those of their neighbours.

    Raises
    ------
    ConfigError : the law rests all around, or has no dwell and a turn that does not join itself
    """
    edges = [0.0, *(angle for dwell in dwells(law) for angle in dwell), TURN]
    found = []
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end > begin:
            pieces = np.searchsorted(law.breaks, [begin, end])
            before, after = (int(pieces[0]) - 1) % law.spans.size, int(pieces[1]) % law.spans.size
            first, last = _end(law, before, -1, joints), _end(law, after, 0, joints)
            found.append(LawEvent(begin, end - begin, first, last))
    if not found:
        raise ConfigError(f"cam {law.name!r}: it rests all around; allowed: a cam with a lift")
    if len(edges) == 2:
        _require_joined(law, joints)
    return found


def retimed(law: Law, found: list[LawEvent], edges: FloatArray) -> Law:
    """A law whose events begin and end elsewhere, and which is in proportion between these angles.

    Parameters
    ----------
    found : its events
    edges : rad, rising: the turn's start, both new ends of each event in turn, the turn's end
    """
    ends = [angle for event in found for angle in (event.start, event.start + event.span)]
    breaks = np.interp(law.breaks, [0.0, *ends, TURN], edges)
    breaks[-1] = TURN
    return Law(law.name, breaks, law.ordinates)


def _end(law: Law, piece: int, end: int, joints: int) -> tuple[float, ...]:
    """S and its derivatives at the start (0) or at the end (−1) of a piece."""
    return tuple(float(law.derivative_ordinates(k)[end, piece]) for k in range(joints + 1))


def _require_joined(law: Law, joints: int) -> None:
    """Refuse a turn without a dwell whose end and start differ in a derivative that stays."""
    for order in range(joints + 1):
        ordinates = law.derivative_ordinates(order)
        if abs(ordinates[0, 0] - ordinates[-1, -1]) > MEETS * np.abs(ordinates).max():
            raise ConfigError(
                f"cam {law.name!r}: it has no dwell, and derivative {order} at the turn's end is "
                f"not that at its start; allowed: joints up to C{order - 1}"
            )
