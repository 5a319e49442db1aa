"""A cam file as a rig can use it: its law, and the refusal of a follower no model knows."""

from __future__ import annotations

from pathlib import Path

from cam_rig.errors import ConfigError, LawError
from cam_rig.laws import Law, build_law
from cam_rig.schema import CamConfig


def require_sprung(path: Path, cam: CamConfig) -> None:
    """Refuse a cam whose follower the dynamic models do not know.

    Raises
    ------
    ConfigError : the cam moves it both ways
    """
    if not cam.follower.sprung:
        raise ConfigError(
            f"{path}: follower.type is {cam.follower.type!r}; allowed on a rig: one that a closing "
            "spring alone holds on the cam (the dynamic models know no second contact)"
        )


def law_of(path: Path, cam: CamConfig) -> Law:
    """The law of a cam file, its errors with the file's name.

    Raises
    ------
    LawError : its segments do not join
    """
    try:
        return build_law(cam)
    except LawError as error:
        raise LawError(f"{path}: {error}") from None
