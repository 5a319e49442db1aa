"""What a roller does on a cam that was cut for a point: lift, jump speed, noise."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product
from operator import attrgetter
from typing import ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import FROM_REST
from cam_rig.dynamics.jump.search import sought_speed
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.laws.law import Extreme, extremes
from cam_rig.paper.as_cut.cut_for_point import followed_law
from cam_rig.profile.contact import greatest_between
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.cam import Roller
from cam_rig.show.result import SILENT, Column, Progress, Records, Result
from cam_rig.show.tables import number
from cam_rig.simulation.asked import Cams, Rig, Scene, asked_cams, asked_scene
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import RPM, FloatArray


@dataclass(frozen=True, eq=False)
class CutBench:
    """Two masses for the jump speed; a scene's follower, sound and speeds (rad/s) for levels."""

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


@dataclass(frozen=True, eq=False)
class DrawnCam:
    """A law with its jump speed (rad/s) and levels (dB).

    ``lands_from``: slowest speed (rad/s) with a landing in each turn; None in contact throughout.
    """

    law: Law
    jump: float
    levels: FloatArray
    lands_from: float | None

    @property
    def least_s2(self) -> float:
        """Smallest s'' of the law, m/rad²."""
        return extremes(self.law, 2)[0].value

    @classmethod
    def run(cls, law: Law, bench: CutBench) -> DrawnCam:
        """Run a law."""
        turns = settled_turns(law, "one_mass", bench.follower, bench.speeds)
        lands = (speed for speed, i in zip(turns.speeds, turns.impulses, strict=True) if i.any())
        jump, levels = sought_speed(law, bench.two_mass, FROM_REST), bench.acoustics.levels(turns)
        return cls(law, jump, levels, min(map(float, lands), default=None))


@dataclass(frozen=True, eq=False)
class AsCut:
    """A law, and the one that a roller follows on its contour R_b + s; radii in m.

    ``error`` ``(3,)`` is of the roller's law: m, m/rad, m/rad²; ``too_high`` (m) where it stands
    farthest above s.
    """

    cam: str
    drawn: DrawnCam
    cut: DrawnCam
    base_radius: float
    roller: float
    error: FloatArray
    too_high: Extreme

    @property
    def change(self) -> FloatArray:
        """By how much the cam becomes louder at each speed, dB."""
        return self.cut.levels - self.drawn.levels


def _rpm(path: str) -> Callable[[AsCut], float | None]:
    take = attrgetter(path)
    return lambda row: None if take(row) is None else take(row) / RPM


