"""Several laws at once for cam-rig law: what the names mean, the plot, peaks, CSV."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.show.command import check_outputs, check_recording, command, give_out
from cam_rig.show.result import Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.laws.results import CamLawsResult, RisesResult


# cam-rig law: one cam's law, or several over each other, as a plot, a table and CSV.

Save = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Write the curves as a Rerun recording (.rrd) too."),
]


@command("json", "csv")
def law(
    names: Annotated[
        list[str],
        typer.Argument(
            help="Cam files, names in config/cams, or names of rises as `cam-rig laws` lists them."
        ),
    ],
    rises: Annotated[
        bool,
        typer.Option("--rises", help="Names that a cam and a rise have in common mean the rise."),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="The plot (PNG, SVG, PDF); out/law_NAMES.png if not given."
        ),
    ] = None,
    save: Save = None,
    *,
    csv: Path | None,
    json: str | None,
) -> None:
    """Plot lift, velocity, acceleration and jerk over the cam angle; list peaks and joints.

    Peaks come from the roots of the next derivative, not from samples. Derivatives are in the
    cam angle, per rad: times the cam's speed in rad/s they are those in time.

    Several laws are laid over each other: as cams over the turn if every name is a cam's, else
    as bare rises of unit lift over a unit span. The curves are in CSV
    and JSON, with which nothing is drawn unless --out is given.

    Examples
    --------
    cam-rig law poly345

    cam-rig law poly345 cycloidal bezier9 --out out/rises.png

    cam-rig law poly345 cycloidal bezier15 --csv out/cams.csv

    cam-rig law poly345 bezier8_start --rises

    cam-rig law poly345 cycloidal bezier15 --save out/laws.rrd

    cam-rig law config/cams/worked_example_quintic.yaml --out quintic.pdf

    cam-rig law bezier15 --csv - > bezier15.csv
    """
    check_outputs(None, out)
    if save is not None:
        check_recording(save)
    found, called = _named(names, rises)
    if out is None and csv is None and json is None:
        out = Path("out") / f"law_{'_'.join(called)[:MAX_LETTERS]}.png"
    give_out(found, out, csv, json)
    if save is not None:
        record(found, save)


def _named(names: list[str], rises: bool) -> tuple[RisesResult | CamLawsResult, list[str]]:
    """What names mean, and words for the name of its plot."""
    from cam_rig.laws.cam import law_of
    from cam_rig.laws.results import CamLawsResult, RisesResult
    from cam_rig.schema import load_cam
    from cam_rig.schema.load import cam_path

    if are_rises(names, rises):
        return RisesResult(tuple(names)), ["rises", *names]
    paths = [cam_path(name) for name in names]
    cams = [(cam, law_of(path, cam)) for path in paths for cam in [load_cam(path)]]
    return CamLawsResult(tuple(cams)), [cam.name for cam, _ in cams]


# cam-rig laws: every displacement law, side by side.


@command("json", "csv", "plot")
def laws(
    family: Annotated[
        str | None,
        typer.Option(help="Only this family of rises: polynomial, start, end (half), classical."),
    ] = None,
) -> Result:
    """List the laws with their peaks per unit rise and unit span, and how smoothly they join.

    Continuity Ck: the highest derivative that goes on without a jump where the rise meets a
    dwell (a half-rise: a dwell and constant velocity).

    The plot lays the rises of each family over each other, s to s''' one below the other.

    Examples
    --------
    cam-rig laws

    cam-rig laws --plot out/laws.png

    cam-rig laws --family start --plot out/half_rises.pdf

    cam-rig laws --json -
    """
    from cam_rig.laws.catalogue import families
    from cam_rig.laws.results import LawsResult

    found = families()
    if family is None:
        return LawsResult(tuple(found.values()), free=True)
    if family not in found:
        hint = did_you_mean(family, found)
        raise ConfigError(f"--family {family!r}: no such family{hint}; allowed: {', '.join(found)}")
    return LawsResult((found[family],), free=False)


#: Letters of the names in the name of a plot.
MAX_LETTERS = 60


def are_rises(names: Sequence[str], rises: bool) -> bool:
    """Whether the names are drawn as bare rises: when asked for, or when not all are cams."""
    from cam_rig.laws.segments import NAMED_RISES
    from cam_rig.schema.load import config_root

    cams = sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ConfigError(f"{name!r} is named twice; allowed: each law once")
        if not _is_cam(name, cams) and name not in NAMED_RISES:
            hint = did_you_mean(name, [*cams, *NAMED_RISES])
            raise ConfigError(
                f"{name[:40]!r}: no such cam or rise{hint}; cams: {', '.join(cams)}; "
                f"rises: {', '.join(NAMED_RISES)}"
            )
    if not rises and all(_is_cam(name, cams) for name in names):
        return False
    alone = next((name for name in names if name not in NAMED_RISES), None)
    if alone is not None:
        other = next((f"{name!r} is a rise" for name in names if not _is_cam(name, cams)), None)
        raise ConfigError(
            f"{alone!r} is a cam and no rise, {other or '--rises asks for rises'}; allowed: cams "
            f"with cams, rises with rises; rises: {', '.join(NAMED_RISES)}"
        )
    return True


def record(found: RisesResult | CamLawsResult, path: Path) -> None:
    """Write the curves of cams, in their unit of lift, or of bare rises, for Rerun."""
    from cam_rig.laws.catalogue import cam_curves, common_unit, rise_curves
    from cam_rig.laws.chart import save_laws
    from cam_rig.laws.results import PER, RisesResult

    if isinstance(found, RisesResult):
        curves = [rise_curves(name) for name in found.names]
        save_laws(curves, "u", ("h", "h/β", "h/β²", "h/β³"), path)
    else:
        unit, factor = common_unit(cam for cam, _ in found.cams)
        curves = [cam_curves(cam.name, law) for cam, law in found.cams]
        curves = [replace(curve, motion=curve.motion / factor) for curve in curves]
        units = tuple(f"{unit}{per}" for per in PER)
        save_laws(curves, "°", units, path, {cam.name: cam.title for cam, _ in found.cams})
    say(f"recording: {path}")


def _is_cam(name: str, cams: Sequence[str]) -> bool:
    """Whether it is a cam's name, or a path, which is a cam's or an error of its own."""
    from cam_rig.schema.load import cam_path

    return name in cams or cam_path(name) == Path(name)
