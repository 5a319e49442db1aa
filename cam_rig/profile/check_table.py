"""All checks of a cam (profile thesis §2.3), and the refusal of one that cannot exist."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, LawError, ProfileError, ReachError
from cam_rig.laws import Law, build_law
from cam_rig.laws.law import VELOCITY_JUMP, Extreme
from cam_rig.profile.checks import (
    Check,
    corner_check,
    crossing_check,
    curvature_checks,
    least_base_radius,
    reach_checks,
)
from cam_rig.profile.contact import Element, Scan, greatest_between, stroke
from cam_rig.profile.disc import Disc, discs
from cam_rig.profile.faces import Swung
from cam_rig.schema import CamConfig, load, load_cam
from cam_rig.schema.cam import Follower
from cam_rig.show.result import SI_UNITS, Column, Records, Result
from cam_rig.units import TURN, FloatArray

# The condition of constant breadth and constant diameter: s(θ) + s(θ + π) = s_max.

#: The sum may differ from s_max by this fraction of the lift.
TOLERANCE = 1e-9


def breadth_check(law: Law) -> Check:
    """How far the sum of opposite displacements is from what the two elements are apart for."""
    apart = stroke(law)

    def difference(angle: FloatArray) -> FloatArray:
        return np.abs(law(angle) + law(angle + 0.5 * TURN) - apart)

    edges = np.concatenate([law.breaks, (law.breaks + 0.5 * TURN) % TURN])
    worst, limit = greatest_between(difference, np.unique(edges)), TOLERANCE * law.lift
    remedy = "let the fall be the rise turned by 180°, or take conjugate cams"
    return Check.at("s(θ) + s(θ + 180°) − s_max", worst, "at most", limit, "mm", remedy)


# Pressure angle: from the follower's direction of motion to the common normal.

#: The most when the cam file names none, rad: what handbooks advise for a guide and for a pivot.
GUIDED, SWUNG = float(np.radians(30.0)), float(np.radians(45.0))


def greatest_allowed(follower: Follower, element: Element) -> float:
    """The most pressure angle, rad: what the cam file asks for, else what handbooks advise."""
    if (asked := follower.most_pressure_angle) is not None:
        return asked.si
    return SWUNG if isinstance(element, Swung) else GUIDED


def pressure_check(scan: Scan, follower: Follower) -> Check:
    """The greatest pressure angle of either sign against what guide or pivot bear."""
    steepest = scan.greatest(lambda touch: np.abs(touch.pressure))
    limit = greatest_allowed(follower, scan.element)
    remedy = "let base_radius be larger, the spans longer, or set most_pressure_angle"
    return replace(Check.at("pressure angle", steepest, "at most", limit, "°", remedy), vital=False)


def check_cam(cam: CamConfig, law: Law) -> list[Check]:
    """Every check that the kind of follower asks for, those first that explain the later ones."""
    follower, smaller = cam.follower, "a smaller one is undercut or out of reach"
    found = [corner_check(law, VELOCITY_JUMP)]
    least_base = least_base_radius(follower, law)
    try:
        plates = discs(follower, law)
    except ReachError as error:
        raise ReachError(f"cam {cam.name!r}: {error}") from None
    if any(disc.opposite is not None for disc in plates):
        found.append(breadth_check(law))
    for disc in plates:
        checks = list(_disc_checks(disc, follower, law, least_base))
        found += [replace(check, disc=disc.name) for check in checks]
    if least_base is not None and least_base > 0.0:
        base = Extreme(follower.base_radius.si, 0.0)
        check = Check.at("base radius", base, "more than", least_base, "mm", smaller)
        found.append(replace(check, angle=None, vital=False))
    return found


def _disc_checks(
    disc: Disc, follower: Follower, law: Law, least_base: float | None
) -> Iterator[Check]:
    scan = Scan(law, disc.element)
    yield from reach_checks(scan)
    curvature = list(curvature_checks(scan, follower, least_base))
    yield from curvature
    if all(check.passed or not check.vital for check in curvature):
        yield crossing_check(disc, law)
    yield pressure_check(scan, follower)


def require_profile(cam: CamConfig, law: Law) -> None:
    """Refuse a cam that cannot exist."""
    for check in check_cam(cam, law):
        if check.vital and not check.passed:
            raise ProfileError(f"cam {cam.name!r}: {check}")


# Cams with their checks, as `cam-rig profile` gives them.


@dataclass(frozen=True)
class CheckedCam:
    """A cam, its law, and every check of its contour."""

    cam: CamConfig
    law: Law
    checks: list[Check]

    @classmethod
    def of(cls, cam: CamConfig, law: Law) -> CheckedCam:
        """Check it."""
        return cls(cam, law, check_cam(cam, law))

    @property
    def failed(self) -> list[Check]:
        """The checks that it does not pass."""
        return [check for check in self.checks if not check.passed]

    def worst(self, name: str) -> float | None:
        """Value of the check of that name that is nearest to its limit, of two discs."""
        named = [check for check in self.checks if check.name == name]
        nearest = min if named and named[0].relation == "more than" else max
        worst = nearest((check.value for check in named), default=math.inf)
        return worst if math.isfinite(worst) else None

    @property
    def least_base_radius(self) -> float | None:
        """Limit of the base radius, m; None where none was found."""
        return next((check.limit for check in self.checks if check.name == "base radius"), None)


@dataclass(frozen=True)
class CheckRow:
    """A check and whose it is."""

    cam: str
    check: Check


#: Positions of the follower in a picture.
POSITIONS = 24
#: Of several cams: what stands where one has no such number.
NONE = "–"


def _worst(key: str, unit: str, name: str, heading: str) -> Column:
    return Column(
        key, unit, ".4g", heading, lambda one: one.worst(name), missing=NONE, doc=f"worst {name}"
    )


@dataclass(frozen=True, repr=False)
class ProfileResult(Result):
    """The checks of one cam or more; ``drawn`` is one whose contour or picture is written.

    ``expected`` : a cam whose file says that it cannot be made is no failure
    """

    schema = "cam_rig.profile.1"
    plot_function = "cam_rig.profile.figures:profile_figure"
    columns: ClassVar = {
        "checks": (
            Column("cam", hidden=True),
            Column("check", of="check.title"),
            Column("value", of="check.value", cell=lambda row: row.check.shown(row.check.value)),
            Column("angle", "°", ".1f", "at", "check.place"),
            Column("relation", of="check.relation", doc="of value to limit", hidden=True),
            Column(
                "limit", heading="allowed", of="check.limit", cell=lambda row: row.check.allowed
            ),
            Column(
                "unit",
                of=lambda row: SI_UNITS.get(row.check.unit, (row.check.unit,))[0],
                doc="of value and limit",
                hidden=True,
            ),
            Column(
                "passed",
                heading="result",
                of="check.passed",
                cell=lambda row: "ok" if row.check.passed else "fails",
            ),
            Column("vital", of="check.vital", doc="else it is bad, but can be made", hidden=True),
        ),
        "cams": (
            Column("cam", of="cam.name"),
            Column("follower", of="cam.follower.type", hidden=True),
            _worst("convex_radius", "mm", "convex radius of curvature", "convex"),
            _worst("concave_radius", "mm", "concave radius of curvature", "concave"),
            _worst("pressure_angle", "°", "pressure angle", "pressure"),
            Column("base_radius", "mm", ".4g", "base", "cam.follower.base_radius.si"),
            Column("least_base_radius", "mm", ".4g", "least", missing=NONE),
            Column(
                "failed",
                heading="checks",
                of=lambda one: len(one.failed),
                cell=lambda one: (
                    f"{len(one.failed)} fail" if one.failed else f"{len(one.checks)} ok"
                ),
                doc="checks that it fails",
            ),
            Column("cannot_be_made", of="cam.cannot_be_made", doc="why, by its file", hidden=True),
        ),
    }

    cams: tuple[CheckedCam, ...]
    positions: int = POSITIONS
    drawn: bool = False
    expected: bool = False

    @property
    def exit_code(self) -> int:  # type: ignore[override]
        """1 where a check fails that is not meant to; 0 of one that is drawn all the same."""
        asked = [one for one in self.cams if not (self.expected and one.cam.cannot_be_made)]
        return int(not self.drawn and any(one.failed for one in asked))

    def tables(self) -> list[Records]:
        """``checks``, which people see of one cam alone, and ``cams``, seen of several."""
        first, alone = self.cams[0], len(self.cams) == 1
        kind = first.cam.follower.type.replace("_", " ")
        caption = f"{first.cam.title}: {kind} follower, lift {first.law.lift * 1e3:.5g} mm"
        rows = [CheckRow(one.cam.name, check) for one in self.cams for check in one.checks]
        several = "Least radii of curvature, greatest pressure angle, base radius and its least"
        note = f"{NONE}: nothing to check, or no least one found. All checks: one cam, or --json."
        return [
            self.table("checks", caption, rows, hidden=not alone),
            self.table("cams", several, self.cams, note, hidden=alone),
        ]

    def summary(self) -> list[str]:
        """What is wrong, and what to do."""
        words = "warning: " if self.drawn else ""
        lines = []
        for one in self.cams:
            lines += [f"{words}{one.cam.name}: {check}" for check in one.failed]
            if one.cam.cannot_be_made is not None:
                lines.append(
                    f"{one.cam.name}: its file says that it cannot be made: "
                    f"{one.cam.cannot_be_made}"
                )
        return lines


# Cams that are asked for by name, file or scene, each with its checks.


@checked
def check_contours(
    cams: str | Path | CamConfig | Sequence[str | Path | CamConfig] = (), *, every: bool = False
) -> ProfileResult:
    """The checks of cams' contours: undercut, curvature, pressure angle, reach.

    `contour` is one cam's shape, point by point.

    The command is ``cam-rig profile``.

    Parameters
    ----------
    cams : a cam: a name, a path, or what `load_cam` gave; or several; or one scene, for its cams
    every : all cams of ``config/cams`` too

    Raises
    ------
    ConfigError : no cam, or an unknown one; LawError, ProfileError : one that cannot be at all

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.check_contours(["poly345", "flat"])
    >>> [(one.cam.name, len(one.failed)) for one in found.cams]
    [('poly345', 0), ('flat', 0)]
    """
    asked = [cams] if isinstance(cams, str | Path | CamConfig) else cams
    return ProfileResult(tuple(checked_cams(asked, every)), expected=every)


def checked_cams(cams: Sequence[str | Path | CamConfig], every: bool) -> list[CheckedCam]:
    """Each cam and its checks."""
    found = []
    for one in _asked(cams, every):
        cam = one if isinstance(one, CamConfig) else load_cam(one)
        try:
            found.append(CheckedCam.of(cam, build_law(cam)))
        except (LawError, ProfileError) as error:
            name = cam.name if isinstance(one, CamConfig) else one
            raise type(error)(f"{name}: {error}") from None
    return found


def _asked(cams: Sequence[str | Path | CamConfig], every: bool) -> list[Path | CamConfig]:
    found: list[Path | CamConfig]
    if (scene := load.one_scene(cams)) is not None:
        library = load.Library.beside(scene)
        found = [library.path("cams", name) for name in load.load_scene(scene).cams]
    else:
        found = [one if isinstance(one, CamConfig) else load.cam_path(one) for one in cams]
    if every:
        found += sorted((load.config_root() / "cams").glob("*.yaml"))
    if not found:
        raise ConfigError("no cam is named; allowed: cam files, names in config/cams, or --all")
    return found
