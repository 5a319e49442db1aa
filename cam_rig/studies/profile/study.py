"""Checks of the contours of cams, as `cam-rig profile` shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, LawError, ProfileError
from cam_rig.laws import build_law
from cam_rig.profile.cam_checks import CheckedCam, unusual_lift
from cam_rig.profile.checks import Check
from cam_rig.schema import load, load_cam
from cam_rig.schema.cam import CamConfig
from cam_rig.show.result import SI_UNITS, Column, Records, Result


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
    plot_function = "cam_rig.studies.profile.figures:profile_figure"
    columns: ClassVar = {
        "checks": (
            Column("cam", hidden=True),
            Column("check", of="check.title"),
            Column("value", of="check.value", cell=lambda row: row.check.shown(row.check.value)),
            Column("angle", "°", ".1f", "at", "check.angle_in_turn"),
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
            lines += [f"{one.cam.name}: {sentence}" for sentence in unusual_lift(one.law.lift)]
            if one.cam.cannot_be_made is not None:
                lines.append(
                    f"{one.cam.name}: its file says that it cannot be made: "
                    f"{one.cam.cannot_be_made}"
                )
        return lines


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
