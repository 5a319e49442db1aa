"""Identification of a follower from a bag of a run, or from a jump speed table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from cam_rig.arguments import check_arguments
from cam_rig.errors import ConfigError, did_you_mean
from cam_rig.extras import friendly_import_errors
from cam_rig.files import new_yaml
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet
from cam_rig.schema import CamConfig
from cam_rig.schema.scene import present_model_name
from cam_rig.show.result import NULL_PROGRESS, Progress
from cam_rig.simulation.inputs import Rig, resolve_cams
from cam_rig.simulation.instruments import MeasuredRun
from cam_rig.studies.fit_rig.jumps.fit import JumpFit, fit_jumps
from cam_rig.studies.fit_rig.jumps.table import read_jump_table
from cam_rig.studies.fit_rig.parameters import PARAMETERS
from cam_rig.studies.fit_rig.rig_file import write_rig
from cam_rig.studies.fit_rig.run.fit import fit_run
from cam_rig.studies.fit_rig.run.result import RigFit

#: File name extensions of a table of jump speeds. Any other source is read as a bag.
TABLES = (".csv", ".txt", ".tsv")
#: Names of the follower models that can be fitted.
MODELS = ("one_mass", "two_mass")


@check_arguments
def fit_rig(
    source: str | Path,
    cam: str | Path | CamConfig,
    *,
    topics: str | None = None,
    one_cam: str | None = None,
    namespace: str | None = None,
    rig: Rig = None,
    model: str | None = None,
    fix: Mapping[str, float] | None = None,
    tolerance: float | None = None,
    out: str | Path | None = None,
    progress: Progress = NULL_PROGRESS,
) -> RigFit | JumpFit:
    r"""Identify a follower's parameters from a measured run, or from its jump speeds.

    Each identified parameter has a standard error. A parameter that is not identifiable has no
    value, and a reason. The command is ``cam-rig fit rig``.

    Parameters
    ----------
    source : str or Path
        Bag with cam angle, and lift or force or both; or .csv or .txt of jump speeds.
    cam : Cam, str or Path
        Cam of the measured rig: a name, a path or a cam, or a scene's name or path.
    topics, namespace : str, optional
        Topics or namespace of a bag, as in `compare`.
    one_cam : str, optional
        Cam of a scene or a bag with several cams.
    rig : Rig, str or Path, optional
        Name, path or rig with the values of parameters that are not identifiable (default: as in
        `jump_speeds`).
    model : str, optional
        ``one_mass`` or ``two_mass`` (default: the likelier).
    fix : mapping of str to float, optional
        Known values in SI by their keys in a rig file: ``{"mass": 1.3}``.
    tolerance : float, optional
        Standard error of a jump speed in rpm (default: from the residuals).
    out : str or Path, optional
        New .yaml file for the identified rig. ``assumed`` of the result lists the values that the
        file takes from ``rig``.
    progress : Progress, optional
        Receiver of the progress.

    Returns
    -------
    RigFit or JumpFit
        Fit of a bag, or of a table.

    Raises
    ------
    BagError, ConfigError
        If the source cannot be read, or arguments cannot be combined.
    OutputError
        If ``out`` exists already, or cannot be written.

    Examples
    --------
    >>> import tempfile, cam_rig
    >>> table = "preload [N],jump speed [rpm]\n20,446.7\n40,469\n60,490.3\n"
    >>> with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
    ...     _ = file.write(table), file.flush()
    ...     known = {"spring_stiffness": 4030.0, "damping": 8.6}
    ...     fit = cam_rig.fit_rig(file.name, "poly345", rig="tm21", fix=known)
    >>> [number.name for number in fit.identified]
    ['mass']
    """
    target, bag = new_yaml(out), Path(source)
    fixed, cams = dict(fix or {}), resolve_cams([cam], rig)
    model = _check_arguments(model, fixed, tolerance)
    if bag.suffix.lower() in TABLES:
        _require_none("a table of jump speeds", topics=topics, namespace=namespace)
        law, table = _law_of(cams, one_cam), read_jump_table(bag)
        fit: JumpFit | RigFit = fit_jumps(law, table, cams.rig, model, fixed, tolerance, progress)
    else:
        _require_none("a bag", tolerance=tolerance)
        law, run = _read(bag, cams, one_cam, topics, namespace)
        fit = fit_run(law, run, cams.rig, model, fixed, progress)
    return fit if target is None else write_rig(target, fit, cams.rig, bag)


def _check_arguments(
    model: str | None, fixed: Mapping[str, float], tolerance: float | None
) -> str | None:
    """Check the arguments of a fit, and return the name of the model or None.

    Model names of older releases are converted to the present names. Raises a `ConfigError` for an
    unknown model, a tolerance (rpm) that is not positive, or an unknown parameter in ``fixed``.
    """
    name: str | None = present_model_name(model)
    if name is not None and name not in MODELS:
        raise ConfigError(f"--model must be {' or '.join(MODELS)}, got {model!r}")
    if tolerance is not None and not tolerance > 0.0:
        raise ConfigError(f"--tolerance must be above 0 rpm, got {tolerance:g}")
    for key in fixed:
        if key not in PARAMETERS:
            raise ConfigError(
                f"--fix: the parameter must be one of {', '.join(PARAMETERS)}, got {key!r}"
                f"{did_you_mean(key, list(PARAMETERS))}"
            )
    return name


def _read(
    bag: Path, cams: CamSet, one_cam: str | None, topics: str | None, namespace: str | None
) -> tuple[Law, MeasuredRun]:
    """Read the measured run of a bag, and return the law of its cam and the run.

    The signals are found by ``topics``, or by the ``namespace`` of a bag of this program.
    """
    with friendly_import_errors():
        from cam_rig.bag.foreign.topic_line import parse_topics
        from cam_rig.bag.measured_run import read_measured

    mapping = None if topics is None else parse_topics(topics)
    cam = one_cam or (next(iter(cams.laws)) if len(cams.laws) == 1 else None)
    if mapping is not None:
        _require_none("--topics", namespace=namespace)
        cam = _law_of(cams, one_cam).name
    run = read_measured(bag, mapping, cam, namespace)
    return _law_of(cams, run.cam), run


def _law_of(cams: CamSet, name: str | None) -> Law:
    """Return the law of the cam ``name``, or of the only cam if ``name`` is None.

    Raises a `ConfigError` if there is no such cam, or if several cams exist and none is named.
    """
    names = list(cams.laws)
    if name is None and len(names) > 1:
        raise ConfigError(f"the cam must be one of {', '.join(names)}; choose it with --cam")
    cam = name or names[0]
    if cam not in cams.laws:
        raise ConfigError(
            f"--cam must be one of {', '.join(names)}, got {cam!r}{did_you_mean(cam, names)}"
        )
    return cams.laws[cam]


def _require_none(source: str, **options: object) -> None:
    """Raise a `ConfigError` if an option is set that does not apply to the source.

    ``options`` are the values by option name, None if not set. ``source`` names the kind of
    measurement (bag or table) in the message.
    """
    for name, value in options.items():
        if value is not None:
            raise ConfigError(f"--{name} cannot be combined with {source}; leave it out")
