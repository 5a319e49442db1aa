"""Choices and figures of the drawing board without HTTP.

Cam, rig and base radius are chosen. The board reports peaks, checks and the vibration of the shaft.
"""

import json
import math

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, RefusedError
from cam_rig.laws.catalogue import rise_figures
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.evaluation import evaluate_full
from cam_rig.panel.board.figures import find_rise, law_figures
from cam_rig.profile.read_dxf import read_dxf

from .conftest import BOARD, received, with_moved_ordinate


def test_a_page_chooses_cam_and_rig(board):
    """A chosen rig keeps the drawing, and a chosen cam starts from its file.

    An unknown name is refused, and the board does not change. An opened cam can be chosen.
    """
    moved = with_moved_ordinate(board, 0.05)
    board.update(moved, 400, 60.0)
    board.choose(None, "paper_flywheel")
    assert board.rig.name == "paper_flywheel" and board.ordinates.tolist() == moved
    assert board.base_radius_mm == 60.0
    data = board.page_data()
    assert data["rig"]["has_shaft"] and data["rig"]["has_flywheel"]
    assert data["rigs"].keys() == {"paper_flywheel", "paper_table2", "tm21", "tm21_bouncing"}
    before = board.machine, board.version
    for cam, rig in (("nobody", None), ("flat", "nobody"), (3, None), ("../cams/flat", None)):
        with pytest.raises(ConfigError, match=r"is .*; allowed: "):
            board.choose(cam, rig)
    assert (board.machine, board.version) == before
    text = board.save("mine", moved).read_text(encoding="utf-8")
    board.choose("flat", None)
    assert board.base_radius_mm == pytest.approx(35.0) and board.cam.follower.type == "flat"
    board.open(text)
    board.choose("flat", "tm21")
    assert "mine" in board.page_data()["cams"] and not board.page_data()["rig"]["has_shaft"]
    board.choose("mine", None)
    assert board.ordinates.tolist() == pytest.approx(moved, abs=1e-15)


def test_every_shipped_cam_can_be_chosen(board):
    """Each shipped cam can be chosen, and has results that JSON can contain."""
    for name in board.page_data()["cams"]:
        board.choose(name, None)
        results = board.evaluate_fast()
        assert results["faults"] == [] and len(results["figures"]["peaks"]) == 3
        json.dumps(board.page_data() | results, allow_nan=False)


def test_the_design_command_contains_the_name_of_the_chosen_rig(tmp_path):
    """The design command names the rig as it was given, and a chosen rig by its name."""
    rig = cam_rig.load_rig("paper_table2")
    board = Board(cam_rig.load_cam("poly345"), rig, tmp_path, "my/rig.yaml")
    for chosen, expected in (("tm21", "tm21"), ("paper_table2", "my/rig.yaml")):
        board.choose(None, chosen)
        command = board.save_for_page(f"on_{chosen}", board.ordinates.tolist())["command"]
        assert f"--rig {expected} " in command


def test_coefficients_of_a_rise_are_those_of_the_list_of_laws():
    """The coefficients of cams with one named rise are those of `cam-rig laws`.

    The laws are those of the files, so only the rounding of roots differs.
    """
    names = {"poly345", "poly4567", "cycloidal", "modified_sine", "modified_trapezoid"}
    rises = {name: name for name in names} | {"simple_harmonic": "worked_example_harmonic"}
    for rise, name in rises.items():
        cam = cam_rig.load_cam(name)
        law = cam_rig.build_law(cam)
        figures, expected = law_figures(law, find_rise(cam, law)), rise_figures(rise)
        coefficients = [peak["coefficient"] for peak in figures["peaks"]]
        peaks = expected.peak_velocity, expected.peak_acceleration, expected.peak_jerk
        assert coefficients == pytest.approx(peaks, rel=1e-9), rise
        assert figures["continuity"] == expected.continuity


def test_peaks_of_a_drawn_law_are_its_largest_and_least_values(board):
    """The peaks bound all values of the derivatives, and the law has them at their angles.

    Random ordinates. Between samples at 0.02° the values change by less than 1 % of the range.
    """
    random = np.random.default_rng(3)
    angles = np.linspace(0.0, 2.0 * math.pi, 18001)
    for _ in range(5):
        moved = board.drawn.ordinates + 0.05 * random.uniform(-1.0, 1.0, board.ordinates.size)
        board.update(moved.tolist(), 300)
        law = board.law()
        for order, peak in enumerate(board.evaluate_fast()["figures"]["peaks"], start=1):
            values = law(angles, order)
            expected = values.max(), values.min()
            given = peak["largest"]["value"], peak["least"]["value"]
            assert given == pytest.approx(expected, abs=1e-2 * np.ptp(values))
            assert given[0] >= expected[0] - 1e-9 and given[1] <= expected[1] + 1e-9
            for value, place in zip(given, ("largest", "least"), strict=True):
                near = np.radians(peak[place]["angle_deg"]) + np.array([-1e-9, 1e-9])
                assert np.abs(law(near, order) - value).min() <= 1e-6 * np.ptp(values)


