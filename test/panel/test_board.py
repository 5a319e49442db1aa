"""Drawing board of a motion law without HTTP: input, results and saved files.

The board edits a motion law by the ordinates of its curve, which a page moves by handles.
"""

import json
import math
import re
import shlex

import numpy as np
import pytest
from shapely import Point, Polygon

import cam_rig
from cam_rig.errors import ConfigError, MissingLibraryError, OutputError, ProfileError, RefusedError
from cam_rig.panel.board.board import MAX_RPM, Board
from cam_rig.panel.board.evaluation import evaluate_full, level
from cam_rig.profile.read_dxf import read_dxf
from cam_rig.schema.load import config_root
from cam_rig.schema.quantity import Quantity

from ..cli.conftest import done
from .conftest import with_moved_ordinate


def test_the_middle_of_the_start_can_be_moved_by_a_twentieth_of_its_lift(board):
    """Moving the middle of the start law by 5 % of the lift keeps the cam valid."""
    law, handle = board.drawn.start.law, board.drawn.handles[7]
    unit = board.drawn.ordinates.copy()
    unit[handle.index] += 1.0
    effect = float(board.law(unit)(handle.angle) - law(handle.angle)) / law.lift
    for change in (0.05, -0.05):
        board.update(with_moved_ordinate(board, change / effect), 300)
        assert board.evaluate_fast()["faults"] == []
        board.update(board.drawn.ordinates.tolist(), 300)


def test_a_change_moves_free_ordinates_alone(board):
    """A change from a page moves only the free ordinates.

    The ordinates at the ends of segments are kept, whatever the page sends.
    """
    start = board.ordinates
    board.update([x + 0.01 for x in start.tolist()], 450)
    free = [handle.index for handle in board.drawn.handles]
    moved = np.flatnonzero(board.ordinates != start)
    assert moved.tolist() == free
    assert board.rpm == 450.0


def test_invalid_values_are_refused_and_change_nothing(board):
    """Invalid ordinates or speeds are refused, and the board does not change.

    Each ordinate must be a finite number, and the speed 1 to 1e5 rpm.
    """
    before, version, count = board.ordinates, board.version, board.ordinates.size
    assert count == 42
    for invalid in ([0.0] * 41, ["0"] * 42, [True] * 42, [math.nan] * 42, [101.0] * 42, [], None):
        with pytest.raises(RefusedError, match="ordinates: allowed"):
            board.update(invalid, 300)
    for rpm in (None, "300", True, 0, -1, math.inf, math.nan, 2 * MAX_RPM):
        with pytest.raises(RefusedError, match="rpm: is"):
            board.update(before.tolist(), rpm)
    assert board.ordinates is before and board.version == version


def test_fast_results_are_those_of_the_library(board):
    """The immediate results equal jump speed and contour of the saved cam.

    They are those of a rigid follower, for which the library is the reference.
    """
    board.update(with_moved_ordinate(board, 0.01), 300)
    law = cam_rig.build_law(cam_rig.load_cam(board.save("moved", board.ordinates.tolist())))
    kinds = ("mass", "spring_stiffness", "damping", "preload", "stem_stiffness")
    numbers = {kind: getattr(board.rig.follower, kind).si for kind in kinds}
    # A rig without a mass share has a follower of one rigid mass.
    rig = cam_rig.load_rig("tm21").with_follower(**numbers)
    results = board.evaluate_fast()
    assert results["faults"] == []
    assert results["jump_rigid"]["value"] == pytest.approx(
        cam_rig.jump_speed(law, rig).rpm, rel=1e-9
    )
    points = np.array(results["discs"][0]["points"])
    contour = cam_rig.contour(cam_rig.load_cam(board.out / "moved.yaml"), points=360)
    assert np.abs(points - 1e3 * np.stack([contour.x, contour.y])).max() <= 1e-4


def test_full_results_are_those_of_the_library(board):
    """The complete results equal the jump speed and level of the library's functions."""
    law = board.law()
    results = evaluate_full(board.cam, law, board.rig, 300.0)
    assert results["jump"]["value"] == pytest.approx(cam_rig.jump_speed(law, board.rig).rpm)
    motion = cam_rig.simulate(law, board.rig, rpm=300, turns=6)
    assert results["level_db"]["value"] == pytest.approx(
        cam_rig.sound_level(motion).level_db, abs=0.01
    )
    assert results["residual_um"]["value"] > 0.0
    assert [check["message"] for check in results["checks"] if not check["passed"]] == []


def test_the_level_above_the_jump_speed_is_simulated(board):
    """Above the jump speed the level includes the noise of the landings."""
    rpm = 1.1 * board.evaluate_fast()["jump_rigid"]["value"]
    jumping_run = cam_rig.simulate(board.law(), board.rig, rpm=rpm, turns=6)
    contact_run = cam_rig.simulate(board.law(), board.rig, model="kinetostatic", rpm=rpm, turns=6)
    level_db = level(board.law(), board.rig, rpm)
    assert level_db == cam_rig.sound_level(jumping_run).level_db
    assert level_db > cam_rig.sound_level(contact_run).level_db + 0.5


