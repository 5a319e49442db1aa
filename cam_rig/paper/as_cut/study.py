"""What a roller does on a cam that was cut for a point: lift, jump speed, noise."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import FROM_REST
from cam_rig.dynamics.jump.search import sought_speed
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.laws.law import Extreme, extremes
from cam_rig.paper.as_cut.cut_for_point import FollowedLaw, followed_law
from cam_rig.profile.contact import greatest_between
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.cam import Roller
from cam_rig.show.tables import DataTable, Head, number, tabulate
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Acoustics, Turns, settled_turns
from cam_rig.units import RPM, FloatArray


@dataclass(frozen=True, eq=False)
class CutBench:
    """What the cams are run on: two masses for the jump speed, the noise study's rig for levels.

    Parameters
    ----------
    speeds : rad/s, of the levels
    """

    two_mass: TwoMassParameters
    follower: FollowerParameters
    acoustics: Acoustics
    speeds: FloatArray

    @classmethod
    def of(cls, rig: RigConfig, loaded: LoadedScene) -> CutBench:
        """The jump speed's rig, and a scene's follower, sound and speeds."""
        return cls(
            TwoMassParameters.from_rig(rig),
            loaded.follower,
            Acoustics(loaded.radiation),
            np.array(loaded.scene.program.speeds.si_list),
        )

    def jump_speed(self, law: Law) -> float:
        """Jump speed from rest, rad/s."""
        return sought_speed(law, self.two_mass, FROM_REST)

    def turns(self, law: Law) -> Turns:
        """A settled turn at each speed."""
        return settled_turns(law, "one_mass", self.follower, self.speeds)


@dataclass(frozen=True, eq=False)
class DrawnCam:
    """A law with its jump speed (rad/s) and its levels (dB).

    ``lands_from`` is the slowest speed (rad/s) of the levels at which the follower lands in each
    turn, None where it always keeps contact.
    """

    law: Law
    jump: float
    levels: FloatArray
    lands_from: float | None

    @classmethod
    def run(cls, law: Law, bench: CutBench) -> DrawnCam:
        """Run a law."""
        turns = bench.turns(law)
        lands = (speed for speed, i in zip(turns.speeds, turns.impulses, strict=True) if i.any())
        levels = bench.acoustics.levels(turns)
        return cls(law, bench.jump_speed(law), levels, min(map(float, lands), default=None))


@dataclass(frozen=True, eq=False)
class AsCut:
    """A roller on the contour R_b + s of a law, beside the law itself.

    Parameters
    ----------
    drawn, cut : the law, and the one that the roller follows
    base_radius, roller : m
    error : ``(3,)`` of the roller's law: m, m/rad, m/rad²
    too_high : m, where the roller stands farthest above s
    """

    drawn: DrawnCam
    cut: DrawnCam
    base_radius: float
    roller: float
    error: FloatArray
    too_high: Extreme

    @property
    def deceleration(self) -> tuple[float, float]:
        """Smallest s'' (m/rad²) of the law, and of the roller."""
        return extremes(self.drawn.law, 2)[0].value, extremes(self.cut.law, 2)[0].value

    @property
    def level_change(self) -> FloatArray:
        """By how much the cam becomes louder at each speed, dB."""
        return self.cut.levels - self.drawn.levels


def has_central_roller(cam: CamConfig) -> bool:
    """Whether the follower is a roller whose guide passes through the cam's axis."""
    follower = cam.follower
    return isinstance(follower, Roller) and (
        follower.eccentricity is None or follower.eccentricity.si == 0.0
    )


def radii(cam: CamConfig) -> tuple[float, float]:
    """Base and roller radius (m) of a cam with a central roller."""
    if not has_central_roller(cam):
        raise ConfigError(
            f"cam {cam.name!r}: its follower is {cam.follower.type!r}, or beside the cam's axis; "
            "allowed: a roller in a guide without eccentricity, as R_b + s is then what a point "
            "in its place would need"
        )
    return cam.follower.base_radius.si, cam.follower.roller


def as_cut(drawn: DrawnCam, bench: CutBench, base_radius: float, roller: float) -> AsCut:
    """Cut a cam as drawn for a point, and drive it with a roller."""
    found = followed_law(drawn.law, base_radius, roller)
    cut = DrawnCam.run(found.law, bench)
    high = _too_high(drawn.law, found)
    return AsCut(drawn, cut, base_radius, roller, found.error, high)


def cut_all(cam_set: CamSet, bench: CutBench) -> dict[str, AsCut]:
    """Each cam with a central roller at its own radii, by name."""
    cams = {name: cam for name, cam in cam_set.cams.items() if has_central_roller(cam)}
    return {
        name: as_cut(DrawnCam.run(cam_set.laws[name], bench), bench, *radii(cam))
        for name, cam in cams.items()
    }