def test_a_cam_with_another_base_radius_is_that_of_the_library(board):
    """A changed base radius is in contour, checks, saved file and DXF.

    Invalid base radii are refused.
    """
    for name, base in (("poly345", 41.0), ("flat", 4.0), ("oscillating_roller", 31.0)):
        board.choose(name, None)
        ordinates = board.ordinates.tolist()
        board.update(ordinates, 300, base)
        results = board.evaluate_fast()
        assert results["follower"]["base"] == base
        cam = cam_rig.load_cam(board.save(f"{name}_small", ordinates))
        assert cam.follower.base_radius.si == pytest.approx(1e-3 * base, rel=1e-15)
        assert "from " + name in cam.follower.base_radius.source
        expected = cam_rig.contour(cam, points=360)
        points = np.array(results["discs"][0]["points"])
        assert np.abs(points - 1e3 * np.stack([expected.x, expected.y])).max() <= 1e-4
        shown = evaluate_full(board.cam, board.law(), board.rig, 300.0)["checks"]
        rows = cam_rig.check_contours(cam).cams[0].checks
        assert [check["title"] for check in shown] == [row.title for row in rows]
        texts = [(check["message"], str(row)) for check, row in zip(shown, rows, strict=True)]
        assert [one for one, _ in texts[1:]] == [other for _, other in texts[1:]]  # 0: rounding
        assert [check["passed"] for check in shown] == [row.passed for row in rows]
    board.choose("poly345", None)
    before = board.base_radius_mm, board.version
    for base in (0, -1, 2e4, "4", True, math.nan):
        with pytest.raises(RefusedError, match="base radius: is"):
            board.update(board.ordinates.tolist(), 300, base)
    assert (board.base_radius_mm, board.version) == before
    dxf = board.out / "small.dxf"
    dxf.write_text(board.dxf(board.ordinates.tolist(), 50.0), encoding="utf-8")
    (points,) = read_dxf(dxf).curves
    assert np.hypot(*points).min() == pytest.approx(0.05, abs=1e-6)


def test_the_shaft_is_that_of_the_vibration_study(board):
    """Twist and fluctuation equal `cam-rig vibration`, and exist only for a shaft.

    A speed at which they would take many seconds is refused.
    """
    random = np.random.default_rng(8)
    for rig in ("paper_table2", "paper_flywheel"):
        board.choose(None, rig)
        for rpm in (300.0, *random.uniform(100.0, 380.0, 2)):
            results = evaluate_full(board.cam, board.law(), board.rig, rpm)["shaft"]
            measured = cam_rig.vibration(board.cam, board.rig, rpm).rows[0].measured
            expected = {"twist_deg": {"value": pytest.approx(math.degrees(measured.twist))}}
            if rig == "paper_flywheel":
                percent = pytest.approx(100.0 * measured.fluctuation)
                expected["fluctuation_percent"] = {"value": percent}
            assert results == expected
    slow = evaluate_full(board.cam, board.law(), board.rig, 19.9)["shaft"]
    assert {value["message"] for value in slow.values()} == {"rpm: is 19.9; allowed: from 20 on"}
    board.choose(None, "tm21")
    assert evaluate_full(board.cam, board.law(), board.rig, 300.0)["shaft"] is None


def test_a_change_of_the_previous_cam_is_refused(served):
    """A page that was opened before another cam was chosen cannot change the new cam.

    The choice reloads all pages. The changes of a reloaded page are accepted.
    """
    board = served.board
    old = {"ordinates": with_moved_ordinate(board, 0.1), "rpm": 250}
    old |= {"generation": json.loads(served.get("/board"))["generation"]}
    with served.page(BOARD) as page:
        received(page, "changed")
        status, reply = served.send("/choose", {"cam": "flat", "rig": "tm21"})
        assert (status, reply) == (200, {"cam": "flat", "rig": "tm21"})
        received(page, "opened")
        page.send(json.dumps(old | {"number": 1}))
        assert "another cam or rig now" in received(page, "refused")["refused"]["message"]
        assert board.ordinates.tolist() == board.drawn.ordinates.tolist()
        new = {"generation": board.generation, "number": 2}
        page.send(json.dumps(old | new))
        assert received(page, "fast")["fast"]["number"] == 2
    status, reply = served.send("/choose", {"rig": "nobody"})
    assert status == 409 and reply["message"].startswith("rig: is 'nobody'; allowed: ")
