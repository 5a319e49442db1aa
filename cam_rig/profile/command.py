"""cam-rig profile: the cam's shape, checked, drawn, measured."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ProfileError
from cam_rig.profile.checks import FACTORS
from cam_rig.show.command import (
    Json,
    check_outputs,
    user_errors,
    write_json,
    write_plot,
)
from cam_rig.show.terminal import say, show

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.profile.checks import Check
    from cam_rig.schema import CamConfig
    from cam_rig.show.tables import Cell, DataTable

    Found = list[tuple[CamConfig, Law, list[Check]]]
    from cam_rig.profile.command_files import Request


# The checks of ``cam-rig profile`` as tables, as JSON, and as a refusal.

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
    from cam_rig.profile.check_table import checks_table

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
    from cam_rig.show.tables import Head, tabulate

    def worst(name: str) -> Callable[[tuple[CamConfig, Law, list[Check]]], Cell]:
        return lambda row: _worst([check for check in row[2] if check.name == name])

    return tabulate(
        "Least radii of curvature, greatest pressure angle, base radius and its least",
        found,
        (
            (Head("cam"), lambda row: row[0].name),
            *(
                (Head(heading, unit, ".4g", NONE), worst(name))
                for name, (heading, unit) in COLUMNS.items()
            ),
            (Head("base", "mm", ".4g"), lambda row: row[0].follower.base_radius.si * 1e3),
            (
                Head("least", "mm", ".4g", NONE),
                lambda row: next((c.limit * 1e3 for c in row[2] if c.name == "base radius"), None),
            ),
            (Head("checks"), lambda row: _result(row[2])),
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


Cams = Annotated[
    list[str] | None,
    typer.Argument(help="Cam files, or names in config/cams; or one scene: its cams."),
]

Every = Annotated[bool, typer.Option("--all", help="Check every cam of config/cams.")]

Out = Annotated[
    Path | None, typer.Option(help="Write the contour: .dxf, .svg or .csv (lengths in mm).")
]

Plot = Annotated[Path | None, typer.Option(help="Draw the cam (PNG, SVG, PDF).")]

Positions = Annotated[
    int | None,
    typer.Option(
        min=3, max=720, help="Positions of the follower around the cam in --plot; else 24."
    ),
]

Pitch = Annotated[
    bool, typer.Option("--pitch", help="Write the pitch curve instead of the contour.")
]

Cutter = Annotated[
    float | None,
    typer.Option(metavar="MM", help="Write the path of a cutter of this radius instead."),
]

Tolerance = Annotated[float, typer.Option(metavar="UM", help="Chord error of DXF and SVG, in µm.")]

Points = Annotated[
    int, typer.Option(min=36, max=1_000_000, help="Rows of a CSV file, over one turn.")
]

Source = Annotated[
    Path | None,
    typer.Option("--from", help="Measure this contour (.csv, .dxf) with the cam's follower."),
]

Force = Annotated[bool, typer.Option("--force", help="Draw a cam even though it cannot exist.")]


def profile(
    cams: Cams = None,
    every: Every = False,
    out: Out = None,
    plot: Plot = None,
    positions: Positions = None,
    pitch: Pitch = False,
    cutter: Cutter = None,
    tolerance: Tolerance = 1.0,
    points: Points = 3600,
    source: Source = None,
    force: Force = False,
    json_target: Json = None,
) -> None:
    """Check a cam's contour: undercut, curvature, pressure angle, reach. Draw it, or measure one.

    The code is 1 when a check fails; with --all a cam does not count whose file says that it
    cannot_be_made, and why. With --from the cam's follower is put on the contour of a
    file and read at every angle; --out then writes that law as CSV. --positions are those of the
    graphical method: the follower's places around the standing cam.

    Examples
    --------
    cam-rig profile --all

    cam-rig profile quick

    cam-rig profile oscillating_roller --plot out/cam.png

    cam-rig profile point --plot out/point.png --positions 10

    cam-rig profile conjugate --out out/conjugate.dxf --tolerance 0.5

    cam-rig profile poly345 --cutter 6 --out out/cutter.csv

    cam-rig profile poly345 --from out/cam.dxf --out out/law.csv
    """
    with user_errors():
        from cam_rig.errors import ConfigError
        from cam_rig.profile import command_files

        check_outputs(json_target, plot)
        if positions is not None and plot is None:
            raise ConfigError("--positions: are of the picture; needed: --plot PATH")
        request = command_files.Request(out, pitch, cutter, tolerance, points, source)
        found = _checked(_paths(cams or [], every))
        request.require(len(found), drawing=plot is not None)
        if source is not None:
            command_files.run(request, found[0][0], found[0][1], json_target)
            return
        if out is not None or plot is not None:
            _draw(request, found, plot, force, positions)
        write_json(to_json(found), json_target)
        if out is None and plot is None:
            show_checks(found)
            if _any_fails(found, every):
                raise typer.Exit(1)


def _any_fails(found: Found, every: bool) -> bool:
    """Whether a check fails; of all cams, one that is not meant to: see ``cannot_be_made``."""
    asked = [checks for cam, _, checks in found if not (every and cam.cannot_be_made)]
    return not all(check.passed for checks in asked for check in checks)


def _draw(
    request: Request, found: Found, plot: Path | None, force: bool, positions: int | None
) -> None:
    from cam_rig.profile import command_files

    cam, law, checks = found[0]
    warn(cam, checks, force)
    if request.out is not None:
        command_files.write(request, cam, law, force)
    if plot is not None:
        from cam_rig.profile.figures import POSITIONS, figure

        write_plot(plot, lambda: figure(cam, law, checks, positions or POSITIONS))


def _paths(cams: list[str], every: bool) -> list[Path]:
    from cam_rig.errors import ConfigError
    from cam_rig.schema.load import (
        Library,
        cam_path,
        config_root,
        load_scene,
        one_scene,
        scene_path,
    )

    if (scene := one_scene(cams)) is not None:
        path = scene_path(scene)
        library = Library.beside(path)
        paths = [library.path("cams", name) for name in load_scene(path).cams]
    else:
        paths = [cam_path(cam) for cam in cams]
    if every:
        paths += sorted((config_root() / "cams").glob("*.yaml"))
    if not paths:
        raise ConfigError("no cam is named; allowed: cam files, names in config/cams, or --all")
    return paths


def _checked(paths: list[Path]) -> Found:
    from cam_rig.errors import LawError, ProfileError
    from cam_rig.laws import build_law
    from cam_rig.profile.check_table import check_cam
    from cam_rig.schema import load_cam

    found = []
    for path in paths:
        cam = load_cam(path)
        try:
            law = build_law(cam)
            found.append((cam, law, check_cam(cam, law)))
        except (LawError, ProfileError) as error:
            raise type(error)(f"{path}: {error}") from None
    return found