def over_sizes(
    drawn: DrawnCam, bench: CutBench, bases: Iterable[float], rollers: Iterable[float]
) -> list[AsCut]:
    """The same over base and roller radii (m), the rollers of one base circle together."""
    return [as_cut(drawn, bench, base, roller) for base, roller in product(bases, rollers)]


def _too_high(law: Law, found: FollowedLaw) -> Extreme:
    edges = np.unique(np.concatenate([law.breaks, found.law.breaks]))
    return greatest_between(lambda angle: found.law(angle) - law(angle), edges)


# All findings of a report, and the jobs that compute them.

#: The law that the paper cut a cam for (fig. 12), and radii (m) that it is cut with here.
CUT, BASES, ROLLERS = "bezier15", (0.050, 0.065, 0.100), (0.005, 0.010, 0.020)


# Cams as they were cut: as tables and as plain data.


def cams_table(found: Mapping[str, AsCut], titles: Mapping[str, str]) -> DataTable:
    """One row for each cam, at its own radii."""
    errors = max((float(row.error[0]) for row in found.values()), default=0.0)
    return tabulate(
        "A roller on the contour that a polar plot of s + R_b gives",
        found.items(),
        (
            (Head("cam"), lambda row: titles.get(row[0], row[0])),
            (Head("roller above s by", "mm", ".3f"), lambda row: 1e3 * row[1].too_high.value),
            (Head("smallest s″", "mm/rad²", ".2f"), lambda row: 1e3 * row[1].deceleration[0]),
            (
                Head("of the roller", "mm/rad²", ".2f"),
                lambda row: 1e3 * row[1].deceleration[1],
            ),
            (Head("jump speed of s", "rpm", ".2f"), lambda row: row[1].drawn.jump / RPM),
            (Head("as cut", "rpm", ".2f"), lambda row: row[1].cut.jump / RPM),
            (Head("level changes from", "dB", "+.3f"), lambda row: row[1].level_change.min()),
            (Head("to", "dB", "+.3f"), lambda row: row[1].level_change.max()),
            (
                Head("s lands from", "rpm", ".0f", "–"),
                lambda row: _rpm(row[1].drawn.lands_from),
            ),
            (Head("as cut", "rpm", ".0f", "–"), lambda row: _rpm(row[1].cut.lands_from)),
        ),
        *_radii(found.values()),
        "Jump speeds are those of two masses, from rest; levels and landings those of the scene's "
        "own rig.",
        f"The roller's law is fitted to its closed form within {number(errors, '.0e')} m.",
    )


def sizes_table(found: Iterable[AsCut], title: str) -> DataTable:
    """One cam over base and roller radius."""
    rows = list(found)
    law = f" (s itself: {rows[0].drawn.jump / RPM:.2f} rpm)" if rows else ""
    return tabulate(
        f"{title} as cut, over base and roller radius{law}",
        rows,
        (
            (Head("base radius", "mm", "g"), lambda row: 1e3 * row.base_radius),
            (Head("roller radius", "mm", "g"), lambda row: 1e3 * row.roller),
            (Head("roller above s by", "mm", ".3f"), lambda row: 1e3 * row.too_high.value),
            (Head("smallest s″", "mm/rad²", ".2f"), lambda row: 1e3 * row.deceleration[1]),
            (Head("jump speed", "rpm", ".2f"), lambda row: row.cut.jump / RPM),
            (Head("level changes from", "dB", "+.3f"), lambda row: row.level_change.min()),
            (Head("to", "dB", "+.3f"), lambda row: row.level_change.max()),
        ),
    )


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else speed / RPM


def _radii(found: Iterable[AsCut]) -> list[str]:
    """A note on the radii, where all cams have the same."""
    radii = {(row.base_radius, row.roller) for row in found}
    if len(radii) != 1:
        return []
    base, roller = radii.pop()
    return [f"Base radius {1e3 * base:g} mm, roller radius {1e3 * roller:g} mm."]


def to_json(found: Mapping[str, AsCut]) -> dict[str, Any]:
    """As plain data, by cam."""
    return {cam: _plain(row) for cam, row in found.items()}


def _plain(row: AsCut) -> dict[str, Any]:
    return {
        "base_radius_m": row.base_radius,
        "roller_radius_m": row.roller,
        "above_law_m": row.too_high.value,
        "above_law_at_deg": math.degrees(row.too_high.angle),
        "smallest_acceleration_m_per_rad2": list(row.deceleration),
        "jump_rpm": [row.drawn.jump / RPM, row.cut.jump / RPM],
        "lands_from_rpm": [_rpm(row.drawn.lands_from), _rpm(row.cut.lands_from)],
        "level_change_db": row.level_change.tolist(),
        "fit_error": row.error.tolist(),
    }
