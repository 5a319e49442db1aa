"""The cams that a study is asked for, and the rig they turn on: named, given, or those of a scene.

The functions of ``import cam_rig`` and the commands of their names ask alike.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cam_rig.arguments import on_one_axis
from cam_rig.errors import ConfigError
from cam_rig.laws.cam import CamSet, cam_set
from cam_rig.schema import CamConfig, RigConfig, load_cam, load_rig, load_scene, load_tables
from cam_rig.schema.load import (
    cam_path,
    config_root,
    named_path,
    one_scene,
    rig_beside,
    rig_path,
    tables_path,
)
from cam_rig.simulation.scene import LoadedScene, open_scene, speeds_of, spread
from cam_rig.units import FloatArray

#: A cam, or several: names in ``config/cams``, paths or cams; or one scene, for its cams on its
#: rig; None is for those of the paper's Table 2.
Cams = str | Path | CamConfig | Sequence[str | Path | CamConfig] | None
#: A rig: a name in ``config/rigs``, a path or a rig; None is the scene's, or the only one beside
#: the cams, else paper_table2.
Rig = str | Path | RigConfig | None
#: A scene: a name in ``config/scenes``, a path, or what `load_scene` gave.
Scene = str | Path | LoadedScene
#: A speed, or several, rpm.
Speeds = float | Sequence[float] | FloatArray

#: Rigs that are named, at most.
MOST_NAMED = 5
#: The rig of cams that are named without one.
RIG = "paper_table2"
#: Speeds at most: a table that nobody reads, minutes.
MAX_SPEEDS = 1000
#: As slow, and as fast, as any cam of a table, rpm.
SLOWEST_RPM, FASTEST_RPM = 0.01, 1e5


def asked_cams(cams: Cams = None, rig: Rig = None) -> CamSet:
    """Cams on a rig, each given or by file or name (None: Table 2), or those of one scene."""
    asked = listed(cams)
    if (scene := one_scene(asked)) is not None:
        loaded = asked_scene(scene, rig)
        return CamSet(loaded.cams, loaded.laws, loaded.rig)
    named = named_cams(asked)
    files = [where for where, _ in named if isinstance(where, Path)]
    return cam_set(named, asked_rig(own_rig(files) if rig is None else rig))


def listed(cams: Cams) -> list[str | Path | CamConfig]:
    """One cam or several as a list, which is empty of None alone."""
    if cams is not None and not isinstance(cams, str | Path | CamConfig) and not cams:
        raise ConfigError("cams: is an empty list; allowed: a cam, several, or None for Table 2's")
    return [cams] if isinstance(cams, str | Path | CamConfig) else list(cams or ())


def named_cams(cams: Sequence[str | Path | CamConfig]) -> list[tuple[Path | str, CamConfig]]:
    """Cams, each with its file, or its name where it is given; of none those of Table 2."""
    if not cams:
        cams = list(load_tables(tables_path()).table_2_jump)
    found: list[tuple[Path | str, CamConfig]] = []
    for one in cams:
        if isinstance(one, CamConfig):
            found.append((one.name, one))
        else:
            found.append((cam_path(one), load_cam(cam_path(one))))
    return found


def asked_rig(rig: str | Path | RigConfig) -> RigConfig:
    """A rig that is given, or by file or name."""
    return rig if isinstance(rig, RigConfig) else load_rig(rig_path(rig))


def own_rig(cams: Sequence[Path], otherwise: str = RIG) -> Path:
    """Return the only rig beside a user's cams, or a shipped one if there is none, and print it.

    Several rigs are refused: a file that is added must not change which one is used.
    """
    own = [cam for cam in cams if not cam.resolve().is_relative_to(config_root().resolve())]
    if not own:
        return rig_path(otherwise)
    folders = sorted({cam.parent.parent / "rigs" for cam in own})
    found = [file for folder in folders for file in sorted(folder.glob("*.yaml"))]
    if len(found) == 1:
        _say(f"rig {found[0]}, the only one beside the cam; another may be named")
        return found[0]
    if found:
        more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        names = ", ".join(map(str, found[:MOST_NAMED])) + more
        raise ConfigError(
            f"beside the cam there are {len(found)} rigs; allowed: one, named {names}"
        )
    _say(f"rig {otherwise}, a shipped one: beside the cam there is no rig; another may be named")
    return rig_path(otherwise)


def _say(words: str) -> None:
    print(words, file=sys.stderr)  # the terminal's own needs a library that the core has not


def asked_scene(scene: Scene, rig: Rig = None) -> LoadedScene:
    """A scene on its rig, or on another that is given, or by file, or name beside it or shipped."""
    loaded = scene if isinstance(scene, LoadedScene) else open_scene(named_path("scenes", scene))
    if rig is None:
        return loaded
    if isinstance(rig, RigConfig):
        return replace(loaded, rig=rig)
    file = rig_beside(rig, loaded.scene_file)
    return replace(loaded, rig=load_rig(file), rig_file=file)


def asked_speeds(rpm: Speeds) -> list[float]:
    """Speeds, rpm."""
    return [float(one) for one in on_one_axis("rpm", rpm)]


def speeds_within(rpm: Speeds) -> list[float]:
    """Speeds, rpm; refused where they are none, too many, too slow or too fast."""
    speeds = asked_speeds(rpm)
    wrong = [one for one in speeds if not SLOWEST_RPM <= one <= FASTEST_RPM]
    if wrong or not 1 <= len(speeds) <= MAX_SPEEDS:
        what = f"is {wrong[0]:g} rpm" if wrong else f"are {len(speeds)}"
        limits = f"{SLOWEST_RPM:g} to {FASTEST_RPM:g} rpm"
        raise ConfigError(f"rpm: {what}; allowed: 1 to {MAX_SPEEDS} speeds, {limits}")
    return speeds


def scene_speeds(scene: str | Path, most: int) -> list[float]:
    """So many of a scene's speeds (rpm) at most, the slowest and the fastest among them."""
    return spread(speeds_of(load_scene(named_path("scenes", scene))), most)


def numbers_in(text: str) -> list[float]:
    """Numbers of "0.5", "0.3,0.5" or "0:0.9:0.1", the last one included; none of another text."""
    try:
        if ":" in text:
            low, high, step = map(float, text.split(":"))
            count = math.floor((high - low) / step + 1e-9) + 1
            return [low + i * step for i in range(min(count, MAX_SPEEDS + 1))]
        return sorted({float(word) for word in text.split(",")})
    except (ValueError, ZeroDivisionError, OverflowError):
        return []


def speeds_in(text: str) -> list[float]:
    """Speeds in rpm of "300", "200,300" or "200:400:10", the last one included."""
    found = numbers_in(text)
    if not (found and 0.0 < min(found) <= max(found) <= FASTEST_RPM and len(found) <= MAX_SPEEDS):
        raise ConfigError(
            f"--rpm {text}: allowed: 300, or 200,300, or 200:400:10 (from:to:step), each above 0 "
            f"and at most {FASTEST_RPM:g}, {MAX_SPEEDS} speeds at most"
        )
    return found
