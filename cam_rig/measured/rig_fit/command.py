"""cam-rig fit rig: a follower's numbers from a measured run, or from a table of jump speeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.show.command import RigOfScene, command, require_new_yaml, say_assumed, write_new
from cam_rig.show.result import Progress, Result
from cam_rig.show.terminal import say

if TYPE_CHECKING:
    from cam_rig.laws import Law
    from cam_rig.laws.cam import CamSet
    from cam_rig.measured.rig_fit.jump_fit import JumpFit
    from cam_rig.measured.rig_fit.result import RigFit
    from cam_rig.schema import RigConfig
    from cam_rig.simulation.instruments import MeasuredRun

#: Kinds of file that hold a table; all others are bags.
TABLES = (".csv", ".txt", ".tsv")
#: What is fitted.
MODELS = ("one_mass", "two_mass")


def _model(name: str) -> str:
    """A model by its name; that of older releases is read too."""
    from cam_rig.schema.scene import model_named

    known = str(model_named(name))
    if known not in MODELS:
        raise typer.BadParameter(f"is {name!r}; allowed: {' or '.join(MODELS)}")
    return known


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
Namespace = Annotated[
    str | None, typer.Option("--namespace", help="One rig of a bag that holds several: /rig2.")
]
Model = Annotated[
    str | None,
    typer.Option(
        parser=_model,
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
    namespace: Namespace = None,
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

    Examples
    --------
    cam-rig fit rig bench.mcap mycam --topics "angle=/encoder.position[0] force=/cell.data"

    cam-rig fit rig jumps.csv poly345 --given damping=8.6 --out mine/rigs/bench.yaml
    """
    from cam_rig.measured.rig_fit.jump_fit import fit_jumps
    from cam_rig.measured.rig_fit.jump_table import read_jump_table
    from cam_rig.measured.rig_fit.rig_fit import fit_rig as fit
    from cam_rig.simulation.asked import asked_cams

    require_new_yaml(out)
    known, cams = _known(given), asked_cams([cam], rig)
    found: JumpFit | RigFit
    if source.suffix.lower() in TABLES:
        _require_none(topics=topics, namespace=namespace)
        if tolerance is not None and not tolerance > 0.0:
            raise ConfigError(f"--tolerance: is {tolerance:g} rpm; allowed: > 0")
        law, table = _law_of(cams, one_cam), read_jump_table(source)
        found = fit_jumps(law, table, cams.rig, model, known, tolerance, progress)
    else:
        _require_none(tolerance=tolerance)
        run = _read(source, cams, one_cam, topics, namespace)
        law = _law_of(cams, run.cam)
        progress.begin(None, "reading")
        found = fit(law, run, cams.rig, model, known, progress)
    if out is not None:
        _write_rig(out, found, cams.rig, source)
    return found


def _read(
    bag: Path, cams: CamSet, one_cam: str | None, topics: str | None, namespace: str | None
) -> MeasuredRun:
    """The run of a bag: of another program by its topics, of the rig in its namespace."""
    from cam_rig.bag.foreign_topics import parse_topics
    from cam_rig.bag.measured_run import read_measured

    mapping = None if topics is None else parse_topics(topics)
    asked = one_cam or (next(iter(cams.laws)) if len(cams.laws) == 1 else None)
    if mapping is not None:
        _require_none(namespace=namespace)
        asked = _law_of(cams, one_cam).name
    return read_measured(bag, mapping, asked, namespace)


def _law_of(cams: CamSet, name: str | None) -> Law:
    there = list(cams.laws)
    if name is None and len(there) > 1:
        raise ConfigError(f"cams are {', '.join(there)}; say with --cam which one was on")
    chosen = name or there[0]
    if chosen not in cams.laws:
        raise ConfigError(
            f"--cam {chosen}: the bag's or the scene's has no such cam; allowed: "
            f"{', '.join(there)}{did_you_mean(chosen, there)}"
        )
    return cams.laws[chosen]


def _known(given: list[str] | None) -> dict[str, float]:
    from cam_rig.measured.rig_fit.numbers import NUMBERS

    found = {}
    for words in given or []:
        name, _, text = words.partition("=")
        name = name.strip()
        if name not in NUMBERS:
            raise ConfigError(
                f"--given {words}: {name!r} is no number of a follower; allowed: "
                f"{', '.join(NUMBERS)}{did_you_mean(name, list(NUMBERS))}"
            )
        try:
            found[name] = float(text)
        except ValueError as error:
            raise ConfigError(
                f"--given {words}: {text!r} is no number; allowed: {name}=NUMBER, in "
                f"{NUMBERS[name].unit}"
            ) from error
    return found


def _require_none(**options: object) -> None:
    """Refuse an option that the source has no use for, rather than pass it over."""
    for name, value in options.items():
        if value is not None:
            raise ConfigError(
                f"--{name} {value}: has no meaning for this source; allowed: leave it out"
            )


def _write_rig(out: Path, found: JumpFit | RigFit, base: RigConfig, source: Path) -> None:
    from cam_rig.measured.rig_fit.rig_fit import fitted_rig

    if not any(number.value is not None for number in found.numbers):
        raise ConfigError(f"--out {out}: nothing was found to write; allowed: a fit with numbers")
    words = f"cam-rig fit rig {source.name}"
    text, assumed = fitted_rig(out.stem, found.numbers, base, words, found.residual)
    write_new(out.parent, {out.name: text})
    say_assumed(assumed)
    say(f"rig: {out}")
