"""What the board writes: cam files, the contour as DXF, the command that designs on."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from shapely import Point, Polygon
from typer.testing import CliRunner

import cam_rig
from cam_rig.cli.main import app
from cam_rig.errors import ConfigError, MissingLibraryError, OutputError, ProfileError
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.drawable import at_rest
from cam_rig.profile.drawing_files import read_dxf
from cam_rig.schema.quantity import Quantity

from .test_board import with_one_moved


@pytest.mark.parametrize("name", ["poly345", "bezier15", "tm21", "measured", "conjugate"])
def test_a_saved_file_is_the_law_on_the_page(tmp_path: Path, name: str) -> None:
    """`build_law` of the file gives the same ordinates, follower and spans."""
    cam = cam_rig.load_cam(name)
    board = Board(cam, cam_rig.load_rig("tm21"), tmp_path)
    first = board.drawn.handles[3].index
    ordinates = board.ordinates.tolist()
    ordinates[first] += 0.0123456789
    path = board.save("drawn", ordinates)
    board.take(ordinates, 300)
    saved = cam_rig.load_cam(path)
    law, wanted = cam_rig.build_law(saved), board.law()
    assert np.abs(law.breaks - wanted.breaks).max() <= 1e-12
    assert np.abs(law.ordinates - wanted.ordinates).max() <= 1e-12 * wanted.lift
    assert saved.follower == cam.follower


def test_a_file_is_never_overwritten(board: Board) -> None:
    """The second of the same name is refused, and the first stays as it was."""
    path = board.save("mine", board.ordinates.tolist())
    before = path.read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        board.save("mine", with_one_moved(board, 0.1))
    assert path.read_bytes() == before


def test_the_file_of_a_cam_that_cannot_be_made_says_so(board: Board) -> None:
    """With the check that fails, its angle and the remedy; undone, the file says nothing."""
    found = board.saved("undercut", with_one_moved(board, 0.5))
    cam = cam_rig.load_cam(found["path"])
    assert cam.cannot_be_made == found["why_not"]
    assert re.search(r"radius of curvature is -.* at 9\d.*°; allowed", found["why_not"])
    good = board.saved("good", with_one_moved(board, 0.05))
    assert good["why_not"] is None
    assert cam_rig.load_cam(good["path"]).cannot_be_made is None


def test_a_pressure_angle_alone_can_be_made(tmp_path: Path) -> None:
    """A bad cam is not one that cannot exist: what `cannot_be_made` says is of that alone."""
    cam = cam_rig.load_cam("poly345")
    strict = Quantity(given=1.0, unit="deg", source="test")
    follower = cam.follower.model_copy(update={"most_pressure_angle": strict})
    board = Board(cam.model_copy(update={"follower": follower}), cam_rig.load_rig("tm21"), tmp_path)
    assert board.saved("steep", board.ordinates.tolist())["why_not"] is None
    found = at_rest(board.cam, board.law(), board.rig, 300.0)
    assert found["made"]
    assert any("pressure angle" in words for words in found["checks"])


def test_the_dxf_is_the_contour_in_mm(board: Board, tmp_path: Path) -> None:
    """Every point of the drawing is on the exact contour, to 1e-6 mm, and none is missing."""
    ordinates = with_one_moved(board, 0.05)
    path = tmp_path / "cam.dxf"
    path.write_text(board.dxf(ordinates), encoding="utf-8")
    (points,) = read_dxf(path)
    board.take(ordinates, 300)
    wanted = np.array(board.at_once()["discs"][0]["points"])
    drawn = Polygon(1e3 * points.T)
    off = [drawn.exterior.distance(Point(*point)) for point in wanted.T]
    assert max(off) <= 2e-3  # 1 µm of chord, and the rounding of what is shown
    assert drawn.area == pytest.approx(Polygon(wanted.T).area, rel=1e-3)


def test_the_dxf_of_a_cam_that_cannot_be_made_is_refused(board: Board) -> None:
    """With what is wrong."""
    with pytest.raises(ProfileError, match="cannot be made: convex radius of curvature"):
        board.dxf(with_one_moved(board, 0.5))


def test_without_the_library_the_dxf_names_its_extra(
    board: Board, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In one line, as every command does."""
    monkeypatch.setattr("cam_rig.extras.find_spec", lambda _: None)
    with pytest.raises(MissingLibraryError, match=r"ezdxf is not installed: .*cam_rig\[cad\]"):
        board.dxf(board.ordinates.tolist())


@pytest.mark.long
def test_the_command_that_designs_on_is_one_that_can_be_typed(tmp_path: Path) -> None:
    """Words for a shell, also in a folder with a space; the start and the rig are the board's."""
    rig = "config/rigs/paper_table2.yaml"
    out = tmp_path / "my cams"
    board = Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), out, rig)
    found = board.saved("mine", board.ordinates.tolist())
    words = shlex.split(found["command"])
    assert words[:3] == ["cam-rig", "design", found["path"]]
    assert words[words.index("--rig") + 1] == rig
    assert words[words.index("--out") + 1] == str(out / "mine_designed.yaml")
    fewer = [*words[1:], "--pieces", "4", "--joints", "C2"]
    result = CliRunner().invoke(app, fewer)
    assert result.exit_code == 0, result.output
    designed = cam_rig.load_cam(out / "mine_designed.yaml")
    start = cam_rig.jump_speed(board.law(), board.rig).rpm
    assert cam_rig.jump_speed(cam_rig.build_law(designed), board.rig).rpm > start


@pytest.mark.parametrize("name", ["", "../x", "A", "a/b", "a.yaml", "a" * 101, None, 3, "cam"])
def test_a_name_that_no_cam_may_have_is_refused(board: Board, name: object) -> None:
    """Nothing is written, inside of the folder or outside."""
    with pytest.raises(ConfigError, match="name"):
        board.save(name, board.ordinates.tolist())
    assert not board.out.exists()