@dataclass(frozen=True, eq=False, repr=False)
class AsCutResult(Result):
    """Cams on their contours as they were cut, or one over its radii; ``speeds`` in rad/s."""

    schema = "cam_rig.as_cut.1"
    drawn_by = "cam_rig.paper.as_cut.figures:figure"
    columns: ClassVar = {
        "as_cut": (
            Column("cam"),
            Column("base_radius", "mm", "g"),
            Column("roller_radius", "mm", "g", of="roller"),
            Column("above_law", "mm", ".3f", "roller above s by", "too_high.value"),
            Column("above_law_at", "°", of="too_high.angle", hidden=True),
            Column("least_s2", "mm/rad²", ".2f", "smallest s″", "drawn.least_s2"),
            Column("least_s2_cut", "mm/rad²", ".2f", "of the roller", "cut.least_s2"),
            Column("jump", "rpm", ".2f", "jump speed of s", _rpm("drawn.jump")),
            Column("jump_cut", "rpm", ".2f", "as cut", _rpm("cut.jump")),
            Column("change_from", "dB", "+.3f", "level changes from", lambda r: r.change.min()),
            Column("change_to", "dB", "+.3f", "to", lambda row: row.change.max()),
            Column("lands_from", "rpm", ".0f", "s lands from", _rpm("drawn.lands_from"), None, "–"),
            Column("lands_from_cut", "rpm", ".0f", "as cut", _rpm("cut.lands_from"), None, "–"),
            *(Column(f"error_s{i}", of=f"error.{i}", hidden=True) for i in range(3)),
        ),
        "levels": (
            Column("cam", of="0.cam"),
            Column("base_radius", "mm", of="0.base_radius"),
            Column("roller_radius", "mm", of="0.roller"),
            Column("rpm", "rpm", of=lambda row: row[1] / RPM),
            Column("change", "dB", of="2"),
        ),
    }

    rows: tuple[AsCut, ...]
    speeds: FloatArray
    titles: dict[str, str]
    caption: str = "A roller on the contour that a polar plot of s + R_b gives"

    def tables(self) -> list[Records]:
        """``as_cut``, a row a cam or a pair of radii, and by how much each becomes louder."""
        errors = max((float(row.error[0]) for row in self.rows), default=0.0)
        levels = (
            (row, *one)
            for row in self.rows
            for one in zip(self.speeds.tolist(), row.change.tolist(), strict=True)
        )
        return [
            self.table(
                "as_cut",
                self.caption,
                self.rows,
                "Jump speeds are those of two masses, from rest; levels and landings those of the "
                "scene's own rig.",
                f"The roller's law is fitted to its closed form within {number(errors, '.0e')} m.",
            ),
            self.table("levels", "Change of the level", levels, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Of the first cam: how far off lift and noise are."""
        first = self.rows[0]
        change = max(map(abs, first.change))
        high = 1e3 * first.too_high.value
        return [f"{first.cam}: {high:.3f} mm too high, noise within {change:.3f} dB"]

    def of(self, cam: str) -> AsCut | None:
        """A cam's row, if it has one."""
        return next((row for row in self.rows if row.cam == cam), None)


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


def cut_at(cam: str, drawn: DrawnCam, bench: CutBench, base_radius: float, roller: float) -> AsCut:
    """Cut a cam as drawn for a point, and drive it with a roller."""
    found = followed_law(drawn.law, base_radius, roller)
    cut = DrawnCam.run(found.law, bench)
    edges = np.unique(np.concatenate([drawn.law.breaks, found.law.breaks]))
    high = greatest_between(lambda angle: found.law(angle) - drawn.law(angle), edges)
    return AsCut(cam, drawn, cut, base_radius, roller, found.error, high)


def cut_all(
    chosen: CamSet,
    bench: CutBench,
    base: float | None = None,
    roller: float | None = None,
    progress: Progress = SILENT,
) -> AsCutResult:
    """Each cam at its own radii, or at those (m) that are given."""
    own = {cam: radii(config) for cam, config in chosen.cams.items()}
    rows = []
    for cam in progress.over(own):
        sizes = [a if b is None else b for a, b in zip(own[cam], (base, roller), strict=True)]
        rows.append(cut_at(cam, DrawnCam.run(chosen.laws[cam], bench), bench, *sizes))
    return AsCutResult(tuple(rows), bench.speeds, chosen.titles)


@checked
def as_cut(
    cams: Cams = None,
    rig: Rig = None,
    scene: Scene = "tm21_sweep",
    *,
    base: float | None = None,
    roller: float | None = None,
    progress: Progress = SILENT,
) -> AsCutResult:
    """A roller on the contour that was drawn for a point, as fig. 12 of the paper draws it.

    Its lift, jump speed and noise beside those of the law itself.

    The command is ``cam-rig as-cut``.

    Parameters
    ----------
    cams : a name, a path or a cam, or several; None: the paper's Table 2
    rig : of the jump speeds: a name, a path or a rig; None: the only one beside the cams, else
        ``paper_table2``
    scene : gives follower, sound and speeds of the noise
    base, roller : radii in m, instead of the cam's own
    progress : told how far it is

    Raises
    ------
    ConfigError : an unknown cam, rig or scene, or a radius that is none

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.as_cut("bezier15", base=0.08, roller=0.02)
    >>> found.to_pandas().cam.tolist()
    ['bezier15']
    """
    for name, radius in (("base", base), ("roller", roller)):
        if radius is not None and not radius > 0.0:
            raise ConfigError(f"{name}: is {radius * 1e3:g} mm; allowed: greater than 0 mm")
    chosen = asked_cams(cams, rig)
    bench = CutBench.of(chosen.rig, asked_scene(scene))
    return cut_all(chosen, bench, base, roller, progress)


def over_sizes(
    found: AsCut, bench: CutBench, bases: Iterable[float], rollers: Iterable[float], title: str
) -> AsCutResult:
    """A cam over base and roller radii (m), the rollers of one base circle together."""
    sizes = product(bases, rollers)
    rows = tuple(cut_at(found.cam, found.drawn, bench, *size) for size in sizes)
    caption = f"{title} as cut, over base and roller radius"
    return AsCutResult(rows, bench.speeds, {found.cam: title}, caption)


#: The law that the paper cut a cam for (fig. 12), and radii (m) that it is cut with here.
CUT, BASES, ROLLERS = "bezier15", (0.050, 0.065, 0.100), (0.005, 0.010, 0.020)
