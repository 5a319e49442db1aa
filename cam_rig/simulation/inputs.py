"""Conversion of the arguments of a study to objects: cams, rig, scene and speeds.

The functions of ``import cam_rig`` and the commands of the same names accept the same forms: a
name, a path or an object.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cam_rig.arguments import check_arguments, to_vector
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.cam import CamSet, build_laws, law_of, require_sprung
from cam_rig.schema import CamConfig, RigConfig, load_cam, load_rig, load_scene, load_tables
from cam_rig.schema.load import (
    cam_path,
    config_root,
    find_scene,
    has_shipped_motion,
    resolve_path,
    resolve_rig_path,
    rig_path,
    rigs_next_to,
    tables_path,
)
from cam_rig.simulation.scene import LoadedScene, open_scene, speeds_of, spread_speeds
from cam_rig.units import FloatArray

#: One cam or several: names in ``config/cams``, paths or objects. One scene means its cams on its
#: rig. None means the five shipped cams with the laws in Table 2 of the study on which the project
#: is based.
Cams = str | Path | CamConfig | Sequence[str | Path | CamConfig] | None
#: A cam: a name in ``config/cams``, a path or an object.
Cam = str | Path | CamConfig
#: A motion law, or the cam that has it.
LawOrCam = Law | str | Path | CamConfig
#: A rig that must be given: a name in ``config/rigs``, a path or an object.
RequiredRig = str | Path | RigConfig
#: A rig: a name in ``config/rigs``, a path or a rig. None means the rig of the scene, or that of
#: `default_rig`.
Rig = str | Path | RigConfig | None
#: A scene: a name in ``config/scenes``, a path, or a result of `load_scene`.
Scene = str | Path | LoadedScene
#: One cam speed or several, rpm.
Speeds = float | Sequence[float] | FloatArray

#: Largest number of rigs that an error message lists. More would not fit in one line.
MAX_LISTED_RIGS = 5
#: Name of the shipped rig that is used if no rig is given or found for cams.
DEFAULT_RIG = "paper_table2"
#: Largest number of cam speeds that a study accepts. A longer table would take minutes and not be
#: readable.
MAX_SPEEDS = 1000
#: Lowest cam speed that is accepted, rpm: below the speed of any real cam.
MIN_RPM = 0.01
#: Highest cam speed that is accepted, rpm: above the speed of any real cam.
MAX_RPM = 1e5


def resolve_cams(cams: Cams = None, rig: Rig = None) -> CamSet:
    """Return cams with their laws on a rig.

    If `cams` is a scene, its cams and its rig are returned. None means the five shipped cams with
    the laws in Table 2 of the published study on which the project is based: bezier15, poly345,
    poly4567, cycloidal and bezier_segments. The default rig is that of `default_rig`.
    """
    items = to_cam_list(cams)
    if (scene := find_scene(items)) is not None:
        loaded = resolve_scene(scene, rig)
        return CamSet(loaded.cams, loaded.laws, loaded.rig)
    named = read_cams(items)
    sources = [source if isinstance(source, Path) else cam for source, cam in named]
    files = [source for source in sources if isinstance(source, Path)]
    configs, laws = build_laws(named)  # first, because a fault of a cam is the first to repair
    return CamSet(configs, laws, resolve_rig(default_rig(sources) if rig is None else rig, *files))


def to_cam_list(cams: Cams) -> list[str | Path | CamConfig]:
    """Return a single cam or several cams as a list, empty for None.

    Raises
    ------
    ConfigError
        If the sequence is empty.
    """
    if cams is not None and not isinstance(cams, str | Path | CamConfig) and not cams:
        raise ConfigError("cams: is an empty list; allowed: a cam, several, or None for Table 2's")
    return [cams] if isinstance(cams, str | Path | CamConfig) else list(cams or ())


def read_cams(cams: Sequence[str | Path | CamConfig]) -> list[tuple[Path | str, CamConfig]]:
    """Return each cam with its source: its file, or its name if it is a `CamConfig`.

    For an empty sequence, the five shipped cams with the laws in Table 2 of the paper are returned.
    """
    if not cams:
        cams = list(load_tables(tables_path()).table_2_jump)
    return [_read_cam(cam) for cam in cams]


def _read_cam(cam: Cam) -> tuple[Path | str, CamConfig]:
    if isinstance(cam, CamConfig):
        return cam.name, cam
    return cam_path(cam), load_cam(cam_path(cam))


def resolve_cam(cam: Cam) -> CamConfig:
    """Return a cam, read from its file if it is a path or a name."""
    return _read_cam(cam)[1]


def resolve_law(law: LawOrCam) -> Law:
    """Return a law, or the law of a cam.

    A cam must have a closing spring, which the dynamic models need.

    Raises
    ------
    ConfigError
        If the cam has a follower without a closing spring.
    LawError
        As `build_law`.
    """
    if isinstance(law, Law):
        return law
    source, cam = _read_cam(law)
    require_sprung(source, cam)
    return law_of(source, cam)


@check_arguments
def build_law(cam: Cam) -> Law:
    """Build the motion law of a cam.

    Parameters
    ----------
    cam : str, Path or Cam
        Cam by its name in ``config/cams``, its path, or as the object.

    Returns
    -------
    Law
        Law over one turn of the cam.

    Raises
    ------
    ConfigError
        If the file cannot be read.
    LawError
        If the segments do not join, the geometry of a segment does not exist, or the law does not
        have the lift of the file.

    Examples
    --------
    >>> import cam_rig
    >>> law = cam_rig.build_law("poly345")
    >>> round(law.lift, 6), float(law(0.0, 2))  # m, and m/rad² at cam angle 0
    (0.05, 0.0)
    """
    return law_of(*_read_cam(cam))


def resolve_rig(rig: RequiredRig, *cams: LawOrCam) -> RigConfig:
    """Return a rig, read from its file if it is a path or a name.

    A name is searched for next to the cams first, then among the shipped rigs.
    """
    if isinstance(rig, RigConfig):
        return rig
    files = [cam_path(cam) for cam in cams if isinstance(cam, str | Path)]
    return load_rig(resolve_rig_path(rig, *files))


def default_rig(cams: Sequence[Path | CamConfig], shipped: str = DEFAULT_RIG) -> Path:
    """Return the rig of cams for which neither a rig nor a scene is given.

    All commands and functions use this rule. It is the only rig next to the cams, in ``../rigs`` or
    in their folders, else the rig with the name of the cam. Shipped cams are on the rig `shipped`.
    The choice of another rig than `shipped` is printed.

    Raises
    ------
    ConfigError
        If the rule leaves several rigs or none: the message lists the rigs to choose from.
    """
    root = config_root().resolve()
    files = [
        cam for cam in cams if isinstance(cam, Path) and not cam.resolve().is_relative_to(root)
    ]
    names = {file.stem for file in files} | {
        cam.name for cam in cams if isinstance(cam, CamConfig) and not has_shipped_motion(cam)
    }
    if not names:
        return rig_path(shipped)
    rigs = rigs_next_to(*files)
    if len(rigs) == 1:
        _print_note(f"rig {rigs[0]}, the only one next to the cam; name a rig to use another")
        return rigs[0]
    named = [rig for rig in (*rigs, *_shipped_rigs()) if {rig.stem} == names]
    if named:
        _print_note(f"rig {named[0]}, with the name of the cam; name a rig to use another")
        return named[0]
    position = f"next to the cam are {len(rigs)} rigs" if rigs else "no rig is next to the cam"
    choices = [str(rig) for rig in rigs] or [rig.stem for rig in _shipped_rigs()]
    more = f" and {len(choices) - MAX_LISTED_RIGS} more" if len(choices) > MAX_LISTED_RIGS else ""
    raise ConfigError(
        f"{position}; allowed: name one of {', '.join(choices[:MAX_LISTED_RIGS])}{more}"
    )


def _shipped_rigs() -> list[Path]:
    return sorted((config_root() / "rigs").glob("*.yaml"))


def _print_note(text: str) -> None:
    # not `show.terminal`, which needs rich: the rig's packages do not import it
    print(text, file=sys.stderr)


def resolve_scene(scene: Scene, rig: Rig = None) -> LoadedScene:
    """Return a scene, read from its file if necessary, on its rig or on another rig.

    A rig that is a name is searched for next to the scene first, then among the shipped rigs.
    """
    loaded = scene if isinstance(scene, LoadedScene) else open_scene(resolve_path("scenes", scene))
    if rig is None:
        return loaded
    if isinstance(rig, RigConfig):
        return replace(loaded, rig=rig)
    file = resolve_rig_path(rig, loaded.scene_file)
    return replace(loaded, rig=load_rig(file), rig_file=file)


def resolve_speeds(rpm: Speeds, name: str = "rpm") -> list[float]:
    """Return a single speed or several speeds (rpm) as a list.

    `name` is the name of the argument in error messages.
    """
    return [float(speed) for speed in to_vector(name, rpm)]


def check_speeds(rpm: Speeds) -> list[float]:
    """Return speeds (rpm) after checking their number and range.

    Raises
    ------
    ConfigError
        If there are not 1 to `MAX_SPEEDS` speeds, or a speed is outside `MIN_RPM` to
        `MAX_RPM`.
    """
    speeds = resolve_speeds(rpm)
    wrong = [speed for speed in speeds if not MIN_RPM <= speed <= MAX_RPM]
    if wrong or not 1 <= len(speeds) <= MAX_SPEEDS:
        value = f"is {wrong[0]:g} rpm" if wrong else f"are {len(speeds)}"
        limits = f"{MIN_RPM:g} to {MAX_RPM:g} rpm"
        raise ConfigError(f"rpm: {value}; allowed: 1 to {MAX_SPEEDS} speeds, {limits}")
    return speeds


def scene_speeds(scene: str | Path, max_count: int) -> list[float]:
    """Return up to `max_count` speeds (rpm) of a scene, with lowest and highest."""
    return spread_speeds(speeds_of(load_scene(resolve_path("scenes", scene))), max_count)


def parse_numbers(text: str) -> list[float]:
    """Return the numbers in a text, or an empty list if it has another form.

    The forms are "0.5", "0.3,0.5", and "0:0.9:0.1" (start, end and step, with the end included).
    """
    try:
        if ":" in text:
            low, high, step = map(float, text.split(":"))
            count = math.floor((high - low) / step + 1e-9) + 1
            return [low + i * step for i in range(min(count, MAX_SPEEDS + 1))]
        return sorted({float(word) for word in text.split(",")})
    except (ValueError, ZeroDivisionError, OverflowError):
        return []


def parse_speeds(text: str, option: str = "--rpm") -> list[float]:
    """Return the cam speeds (rpm) in a text such as "300", "200,300" or "200:400:10".

    `option` is the name of the option in the error message.

    Raises
    ------
    ConfigError
        If the text has another form, or there are too many speeds or a speed out of range.
    """
    speeds = parse_numbers(text)
    in_range = speeds and 0.0 < min(speeds) <= max(speeds) <= MAX_RPM
    if not (in_range and len(speeds) <= MAX_SPEEDS):
        raise ConfigError(
            f"{option} {text}: allowed: 300, or 200,300, or 200:400:10 (from:to:step), each above "
            f"0 and at most {MAX_RPM:g}, {MAX_SPEEDS} speeds at most"
        )
    return speeds
