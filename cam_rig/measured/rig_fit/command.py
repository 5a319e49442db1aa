"""cam-rig fit rig: a follower's numbers from a measured run, or from a table of jump speeds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.show.command import (
    Csv,
    Json,
    Plot,
    RigOfScene,
    check_outputs,
    progress_bar,
    require_new,
    say_assumed,
    user_errors,
    write_csv,
    write_json,
    write_new,
    write_plot,
)
from cam_rig.show.terminal import console, say, show

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from cam_rig.laws import Law
    from cam_rig.laws.cam import CamSet
    from cam_rig.measured.rig_fit.result import FoundNumber
    from cam_rig.schema import RigConfig
    from cam_rig.show.tables import DataTable

#: Kinds of file that hold a table; all others are bags.
TABLES = (".csv", ".txt", ".tsv")


@dataclass(frozen=True, eq=False)
class FoundRig:
    """What either kind of source gives: to print, to write, to draw; ``residual`` in words."""

    tables: list[DataTable]
    sentences: list[str]
    data: dict[str, Any]
    numbers: tuple[FoundNumber, ...]
    figure: Callable[[], Figure]
    residual: str


class FollowerModel(Enum):
    """What is fitted."""

    one_mass = "one_mass"
    two_mass = "two_mass"


def _model(name: str) -> FollowerModel:
    """A model by its name; that of older releases is read too."""
    from cam_rig.schema.scene import model_named

    known = [model.value for model in FollowerModel]
    if model_named(name) not in known:
        raise typer.BadParameter(f"is {name!r}; allowed: {' or '.join(known)}")
    return FollowerModel(model_named(name))


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
    FollowerModel | None,
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
    plot: Plot = None,
    csv: Csv = None,
    json_target: Json = None,
) -> None:
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
    with user_errors():
        from cam_rig.simulation.asked import asked_cams

        check_outputs(json_target, plot, csv)
        if out is not None and out.suffix != ".yaml":
            raise ConfigError(f"--out: is {out}; allowed: a name that ends in .yaml")
        if out is not None:
            require_new(out)
        known, cams = _known(given), asked_cams([cam], rig)
        name = None if model is None else model.value
        if source.suffix.lower() in TABLES:
            _require_none(topics=topics, namespace=namespace)
            law = _law_of(cams, one_cam)
            found = _from_table(source, law, cams.rig, name, known, tolerance)
        else:
            _require_none(tolerance=tolerance)
            found = _from_bag(source, cams, one_cam, topics, namespace, name, known)
        show(*found.tables)
        say(*found.sentences)
        write_csv(found.tables, csv)
        write_json(found.data | {"conclusions": found.sentences}, json_target)
        if plot is not None:
            write_plot(plot, found.figure)
        if out is not None:
            _write_rig(out, found, cams.rig, source)


def _from_bag(
    bag: Path,
    cams: CamSet,
    one_cam: str | None,
    topics: str | None,
    namespace: str | None,
    model: str | None,
    given: dict[str, float],
) -> FoundRig:
    from cam_rig.bag.foreign_topics import parse_topics
    from cam_rig.bag.measured_run import read_measured
    from cam_rig.measured.rig_fit.figures import rig_figure
    from cam_rig.measured.rig_fit.rig_fit import fit_rig as fit
    from cam_rig.measured.rig_fit.tables import (
        correlation_table,
        gauges_table,
        holds_table,
        numbers_table,
        rig_conclusions,
        rig_json,
    )

    mapping = None if topics is None else parse_topics(topics)
    asked = one_cam or (next(iter(cams.laws)) if len(cams.laws) == 1 else None)
    if mapping is not None:
        _require_none(namespace=namespace)
        asked = _law_of(cams, one_cam).name
    run = read_measured(bag, mapping, asked, namespace)
    law = _law_of(cams, run.cam)
    with console.status("reading") as status:
        found = fit(law, run, cams.rig, model, given, status.update)
    tables = [numbers_table(found.numbers, f"{bag.name}: the follower")]
    if len(found.correlated) > 1:
        tables.append(correlation_table(found.correlated, found.correlation))
    tables += [holds_table(found), gauges_table(found)]
    left = [
        f"{found.gauges.lift_noise * 1e6:.3g} µm" if found.gauges.lift_noise else "",
        f"{found.gauges.force_noise:.3g} N" if found.gauges.force_noise else "",
    ]
    residual = f"{' and '.join(filter(None, left))} r.m.s. over {len(found.holds)} speeds"
    sentences = [*run.notes, *rig_conclusions(found)]
    return FoundRig(
        tables,
        sentences,
        rig_json(found),
        found.numbers,
        lambda: rig_figure(found),
        residual,
    )


def _from_table(
    file: Path,
    law: Law,
    rig: RigConfig,
    model: str | None,
    given: dict[str, float],
    tolerance: float | None,
) -> FoundRig:
    from cam_rig.measured.rig_fit.figures import jump_figure
    from cam_rig.measured.rig_fit.jump_fit import fit_jumps
    from cam_rig.measured.rig_fit.jump_table import read_jump_table
    from cam_rig.measured.rig_fit.tables import (
        correlation_table,
        jump_conclusions,
        jumps_json,
        jumps_table,
        numbers_table,
    )

    if tolerance is not None and not tolerance > 0.0:
        raise ConfigError(f"--tolerance: is {tolerance:g} rpm; allowed: > 0")
    table = read_jump_table(file)
    with progress_bar() as bar:
        task = bar.add_task("set-ups of a step of the search", total=None)

        def on_setup(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        found = fit_jumps(law, table, rig, model, given, tolerance, on_setup)
    tables = [numbers_table(found.numbers, f"{file.name}: the follower")]
    if len(found.identified) > 1:
        names = tuple(number.name for number in found.identified)
        tables.append(correlation_table(names, found.correlation))
    tables.append(jumps_table(found))
    sentences = [*(f"{file.name}: {note}" for note in table.notes), *jump_conclusions(found)]
    residual = f"{found.error:.3g} rpm a reading, {len(found.speeds)} readings"
    return FoundRig(
        tables,
        sentences,
        jumps_json(found),
        found.numbers,
        lambda: jump_figure(found),
        residual,
    )


def _law_of(cams: CamSet, name: str | None) -> Law:
    """The law of a cam that is named, or of the only one."""
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
    """NAME=VALUE by name."""
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


def _write_rig(out: Path, found: FoundRig, base: RigConfig, source: Path) -> None:
    from cam_rig.measured.rig_fit.rig_fit import fitted_rig

    if not any(number.value is not None for number in found.numbers):
        raise ConfigError(f"--out {out}: nothing was found to write; allowed: a fit with numbers")
    words = f"cam-rig fit rig {source.name}"
    text, assumed = fitted_rig(out.stem, found.numbers, base, words, found.residual)
    write_new(out.parent, {out.name: text})
    say_assumed(assumed)
    say(f"rig: {out}")
