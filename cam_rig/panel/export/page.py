"""File of the static drawing board, with the data of its cams and rigs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cam_rig.files import write_new
from cam_rig.laws import Law, build_law
from cam_rig.panel.bench.drawing import follower_picture
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.figures import find_rise
from cam_rig.panel.board.pages import COLOURS
from cam_rig.panel.export.bundle import bundle_page
from cam_rig.panel.server import STATIC, languages, require_language
from cam_rig.profile.cam_checks import max_pressure_angle
from cam_rig.profile.disc import discs
from cam_rig.profile.outlines import follower_shape
from cam_rig.schema import CamConfig

#: Name of the exported file.
FILE = "drawing_board.html"
#: Module of the page that needs a server, and its replacement on the static page.
REPLACED = {"board/connection.js": "board/local.js"}
#: Fields of the board's data that do not depend on the cam.
COMMON = ("rigs", "cams", "rpm", "rpm_range")
#: Sizes of a follower that are 0 if its type or its file does not have them.
ZERO_SIZES = (
    "base_radius",
    "roller_radius",
    "eccentricity",
    "inclination",
    "arm",
    "pivot_distance",
    "face_offset",
)
#: Sizes of a follower that have a default other than 0, or None.
DEFAULT_SIZES = ("roller_distance", "arms_angle")


def export_board(folder: Path, board: Board, language: str | None) -> Path:
    """Write the static drawing board into a folder, and return the path of the file.

    It contains all cams and rigs of a board, and opens with the present ones. If `language` is
    None, the page has the language of the browser.

    Raises
    ------
    OutputError
        If the file exists or cannot be written.
    """
    require_language(language)
    write_new(folder, {FILE: bundle_page("board/index.html", page_data(board, language), REPLACED)})
    return folder / FILE


def page_data(board: Board, language: str | None) -> dict[str, Any]:
    """Return the JSON data of the static page."""
    first, cams, rigs = {"cam": board.file.name, "rig": board.rig.name}, {}, {}
    for name in board.rigs:
        board.choose(None, name)
        rigs[name] = board.page_data()["rig"]
    for name, cam in board.cams.items():
        board.choose(name, None)
        data = board.page_data()
        common = {key: data[key] for key in COMMON} | {"colours": COLOURS}
        own = {key: value for key, value in data.items() if key not in (*COMMON, "rig")}
        cams[name] = own | {"static": core_data(board, cam)}
    texts = [path for name in ("texts", "errors") for path in sorted(STATIC.glob(f"{name}/*.json"))]
    return {
        "languages": {"language": language, "languages": languages(), "pages": []},
        "texts": {
            path.relative_to(STATIC).as_posix(): json.loads(path.read_text("utf-8"))
            for path in texts
        },
        "board": common,
        "cams": cams,
        "rigs": rigs,
        "first": first,
    }


def core_data(board: Board, cam: CamConfig) -> dict[str, Any]:
    """Return the data of a cam from which a page computes contour and figures.

    ``second`` is the law of the file, for comparison with other cams.
    """
    law, rise = board.law(), find_rise(cam, build_law(cam))
    return {
        "follower": follower_sizes(cam, law),
        "picture": follower_picture(cam, law, follower_shape(cam, law)),
        "rise": None if rise is None else vars(rise),
        "second": board.second_law(cam.name),
    }


def follower_sizes(cam: CamConfig, law: Law) -> dict[str, Any]:
    """Return the type and the sizes (m, rad) of a cam's follower, and its limits.

    A size that the type of follower does not have is 0, or None if it has a default.
    ``allowed_pressure`` is the largest pressure angle.
    """
    follower = cam.follower
    sizes = {name: getattr(follower, name, None) for name in (*ZERO_SIZES, *DEFAULT_SIZES)}
    values = {name: None if size is None else size.si for name, size in sizes.items()}
    allowed = max_pressure_angle(follower, discs(follower, law)[0].element)
    zeros = {name: values[name] or 0.0 for name in ZERO_SIZES}
    return {"type": follower.type, "allowed_pressure": allowed} | values | zeros
