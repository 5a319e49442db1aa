"""The checks of ``cam-rig profile`` as tables, as JSON, and as a refusal."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

from cam_rig.cli.common.console import console
from cam_rig.errors import ProfileError
from cam_rig.profile.checks.check import FACTORS

if TYPE_CHECKING:
    from rich.table import Table

    from cam_rig.laws import Law
    from cam_rig.profile.checks.check import Check
    from cam_rig.schema import CamConfig

    Found = list[tuple[CamConfig, Law, list[Check]]]

#: Checks that the table of several cams shows, and its headings for them.
COLUMNS = {
    "convex radius of curvature": "convex",
    "concave radius of curvature": "concave",
    "pressure angle": "pressure",
}
#: What stands where a cam has no such number.
NONE = "–"


def show(found: Found) -> None:
    """One cam in full, several in a row each; then what is wrong."""
    console.print(_one(*found[0]) if len(found) == 1 else _several(found))
    for cam, _, checks in found:
        for check in checks:
            if not check.passed:
                console.print(f"{cam.name}: {check}", markup=False, soft_wrap=True)
        if cam.cannot_be_made is not None:
            words = f"{cam.name}: its file says that it cannot be made: {cam.cannot_be_made}"
            console.print(words, markup=False, soft_wrap=True)


def warn(cam: CamConfig, checks: list[Check], force: bool) -> None:
    """Say what is wrong with a cam that is going to be drawn.

    Raises
    ------
    ProfileError : it cannot exist, and is not forced
    """
    for check in (check for check in checks if not check.passed):
        if check.vital and not force:
            raise ProfileError(f"{cam.name}: {check}; or draw it with --force")
        console.print(f"warning: {cam.name}: {check}", markup=False, soft_wrap=True)


def _one(cam: CamConfig, law: Law, checks: list[Check]) -> Table:
    from rich.box import SIMPLE
    from rich.table import Table

    kind = cam.follower.type.replace("_", " ")
    title = f"{cam.title}: {kind} follower, lift {law.lift * 1e3:.5g} mm"
    out = Table(title=title, box=SIMPLE, padding=(0, 1, 0, 0))
    for name in ("check", "value", "at", "allowed", ""):
        out.add_column(name, justify="right" if name in ("value", "at") else "left")
    for check in checks:
        where = "" if check.degrees is None else f"{check.degrees:.1f}°"
        mark = "ok" if check.passed else "[bold red]fails[/]"
        out.add_row(check.title, check.shown(check.value), where, check.allowed, mark)
    return out


def _several(found: Found) -> Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    out = Table(
        title="Least radii, base radius and its least in mm; greatest pressure angle in °",
        caption=f"{NONE}: nothing to check, or no least one found; all checks: one cam, or --json",
        box=SIMPLE_HEAD,
        padding=0,
        show_edge=False,
    )
    out.add_column("cam", no_wrap=True)
    for heading in (*COLUMNS.values(), "base", "least"):
        out.add_column(heading, justify="right", no_wrap=True)
    out.add_column("", no_wrap=True)
    for cam, _, checks in found:
        cells = [_worst([check for check in checks if check.name == name]) for name in COLUMNS]
        least = next((f"{c.limit * 1e3:.4g}" for c in checks if c.name == "base radius"), NONE)
        base = cam.follower.base_radius.si
        failed = sum(not check.passed for check in checks)
        mark = f"[bold red]{failed} fail[/]" if failed else f"{len(checks)} ok"
        out.add_row(cam.name, *cells, f"{base * 1e3:.4g}", least, mark)
    return out


def _worst(checks: list[Check]) -> str:
    """Value of the check nearest to its limit, of two discs."""
    if not checks:
        return NONE
    worst = min(checks, key=lambda c: c.value * (1.0 if c.relation == "more than" else -1.0))
    return f"{worst.value * FACTORS[worst.unit]:.4g}" if isfinite(worst.value) else NONE


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