def test_an_undercut_law_is_reported_as_a_fault(board, monkeypatch):
    """A law whose contour is undercut is reported with the angle, and has no DXF.

    A saved cam file states why the cam cannot be made.
    """
    ordinates = with_moved_ordinate(board, 0.5)
    saved = board.save_for_page("undercut", ordinates)
    assert cam_rig.load_cam(saved["path"]).cannot_be_made == saved["cannot_be_made"]
    assert re.search(r"radius of curvature is -.* at 9\d.*°; allowed", saved["cannot_be_made"])
    with pytest.raises(ProfileError, match="cannot be made: convex radius of curvature"):
        board.dxf(ordinates)
    board.update(ordinates, 300)
    results = board.evaluate_fast()
    keys = {fault["key"]: fault["angle_deg"] for fault in results["faults"]}
    assert keys["undercut"] == pytest.approx(92.0, abs=4.0)
    assert results["discs"][0]["undercut"]
    checks = evaluate_full(board.cam, board.law(), board.rig, 300.0)["checks"]
    failed = [check["title"] for check in checks if not check["passed"]]
    assert "convex radius of curvature" in failed

    board.update(board.drawn.ordinates.tolist(), 300)
    good = board.save_for_page("good", with_moved_ordinate(board, 0.05))
    assert good["cannot_be_made"] is cam_rig.load_cam(good["path"]).cannot_be_made is None
    monkeypatch.setattr("cam_rig.extras.find_spec", lambda _: None)
    with pytest.raises(MissingLibraryError, match=r"ezdxf is not installed: .*cam_rig\[cad\]"):
        board.dxf(board.drawn.ordinates.tolist())


def test_a_follower_out_of_reach_is_a_fault_without_a_contour(tmp_path):
    """A follower that does not reach the cam is reported, and there is no contour."""
    cam = cam_rig.load_cam("oscillating_roller")
    short = cam.follower.model_copy(update={"arm": cam.lift})  # 20 mm, with the pivot 90 mm away
    board = Board(cam.model_copy(update={"follower": short}), cam_rig.load_rig("tm21"), tmp_path)
    results = board.evaluate_fast()
    assert results["discs"] == [] and [fault["key"] for fault in results["faults"]] == ["error"]
    assert "out of reach" in results["faults"][0]["message"]
    full = evaluate_full(board.cam, board.law(), board.rig, 300.0)
    assert full["checks"] == [] and "out of reach" in full["check_error"]
    assert not full["can_be_made"]


def test_another_law_is_that_of_a_shipped_cam(board):
    """The law for comparison is selected by the name of a shipped cam.

    A path is refused, because a page must not read other files.
    """
    assert board.second_law("cycloidal")["title"] == cam_rig.load_cam("cycloidal").title
    for name in ("nobody", "../rigs/tm21", ""):
        with pytest.raises(ConfigError, match="cam: is"):
            board.second_law(name)


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", ["bezier15", "poly345", "flat", "oscillating_point", "conjugate"])
def test_any_law_that_a_page_may_draw_has_results(tmp_path, name):
    """Any ordinates that a page may send have results or faults that JSON can contain."""
    board = Board(cam_rig.load_cam(name), cam_rig.load_rig("tm21"), tmp_path)
    random = np.random.default_rng(5)
    for size in (1e-9, 1e-3, 0.1, 1.0, 10.0, 90.0):
        moved = board.drawn.ordinates + size * random.uniform(-1.0, 1.0, board.ordinates.size)
        board.update(np.clip(moved, -100.0, 100.0).tolist(), 300)
        results = board.evaluate_fast()
        json.dumps(results, allow_nan=False)
        assert results["discs"] or results["faults"]
        json.dumps(board.page_data(), allow_nan=False)


def test_extreme_speeds_and_a_velocity_jump_have_results(board, tmp_path):
    """There are complete results at the lowest and the highest speed of the knob.

    A law with a velocity jump has a contour, and a reason instead of a jump speed.
    """
    for rpm in (1.0, MAX_RPM):
        results = evaluate_full(board.cam, board.law(), board.rig, rpm)
        assert {*results["residual_um"], *results["level_db"]} <= {"value", "message"}
        assert "value" in results["jump"]
        json.dumps(results, allow_nan=False)
    corners = cam_rig.load_cam("worked_example_constant_velocity")
    results = Board(corners, cam_rig.load_rig("tm21"), tmp_path).evaluate_fast()
    assert results["discs"] and "velocity" in results["jump_rigid"]["message"]


# -- output of the board: cam files, contour as DXF, design command


