"""Cams that are asked for by name, file or scene, each with the checks of its contour."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cam_rig.arguments import checked
from cam_rig.errors import ConfigError, LawError, ProfileError
from cam_rig.laws import build_law
from cam_rig.profile.check_table import CheckedCam, ProfileResult
from cam_rig.schema import CamConfig, load, load_cam


@checked
def check_contours(
    cams: str | Path | CamConfig | Sequence[str | Path | CamConfig] = (), *, every: bool = False
) -> ProfileResult:
    """The checks of cams' contours: undercut, curvature, pressure angle, reach.

    `contour` is one cam's shape, point by point.

    The command is ``cam-rig profile``.

    Parameters
    ----------
    cams : a cam: a name, a path, or what `load_cam` gave; or several; or one scene, for its cams
    every : all cams of ``config/cams`` too

    Raises
    ------
    ConfigError : no cam, or an unknown one; LawError, ProfileError : one that cannot be at all

    Examples
    --------
    >>> import cam_rig
    >>> found = cam_rig.check_contours(["poly345", "flat"])
    >>> [(one.cam.name, len(one.failed)) for one in found.cams]
    [('poly345', 0), ('flat', 0)]
    """
    asked = [cams] if isinstance(cams, str | Path | CamConfig) else cams
    return ProfileResult(tuple(checked_cams(asked, every)), expected=every)


def checked_cams(cams: Sequence[str | Path | CamConfig], every: bool) -> list[CheckedCam]:
    """Each cam and its checks."""
    found = []
    for one in _asked(cams, every):
        cam = one if isinstance(one, CamConfig) else load_cam(one)
        try:
            found.append(CheckedCam.of(cam, build_law(cam)))
        except (LawError, ProfileError) as error:
            name = cam.name if isinstance(one, CamConfig) else one
            raise type(error)(f"{name}: {error}") from None
    return found


def _asked(cams: Sequence[str | Path | CamConfig], every: bool) -> list[Path | CamConfig]:
    found: list[Path | CamConfig]
    if (scene := load.one_scene(cams)) is not None:
        library = load.Library.beside(scene)
        found = [library.path("cams", name) for name in load.load_scene(scene).cams]
    else:
        found = [one if isinstance(one, CamConfig) else load.cam_path(one) for one in cams]
    if every:
        found += sorted((load.config_root() / "cams").glob("*.yaml"))
    if not found:
        raise ConfigError("no cam is named; allowed: cam files, names in config/cams, or --all")
    return found
