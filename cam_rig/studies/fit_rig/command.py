"""Command ``cam-rig fit rig``: follower parameters from a run or from jump speeds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from cam_rig.errors import ConfigError
from cam_rig.show.command import RigOfBag, RigOfScene, command
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

Source = Annotated[
    Path,
    typer.Argument(help="Bag of a measured run (folder, .mcap, .db3), or .csv of jump speeds."),
]
CamOrScene = Annotated[
    str, typer.Argument(help="Cam of the measured rig: file, name in config/cams, or scene.")
]
Topics = Annotated[
    str | None,
    typer.Option(
        metavar="LINE",
        help="Topics of angle, lift and force in a bag of another program, as for compare.",
    ),
]
OneCam = Annotated[str | None, typer.Option("--cam", help="Cam of a scene or a bag with several.")]
Model = Annotated[
    str | None,
    typer.Option(
        metavar="one_mass or two_mass",
        help="One rigid mass, or two masses and a stem (default: the likelier).",
    ),
]
Fixed = Annotated[
    list[str] | None,
    typer.Option("--fix", metavar="NAME=VALUE", help="Known parameter in SI, such as mass=1.3."),
]
Tolerance = Annotated[
    float | None,
    typer.Option(metavar="RPM", help="Error of a jump speed (default: from the residuals)."),
]
Out = Annotated[
    Path | None, typer.Option(metavar="RIG.yaml", help="Write the identified rig to a file.")
]


@command("json", "csv", "plot")
def fit_rig(
    source: Source,
    cam: CamOrScene,
    topics: Topics = None,
    one_cam: OneCam = None,
    namespace: RigOfBag = None,
    rig: RigOfScene = None,
    model: Model = None,
    fix: Fixed = None,
    tolerance: Tolerance = None,
    out: Out = None,
    *,
    progress: Progress,
) -> Result:
    """Identify a follower's parameters from a measured run, or from its jump speeds.

    A bag must contain the cam angle, and lift or contact force or both, at several steady speeds.
    The fit returns mass, spring, preload, damping, restitution, and the stem if the data show its
    vibration. A table must contain the jump speeds. It can contain columns of the added mass, the
    spring and the preload. Each identified parameter has a standard error and its correlations with
    the others. A parameter that is not identifiable has no value, and a reason. The encoder's zero,
    the error of the sensors' clock, and the zero offset and backlash of the lift are fitted too.

    In Python: cam_rig.fit_rig(source, cam, topics, …, fix, tolerance, out)

    Examples
    --------
    cam-rig fit rig bench.mcap mycam --topics "angle=/encoder.position[0] force=/cell.data"

    cam-rig fit rig jumps.csv poly345 --fix damping=8.6 --out mine/rigs/bench.yaml
    """
    from cam_rig.studies.fit_rig import study

    result = study.fit_rig(
        source,
        cam,
        topics=topics,
        one_cam=one_cam,
        namespace=namespace,
        rig=rig,
        model=model,
        fix=_parse_fixed(fix),
        tolerance=tolerance,
        out=out,
        progress=progress,
    )
    if out is not None:
        say(f"rig: {out}")
    return result


def _parse_fixed(options: list[str] | None) -> dict[str, float]:
    """Return parameter values by name from options such as ``mass=1.3``.

    The values are in SI. The fit checks the names, not this function.
    """
    values = dict[str, float]()
    for option in options or []:
        name, _, text = (part.strip() for part in option.partition("="))
        if name in values:
            raise ConfigError(f"--fix {name} is repeated; remove one")
        try:
            values[name] = float(text)
        except ValueError:
            values[name] = math.nan
        if not math.isfinite(values[name]):
            raise ConfigError(f"--fix: {name} must be a finite number in SI, got {text!r}")
    return values