def test_a_saved_file_contains_the_displayed_law(tmp_path):
    """The law of a saved cam file is the displayed law, with the same follower."""
    for name in ("poly345", "bezier15", "tm21", "measured", "conjugate"):
        cam = cam_rig.load_cam(name)
        board = Board(cam, cam_rig.load_rig("tm21"), tmp_path / name)
        ordinates = with_moved_ordinate(board, 0.0123456789, 3)
        path = board.save("drawn", ordinates)
        board.update(ordinates, 300)
        saved = cam_rig.load_cam(path)
        law, displayed = cam_rig.build_law(saved), board.law()
        assert np.abs(law.breaks - displayed.breaks).max() <= 1e-12
        assert np.abs(law.ordinates - displayed.ordinates).max() <= 1e-12 * displayed.lift
        assert saved.follower == cam.follower


def test_a_file_is_never_overwritten(board):
    """Saving under an existing name is refused, and the file is not changed."""
    path = board.save("mine", board.ordinates.tolist())
    before = path.read_bytes()
    with pytest.raises(OutputError, match="exists already"):
        board.save("mine", with_moved_ordinate(board, 0.1))
    assert path.read_bytes() == before


def test_a_cam_with_a_large_pressure_angle_can_be_made(tmp_path):
    """A cam that only exceeds its limit of the pressure angle can still be made.

    The failed check is reported.
    """
    cam = cam_rig.load_cam("poly345")
    strict = Quantity(given=1.0, unit="deg", source="test")
    follower = cam.follower.model_copy(update={"most_pressure_angle": strict})
    board = Board(cam.model_copy(update={"follower": follower}), cam_rig.load_rig("tm21"), tmp_path)
    assert board.save_for_page("steep", board.ordinates.tolist())["cannot_be_made"] is None
    results = evaluate_full(board.cam, board.law(), board.rig, 300.0)
    assert results["can_be_made"]
    assert [c["title"] for c in results["checks"] if not c["passed"]] == ["pressure angle"]


def test_the_dxf_is_the_contour_in_mm(board, tmp_path):
    """The exported DXF contains the displayed contour in mm, within 2 µm."""
    ordinates = with_moved_ordinate(board, 0.05)
    path = tmp_path / "cam.dxf"
    path.write_text(board.dxf(ordinates), encoding="utf-8")
    (points,) = read_dxf(path).curves
    board.update(ordinates, 300)
    displayed = np.array(board.evaluate_fast()["discs"][0]["points"])
    polygon = Polygon(1e3 * points.T)
    distances = [polygon.exterior.distance(Point(*point)) for point in displayed.T]
    assert max(distances) <= 2e-3  # 1 µm chord error plus rounding
    assert polygon.area == pytest.approx(Polygon(displayed.T).area, rel=1e-3)


@pytest.mark.long
def test_the_design_command_can_be_run(tmp_path):
    """The displayed `cam-rig design` command runs and increases the jump speed.

    It contains the start law and rig of the board, and quotes a folder with a space.
    """
    rig = "config/rigs/paper_table2.yaml"
    out = tmp_path / "my cams"
    board = Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), out, rig)
    reply = board.save_for_page("mine", board.ordinates.tolist())
    arguments = shlex.split(reply["command"])
    assert arguments[:3] == ["cam-rig", "design", reply["path"]]
    assert arguments[arguments.index("--rig") + 1] == rig
    assert arguments[arguments.index("--out") + 1] == str(out / "mine_designed.yaml")
    done(*arguments[1:], "--pieces", "4", "--joints", "C2")
    designed = cam_rig.load_cam(out / "mine_designed.yaml")
    start = cam_rig.jump_speed(board.law(), board.rig).rpm
    assert cam_rig.jump_speed(cam_rig.build_law(designed), board.rig).rpm > start


def test_an_invalid_cam_name_is_refused(board):
    """Saving under an invalid name is refused, and no file is written."""
    for name in ("", "../x", "A", "a/b", "a.yaml", "a" * 101, None, 3, "cam"):
        with pytest.raises(ConfigError, match="name"):
            board.save(name, board.ordinates.tolist())
    assert not board.out.exists()


def test_an_opened_file_is_the_loaded_file(board):
    """A cam file that is opened on a page gives the same board as its loaded cam.

    A text that is not a cam file is refused, and the board does not change.
    """
    paths = sorted((config_root() / "cams").glob("*.yaml"))
    opened = 0
    for path in paths[::4]:
        text = path.read_text(encoding="utf-8")
        if ".csv" in text:
            continue
        board.open(text)
        fresh = Board(cam_rig.load_cam(path), board.rig, board.out)
        assert board.file.name == fresh.file.name
        assert board.ordinates.tolist() == fresh.ordinates.tolist()
        assert board.evaluate_fast()["follower"] == fresh.evaluate_fast()["follower"]
        other = {"cams": None, "generation": None}
        assert board.page_data() | other == fresh.page_data() | other
        opened += 1
    assert opened > 4
    before = board.file, board.version
    for text in (None, "", "- 1", "name: x", "name: [", "é" * 9):
        with pytest.raises(cam_rig.CamRigError):
            board.open(text)
    assert (board.file, board.version) == before
