"""A follower's numbers from what was measured: a bag of a run, or a table of jump speeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.extras import libraries_named
from cam_rig.files import new_yaml, write_new
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.measured.rig_fit import rig_fit
from cam_rig.measured.rig_fit.jump_fit import JumpFit, fit_jumps
from cam_rig.measured.rig_fit.jump_table import read_jump_table
from cam_rig.measured.rig_fit.numbers import NUMBERS
from cam_rig.measured.rig_fit.result import RigFit
from cam_rig.schema import CamConfig, RigConfig
from cam_rig.schema.scene import model_named
from cam_rig.show.result import SILENT, Progress
from cam_rig.simulation.asked import Rig, asked_cams
from cam_rig.simulation.instruments import MeasuredRun

#: Kinds of file that hold a table; all others are bags.
TABLES = (".csv", ".txt", ".tsv")
#: What is fitted.
MODELS = ("one_mass", "two_mass")


@checked
def fit_rig(
    source: str | Path,
    cam: str | Path | CamConfig,
    *,
    topics: str | None = None,
    one_cam: str | None = None,
    namespace: str | None = None,
    rig: Rig = None,
    model: str | None = None,
    given: Mapping[str, float] | None = None,
    tolerance: float | None = None,
    out: str | Path | None = None,
    progress: Progress = SILENT,
) -> RigFit | JumpFit:
    r"""A follower's numbers from a run measured on it, or from its jump speeds.

    Each has its standard error; what is not identifiable gets no number, and a reason.
    The command is ``cam-rig fit rig``.

    Parameters
    ----------
    source : a bag with cam angle, and lift or force or both; or a .csv or .txt of jump speeds
    cam : that was on: a name, a path or a cam, or a scene's name or path
    topics, namespace : of a bag, as `compare` takes them
    one_cam : of a scene or a bag with several
    rig : a name, a path or a rig, whose numbers stand where nothing tells any; None: as `jump`
    model : ``one_mass`` or ``two_mass``; None: the likelier
    given : numbers that are known, by their keys in a rig file, SI: ``{"mass": 1.3}``
    tolerance : standard error of a jump speed, rpm; None: from the residuals
    out : a new .yaml file for a rig of what was found; ``assumed`` says what it has of another
    progress : told how far it is

    Raises
    ------
    BagError, ConfigError : a source that cannot be read, or arguments that do not go together
    OutputError : ``out`` is there already, or cannot be written

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> table = "preload [N],jump speed [rpm]\n20,446.7\n40,469\n60,490.3\n"
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(table), file.flush()
    ...     known = {"spring_stiffness": 4030.0, "damping": 8.6}
    ...     found = cam_rig.fit_rig(file.name, "poly345", rig="tm21", given=known)
    >>> [number.name for number in found.identified]
    ['mass']
    """
    target, bag = new_yaml(out), Path(source)
    known, cams = dict(given or {}), asked_cams([cam], rig)
    sought = _checked(model, known, tolerance)
    if bag.suffix.lower() in TABLES:
        _require_none(topics=topics, namespace=namespace)
        asked = _law_of(cams, one_cam), read_jump_table(bag), cams.rig, sought, known
        found: JumpFit | RigFit = fit_jumps(*asked, tolerance, progress)
    else:
        _require_none(tolerance=tolerance)
        law, run = _read(bag, cams, one_cam, topics, namespace)
        found = rig_fit.fit_rig(law, run, cams.rig, sought, known, progress)
    return found if target is None else _written(target, found, cams.rig, bag)


def _checked(model: str | None, given: Mapping[str, float], tolerance: float | None) -> str | None:
    """The model, by its name of older releases too, if what is given beside it can be."""
    known: str | None = model_named(model)
    if known is not None and known not in MODELS:
        raise ConfigError(f"--model: is {model!r}; allowed: {' or '.join(MODELS)}")
    if tolerance is not None and not tolerance > 0.0:
        raise ConfigError(f"--tolerance: is {tolerance:g} rpm; allowed: > 0")
    for name, value in given.items():
        if name not in NUMBERS:
            raise ConfigError(
                f"--given {name}={value:g}: {name!r} is no number of a follower; allowed: "
                f"{', '.join(NUMBERS)}{did_you_mean(name, list(NUMBERS))}"
            )
    return known


def _read(
    bag: Path, cams: CamSet, one_cam: str | None, topics: str | None, namespace: str | None
) -> tuple[Law, MeasuredRun]:
    """The run of a bag: of another program by its topics, of the rig in its namespace."""
    with libraries_named():
        from cam_rig.bag.foreign_topics import parse_topics
        from cam_rig.bag.measured_run import read_measured

    mapping = None if topics is None else parse_topics(topics)
    asked = one_cam or (next(iter(cams.laws)) if len(cams.laws) == 1 else None)
    if mapping is not None:
        _require_none(namespace=namespace)
        asked = _law_of(cams, one_cam).name
    run = read_measured(bag, mapping, asked, namespace)
    return _law_of(cams, run.cam), run


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


def _require_none(**options: object) -> None:
    """Refuse an option that the source has no use for, rather than pass it over."""
    for name, value in options.items():
        if value is not None:
            raise ConfigError(
                f"--{name} {value}: has no meaning for this source; allowed: leave it out"
            )


def _written(out: Path, found: JumpFit | RigFit, base: RigConfig, source: Path) -> RigFit | JumpFit:
    if not any(number.value is not None for number in found.numbers):
        raise ConfigError(f"--out {out}: nothing was found to write; allowed: a fit with numbers")
    words = f"cam-rig fit rig {source.name}"
    text, assumed = rig_fit.fitted_rig(out.stem, found.numbers, base, words, found.residual)
    write_new(out.parent, {out.name: text})
    return replace(found, assumed=assumed)
