"""Checks of the contours of cams, and the result of ``cam-rig profile``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError, LawError, ProfileError
from cam_rig.laws import build_law
from cam_rig.profile.cam_checks import CheckedCam, warn_of_unusual_lift
from cam_rig.profile.checks import Check
from cam_rig.schema import load, load_cam
from cam_rig.schema.cam import CamConfig
from cam_rig.show.result import SI_UNITS, Column, Records, Result


@dataclass(frozen=True)
class CheckRow:
    """Table row of `ProfileResult`: one check, and the name of its cam."""

    cam: str
    check: Check


#: Default number of positions of the follower around the cam in a figure.
POSITIONS = 24


#: Text in the table of several cams if a cam does not have the value of a column.
NO_VALUE = "–"


def _worst(key: str, unit: str, name: str, heading: str) -> Column:
    """Return the table column of the value of a check that is nearest to its limit.

    `name` is the name of the check, of which a cam may have several. `key`, `unit` and `heading`
    are those of the column.
    """
    return Column(
        key, unit, ".4g", heading, lambda c: c.worst(name), missing=NO_VALUE, doc=f"worst {name}"
    )


@dataclass(frozen=True, repr=False)
class ProfileResult(Result):
    """Checks of the contours of one or several cams.

    Parameters
    ----------
    cams : tuple of CheckedCam
        The cams with their checks.
    positions : int
        Positions of the follower in the figure (default: 24).
    drawn : bool
        True if the contour or a figure is written. Then failed checks are warnings.
    expected : bool
        True if a cam whose file has `cannot_be_made` does not count as a failure.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.check_contours("poly345")
    >>> result.exit_code, result.cams[0].failed
    (0, [])
    """

    schema = "cam_rig.profile.1"
    plot_function = "cam_rig.studies.profile.figures:profile_figure"
    columns: ClassVar = {
        "checks": (
            Column("cam", hidden=True),
            Column("check", of="check.title"),
            Column(
                "value", of="check.value", cell=lambda row: row.check.format_value(row.check.value)
            ),
            Column("angle", "°", ".1f", "at", "check.angle_in_turn"),
            Column(
                "relation", of="check.relation", doc="required relation to the limit", hidden=True
            ),
            Column(
                "limit", heading="allowed", of="check.limit", cell=lambda row: row.check.allowed
            ),
            Column(
                "unit",
                of=lambda row: SI_UNITS.get(row.check.unit, (row.check.unit,))[0],
                doc="unit of value and limit",
                hidden=True,
            ),
            Column(
                "passed",
                heading="result",
                of="check.passed",
                cell=lambda row: "ok" if row.check.passed else "fails",
            ),
            Column(
                "is_fatal", of="check.is_fatal", doc="a cam that fails cannot exist", hidden=True
            ),
        ),
        "cams": (
            Column("cam", of="cam.name"),
            Column("follower", of="cam.follower.type", hidden=True),
            _worst("convex_radius", "mm", "convex radius of curvature", "convex"),
            _worst("concave_radius", "mm", "concave radius of curvature", "concave"),
            _worst("pressure_angle", "°", "pressure angle", "pressure"),
            Column("base_radius", "mm", ".4g", "base", "cam.follower.base_radius.si"),
            Column("least_base_radius", "mm", ".4g", "least", missing=NO_VALUE),
            Column(
                "failed",
                heading="checks",
                of=lambda c: len(c.failed),
                cell=lambda c: f"{len(c.failed)} fail" if c.failed else f"{len(c.checks)} ok",
                doc="number of failed checks",
            ),
            Column(
                "cannot_be_made", of="cam.cannot_be_made", doc="reason in its file", hidden=True
            ),
        ),
    }

    cams: tuple[CheckedCam, ...]
    positions: int = POSITIONS
    drawn: bool = False
    expected: bool = False

    @property
    def exit_code(self) -> int:  # type: ignore[override]
        """Exit code of the command: 1 if a check fails, otherwise 0.

        It is 0 if the contour or a figure is written. If `expected` is True, cams whose file has
        `cannot_be_made` do not count.
        """
        counted = [c for c in self.cams if not (self.expected and c.cam.cannot_be_made)]
        return int(not self.drawn and any(c.failed for c in counted))

    def tables(self) -> list[Records]:
        """Return the tables of checks of one or several cams.

        The table `checks` is displayed if there is one cam, the table `cams` if there are several.
        """
        first, alone = self.cams[0], len(self.cams) == 1
        kind = first.cam.follower.type.replace("_", " ")
        caption = f"{first.cam.title}: {kind} follower, lift {first.law.lift * 1e3:.5g} mm"
        rows = [CheckRow(c.cam.name, check) for c in self.cams for check in c.checks]
        several = "Least radii of curvature, greatest pressure angle, base radius and its minimum"
        note = f"{NO_VALUE}: no such check or minimum. All checks: name one cam, or use --json."
        return [
            self.table("checks", caption, rows, hidden=not alone),
            self.table("cams", several, self.cams, note, hidden=alone),
        ]

    def summary(self) -> list[str]:
        """Return sentences on failed checks with remedies, and warnings."""
        prefix = "warning: " if self.drawn else ""
        lines = []
        for checked_cam in self.cams:
            cam = checked_cam.cam
            lines += [f"{prefix}{cam.name}: {check}" for check in checked_cam.failed]
            lines += [f"{cam.name}: {text}" for text in warn_of_unusual_lift(checked_cam.law.lift)]
            if cam.cannot_be_made is not None:
                lines.append(
                    f"{cam.name}: its file states that it cannot be made: {cam.cannot_be_made}"
                )
        return lines


@check_arguments
def check_contours(
    cams: str | Path | CamConfig | Sequence[str | Path | CamConfig] = (), *, every: bool = False
) -> ProfileResult:
    """Check the contours of cams: undercut, curvature, pressure angle, reach.

    `contour` returns the points of one cam. The command is ``cam-rig profile``.

    Parameters
    ----------
    cams : str, Path, Cam or sequence
        A cam as a name, a path or the result of `load_cam`, or several cams, or one scene for its
        cams.
    every : bool
        True to add all cams of ``config/cams`` (default: False).

    Returns
    -------
    ProfileResult
        The checks of each cam.

    Raises
    ------
    ConfigError
        No cam is named, or a name is unknown.
    LawError, ProfileError
        A cam has no law or no contour.

    Examples
    --------
    >>> import cam_rig
    >>> result = cam_rig.check_contours(["poly345", "flat"])
    >>> [(checked.cam.name, len(checked.failed)) for checked in result.cams]
    [('poly345', 0), ('flat', 0)]
    """
    requested = [cams] if isinstance(cams, str | Path | CamConfig) else cams
    return ProfileResult(tuple(checked_cams(requested, every)), expected=every)


def checked_cams(cams: Sequence[str | Path | CamConfig], every: bool) -> list[CheckedCam]:
    """Return each requested cam with its law and the checks of its contour.

    ``every`` adds all cams of ``config/cams``.
    """
    results = []
    for source in _resolve(cams, every):
        cam = source if isinstance(source, CamConfig) else load_cam(source)
        try:
            results.append(CheckedCam.of(cam, build_law(cam)))
        except (LawError, ProfileError) as error:
            name = cam.name if isinstance(source, CamConfig) else source
            raise type(error)(f"{name}: {error}") from None
    return results


def _resolve(cams: Sequence[str | Path | CamConfig], every: bool) -> list[Path | CamConfig]:
    """Return the requested cams: those named, those of a scene, or all shipped cams.

    ``every`` adds all cams of ``config/cams``. Raises ConfigError if there is no cam.
    """
    sources: list[Path | CamConfig]
    if (scene := load.find_scene(cams)) is not None:
        library = load.Library.for_scene(scene)
        sources = [library.path("cams", name) for name in load.load_scene(scene).cams]
    else:
        sources = [cam if isinstance(cam, CamConfig) else load.cam_path(cam) for cam in cams]
    if every:
        sources += sorted((load.config_root() / "cams").glob("*.yaml"))
    if not sources:
        raise ConfigError("at least one cam file, name in config/cams, or --all is required")
    return sources
