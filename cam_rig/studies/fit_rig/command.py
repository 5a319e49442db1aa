"""cam-rig fit rig: a follower's numbers from a measured run, or from a table of jump speeds."""

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
    str, typer.Argument(help="Cam that was on: a file, a name in config/cams, or a scene's.")
]
Topics = Annotated[
    str | None,
    typer.Option(
        metavar="LINE",
        help="Where angle, lift and force are in a bag of another program, as for compare.",
    ),
]
OneCam = Annotated[str | None, typer.Option("--cam", help="Cam of a scene or a bag with several.")]
Model = Annotated[
    str | None,
    typer.Option(
        metavar="one_mass or two_mass",
        help="One rigid mass, or two and a stem; by default the likelier.",
    ),
]
Given = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=VALUE", help="A number that is known, in SI: mass=1.3."),
]
Tolerance = Annotated[
    float | None,
    typer.Option(metavar="RPM", help="Error of a jump speed; by default from the residuals."),
]
Out = Annotated[
    Path | None, typer.Option(metavar="RIG.yaml", help="Write a rig file of what was found.")
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
    given: Given = None,
    tolerance: Tolerance = None,
    out: Out = None,
    *,
    progress: Progress,
) -> Result:
    """Find a follower's numbers from a run measured on it, or from its jump speeds.

    From a bag with cam angle, and lift or contact force or both, at some steady speeds: mass,
    spring, preload, damping, restitution, and the stem where it shows. From a table: columns of
    mass put on, spring, preload as far as there are, and of the jump speed. Each number has its
    standard error and correlations; what is not identifiable gets no number, and a reason. The
    encoder's zero, an error of the sensors' clock, the lift's zero offset and its backlash are
    found beside them.

    In Python: cam_rig.fit_rig(source, cam, topics, …, given, tolerance, out)

    Examples
    --------
    cam-rig fit rig bench.mcap mycam --topics "angle=/encoder.position[0] force=/cell.data"

    cam-rig fit rig jumps.csv poly345 --given damping=8.6 --out mine/rigs/bench.yaml
    """
    from cam_rig.studies.fit_rig import study

    found = study.fit_rig(
        source,
        cam,
        topics=topics,
        one_cam=one_cam,
        namespace=namespace,
        rig=rig,
        model=model,
        given=_known(given),
        tolerance=tolerance,
        out=out,
        progress=progress,
    )
    if out is not None:
        say(f"rig: {out}")
    return found


def _known(given: list[str] | None) -> dict[str, float]:
    """Numbers by name, of words as ``mass=1.3``; which names there are, the fit knows."""
    found = dict[str, float]()
    for words in given or []:
        name, _, text = (part.strip() for part in words.partition("="))
        if name in found:
            raise ConfigError(f"--given {words}: {name} is given twice; allowed: once")
        try:
            found[name] = float(text)
        except ValueError:
            found[name] = math.nan
        if not math.isfinite(found[name]):
            raise ConfigError(
                f"--given {words}: {text!r} is no finite number; allowed: NAME=NUMBER, in SI"
            )
    return found
