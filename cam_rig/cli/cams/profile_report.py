"""The checks of ``cam-rig profile`` as tables, as JSON, and as a refusal."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import TYPE_CHECKING, Any

from cam_rig.cli.common.console import say, show
from cam_rig.errors import ProfileError
from cam_rig.profile.checks.check import FACTORS

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.profile.checks.check import Check
    from cam_rig.schema import CamConfig
    from cam_rig.tables import Cell, DataTable

    Found = list[tuple[CamConfig, Law, list[Check]]]

#: Checks that the table of several cams shows, and its headings and units for them.
COLUMNS = {
    "convex radius of curvature": ("convex", "mm"),
    "concave radius of curvature": ("concave", "mm"),
    "pressure angle": ("pressure", "°"),
}
#: What stands where a cam has no such number.
NONE = "–"


def show_checks(found: Found) -> None:
    """One cam in full, several in a row each; then what is wrong."""
    from cam_rig.profile.checks.table import checks_table

    show(checks_table(*found[0]) if len(found) == 1 else _several(found))
    for cam, _, checks in found:
        for check in checks:
            if not check.passed:
                say(f"{cam.name}: {check}")
        if cam.cannot_be_made is not None:
            say(f"{cam.name}: its file says that it cannot be made: {cam.cannot_be_made}")


def warn(cam: CamConfig, checks: list[Check], force: bool) -> None:
    """Say what is wrong with a cam that is going to be drawn.

    Raises
    ------
    ProfileError : it cannot exist, and is not forced
    """
    for check in (check for check in checks if not check.passed):
        if check.vital and not force:
            raise ProfileError(f"{cam.name}: {check}; or draw it with --force")
        say(f"warning: {cam.name}: {check}")


def _several(found: Found) -> DataTable:
    from cam_rig.tables import Column, tabulate

    def worst(name: str) -> Callable[[tuple[CamConfig, Law, list[Check]]], Cell]:
        return lambda row: _worst([check for check in row[2] if check.name == name])

    return tabulate(
        "Least radii of curvature, greatest pressure angle, base radius and its least",
        found,
        (
            (Column("cam"), lambda row: row[0].name),
            *(
                (Column(heading, unit, ".4g", NONE), worst(name))
                for name, (heading, unit) in COLUMNS.items()
            ),
            (Column("base", "mm", ".4g"), lambda row: row[0].follower.base_radius.si * 1e3),
            (
                Column("least", "mm", ".4g", NONE),
                lambda row: next((c.limit * 1e3 for c in row[2] if c.name == "base radius"), None),
            ),
            (Column("checks"), lambda row: _result(row[2])),
        ),
        f"{NONE}: nothing to check, or no least one found. All checks: one cam, or --json.",
    )


def _result(checks: list[Check]) -> str:
    failed = sum(not check.passed for check in checks)
    return f"{failed} fail" if failed else f"{len(checks)} ok"


def _worst(checks: list[Check]) -> float | None:
    """Value of the check nearest to its limit, of two discs."""
    if not checks:
        return None
    worst = min(checks, key=lambda c: c.value * (1.0 if c.relation == "more than" else -1.0))
    return worst.value * FACTORS[worst.unit] if isfinite(worst.value) else None


def to_json(found: Found) -> dict[str, Any]:
    """Every check as plain data, in the units of the table."""
    return {
        cam.name: {
            "follower": cam.follower.type,
            "passed": all(check.passed for check in checks),
            "cannot_be_made": cam.cannot_be_made,
            "checks": [_entry(check) for check in checks],
        }
        for cam, _, checks in found
    }


def _entry(check: Check) -> dict[str, Any]:
    factor = FACTORS[check.unit]
    return {
        "check": check.title,
        "value": check.value * factor if isfinite(check.value) else None,
        "relation": check.relation,
        "limit": check.limit * factor,
        "unit": check.unit,
        "angle_deg": check.degrees,
        "passed": check.passed,
        "vital": check.vital,
    }
