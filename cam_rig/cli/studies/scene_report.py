"""The page of one's own scene, for cam-rig report."""

from __future__ import annotations

import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cam_rig.cli.common.console import console
from cam_rig.cli.common.names import DEFAULT_SCENE
from cam_rig.extras import source_date

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cam_rig.report.document import Made
    from cam_rig.report.scene.results import SceneFindings
    from cam_rig.simulation.loaded_scene import LoadedScene


def page_made(scene: str, options: Mapping[str, object]) -> Made:
    """How a page is made: the command with those options that are given, the date, the versions.

    A page of Markdown lies beside what it is made of, in version control: its date is not today's
    but that of SOURCE_DATE_EPOCH, if that is set, so that it differs only where its numbers do.

    Raises
    ------
    ConfigError : SOURCE_DATE_EPOCH is no date
    """
    from cam_rig.report.document import Made, written_on

    epoch, words = source_date(), ["cam-rig", "report"]
    if scene != DEFAULT_SCENE:
        words.append(_from_here(scene))
    for option, given in options.items():
        words += [] if given is None else [option, _from_here(str(given))]
    dated = epoch is not None or str(options["--out"]).lower().endswith(".html")
    seconds = time.time() if epoch is None else epoch
    return Made(shlex.join(words), written_on(seconds) if dated else "")


def _from_here(given: str) -> str:
    """A path as a page may show it: from the working folder on, or the file's name alone.

    Whose folders are around it is nobody's business who reads the page.
    """
    path = Path(given)
    if not path.is_absolute():
        return given
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else path.name


def scene_page(
    loaded: LoadedScene, bag: Path | None, out: Path, made: Made
) -> tuple[str, dict[str, Any]]:
    """The page as text, HTML or Markdown by ``out``, and its findings as plain data.

    Raises
    ------
    CamRigError : the bag is not of the scene
    """
    from cam_rig.report.scene import page
    from cam_rig.report.scene.figures import figures
    from cam_rig.report.scene.results import find_scene

    with console.status("") as status:
        found = find_scene(loaded, bag, status.update)
        status.update("the page")
        if out.suffix.lower() == ".html":
            return page.html(found, figures(found), made), to_json(found)
        return page.markdown(found, made), to_json(found)


def to_json(found: SceneFindings) -> dict[str, Any]:
    """Every part as its own command writes it, by the name of the command."""
    from cam_rig.studies.jump import tables as jump
    from cam_rig.studies.orders import tables as orders
    from cam_rig.studies.vibration import tables as vibration

    return {
        "simulate": [row.plain() for row in found.run.by_speed],
        "jump": jump.to_json(found.jumps, found.loaded.rig.name, found.follower),
        "vibration": None if found.vibration is None else vibration.to_json(found.vibration),
        "orders": orders.to_json(found.orders),
        "calibrated": found.loaded.calibrated,
        "refused": found.refused,
    }
