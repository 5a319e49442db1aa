"""Contact of several cams on one rig at one speed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from cam_rig.dynamics import FollowerParameters
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import joined
from cam_rig.laws.cam import CamSet, law_of
from cam_rig.laws.law import Extreme
from cam_rig.laws.segments import NAMED_RISES, unit_rise
from cam_rig.paper.contact.surfaces import BaseBounds, ContactCase, base_bounds, contact_case
from cam_rig.profile.contact import Motion
from cam_rig.profile.measure import closure
from cam_rig.schema import CamConfig, load_cam
from cam_rig.units import RPM, TURN, FloatArray


@dataclass(frozen=True, eq=False)
class ContactRow:
    """What a cam's contact comes to over the turn.

    Parameters
    ----------
    case : the cam, its law, and the surfaces
    pressure : Pa, largest Hertz pressure, and where
    load, width : N and m, normal force and width of the contact there
    relative_radius : m, 1/κ of the pair there; of the follower alone where the cam is straight
    sliding : m/s, largest speed of the cam's surface along the follower's, and where
    lost : whether the cam would have to pull somewhere: there is no contact, nor pressure
    bounds : on the base radius
    """

    case: ContactCase
    pressure: Extreme
    load: float
    width: float
    relative_radius: float
    sliding: Extreme
    lost: bool
    bounds: BaseBounds

    @property
    def roller_speed(self) -> float | None:
        """Greatest speed (rad/s) of a roller about its pin, carried along by the cam."""
        surfaces = self.case.surfaces
        return self.sliding.value / surfaces.radius if surfaces.rolls else None


@dataclass(frozen=True)
class ContactTable:
    """Rows by cam, on a rig of that name at one speed (rpm)."""

    rig: str
    rpm: float
    rows: dict[str, ContactRow]


def compare_contacts(cam_set: CamSet, rpm: float) -> ContactTable:
    """The contact of every cam of a set at one speed."""
    rig = FollowerParameters.from_rig(cam_set.rig)
    rows = {
        name: contact_row(contact_case(cam, cam_set.laws[name], rig, rpm * RPM))
        for name, cam in cam_set.cams.items()
    }
    return ContactTable(cam_set.rig.name, rpm, rows)


def contact_row(case: ContactCase) -> ContactRow:
    """All measures of one cam."""
    surfaces, scan = case.surfaces, case.scan
    pressure = scan.greatest_of(surfaces.pressure)
    lightest = -scan.greatest_of(lambda *at: -surfaces.normal_force(*at)).value
    # At a joint the pressure jumps: both sides of it, and the one that presses harder.
    sides = [Motion.at(case.law, np.array([pressure.angle + d])) for d in (-1e-9 * TURN, 0.0)]
    at = max(sides, key=lambda side: surfaces.pressure(side, scan.element.touch(side))[0])
    touch = scan.element.touch(at)
    return ContactRow(
        case=case,
        pressure=pressure,
        load=float(surfaces.normal_force(at, touch)[0]),
        width=float(surfaces.width(at, touch)[0]),
        relative_radius=float(1.0 / surfaces.curvature(touch)[0]),
        sliding=scan.greatest_of(surfaces.sliding),
        lost=lightest <= 0.0,
        bounds=base_bounds(case),
    )


# Least base radius over the event angle, law by law: the nomogram of the cam handbooks.

#: Laws of the diagram: every full rise without an infinite acceleration, each once.
RISES = (
    "simple_harmonic",
    "modified_trapezoid",
    "modified_sine",
    "cycloidal",
    "poly345",
    "poly4567",
    "bezier9",
)

assert set(RISES) <= set(NAMED_RISES)

#: Halvings of the search for a radius: to 1e-12 of the lift.
HALVINGS = 48

#: Samples of each piece of a rise: a radius comes out to 1e-5 of itself.
SAMPLES = 1001


@dataclass(frozen=True, eq=False)
class SpreadRise:
    """S, s', s'' of a rise over its lift at event angles, ``(m, n)``, and the angles ``(m,)``."""

    s: FloatArray
    slope: FloatArray
    bend: FloatArray

    @classmethod
    def of(cls, name: str, event: FloatArray) -> SpreadRise:
        """The rise of a name over event angles ``(m,)``, rad."""
        s, slope, bend = _unit(name)
        beta = event[:, None]
        return cls(np.broadcast_to(s, (event.size, s.size)), slope / beta, bend / beta**2)


@lru_cache(maxsize=len(NAMED_RISES))
def _unit(name: str) -> FloatArray:
    """``(3, n)``: s, s', s'' of the unit rise, joints with both limits, and of the dwells."""
    breaks, columns = unit_rise(name)
    ordinates, spans = joined(columns), np.diff(breaks)
    u = np.linspace(0.0, 1.0, SAMPLES)
    rows = []
    for _ in range(3):
        rows.append(bernstein.evaluate(ordinates, u).ravel())
        ordinates = bernstein.derivative(ordinates) / spans
    rest = np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    return np.concatenate([rest, np.stack(rows)], axis=1)


def by_pressure_angle(name: str, event: FloatArray, most: float) -> FloatArray:
    """Least prime radius over h of a roller or point: tan α = s' / (R_p + s), α in rad."""
    rise = SpreadRise.of(name, event)
    return np.asarray((np.abs(rise.slope) / np.tan(most) - rise.s).max(axis=1))


def by_face(name: str, event: FloatArray) -> FloatArray:
    """Least (R_b − ρ_min) / h of a flat follower: ρ = R_b + s + s'' (eq. 2.42)."""
    rise = SpreadRise.of(name, event)
    least = np.maximum(-(rise.s + rise.bend).min(axis=1), 0.0)
    return np.asarray(least + 0.0)  # no negative zero


def by_curvature(name: str, event: FloatArray, radius: float) -> FloatArray:
    """Least prime radius over h at which the pitch curve is nowhere sharper than ``radius`` (/ h).

    Eq. 2.46 with ε = 0. The radius is the roller's and the least one of the contour together.
    """
    rise = SpreadRise.of(name, event)

    def sharp(prime: FloatArray) -> FloatArray:
        high = prime[:, None] + rise.s
        square = high**2 + rise.slope**2
        bent = square + rise.slope**2 - high * rise.bend
        return np.asarray((radius * bent > square**1.5).any(axis=1))

    low = np.full(event.shape, radius)  # the dwell's circle is as sharp
    high = low + 1.0
    while (still := sharp(high)).any():
        high = np.where(still, 2.0 * high, high)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        bad = sharp(middle)
        low, high = np.where(bad, middle, low), np.where(bad, high, middle)
    return high


# Followers that a cam moves both ways: their play between the two contacts.


@dataclass(frozen=True)
class PlayRow:
    """Least and greatest play (m) over the turn of one cam's follower; negative: it jams."""

    cam: CamConfig
    least: float
    greatest: float


def open_form_closed(paths: Iterable[Path]) -> list[tuple[CamConfig, Law]]:
    """Read cam files with their laws."""
    cams = [(path, load_cam(path)) for path in paths]
    return [(cam, law_of(path, cam)) for path, cam in cams]


def find_play(cams: Iterable[tuple[CamConfig, Law]]) -> list[PlayRow]:
    """The play of each."""
    found = [(cam, closure(cam.follower, law)) for cam, law in cams]
    return [PlayRow(cam, float(play.min()), float(play.max())) for cam, play in found]
