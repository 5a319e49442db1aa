"""Choice of cam and rig on the page of the drawing board, and its tables, in a real browser."""

import re

import numpy as np
import pytest

import cam_rig
from cam_rig.panel.board.board import START_RPM, Board
from cam_rig.panel.board.pages import BoardPages
from cam_rig.panel.server import serve

from .conftest import in_browser
from .test_board_page import BoardPage, library_curves

pytestmark = pytest.mark.slow


def test_a_student_chooses_cam_and_rig_and_sizes_the_cam(chromium, tmp_path):
    """Cam, rig and base radius are chosen on the page, and all results follow.

    Twist and speed fluctuation appear with a shaft and a flywheel, torque always. The base radius
    is reduced until the contour is undercut, and undo restores it.
    """
    board = Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_table2"), tmp_path)
    with serve(BoardPages(board)) as panel, in_browser(chromium, BoardPage) as page:
        page.open(panel.address)
        page.settled()
        check_shaft(page, board)
        page.choose("rig", "paper_flywheel")
        page.settled()
        assert page.page.evaluate("() => document.activeElement.id") == "rig"
        assert board.rig.name == "paper_flywheel"
        check_shaft(page, board)
        torque = library_curves(board, board.ordinates.tolist(), START_RPM)[5]
        numbers = [float(x) for x in re.findall(r"(-?[\d.]+) N·m", page.text("torques"))]
        expected = [torque.max(), torque.min(), torque.mean()]
        assert numbers == pytest.approx(expected, rel=5e-3)  # three digits
        page.choose("rig", "tm21")
        page.settled()
        assert "TM21" in page.text("rig_title") and page.page.locator("#twist_of").is_hidden()
        page.choose("cam", "flat")
        page.settled()
        assert page.text("title") == "Flat follower"
        reduce_base_radius(page, board)


def check_shaft(page, board):
    """Check twist and speed fluctuation on the page against `cam-rig vibration`."""
    measured = cam_rig.vibration("poly345", board.rig, START_RPM).rows[0].measured
    assert page.number("twist") == pytest.approx(np.degrees(measured.twist), rel=1e-3)
    if measured.fluctuation is None:
        assert page.page.locator("#fluctuation_of").is_hidden()
    else:
        assert page.number("fluctuation") == pytest.approx(100.0 * measured.fluctuation, rel=2e-3)


def reduce_base_radius(page, board):
    """Reduce the base radius of the cam flat until it is undercut, save it, and undo."""
    assert page.text("checks_title") == "Contour checks: all 6 ok"
    page.page.locator("#checks_title").click()
    for base, count in ((20, 6), (4, 5)):  # an undercut contour is not checked for crossings
        page.enter("base_radius", base)
        page.until(lambda b=base: board.base_radius_mm == b)
        page.settled()
        assert page.text("checks_title") == f"Contour checks: 2 of {count} fail"
        assert page.page.locator("#contour .mark").count() == (2 if base == 4 else 0)
    assert "-2.398" in page.page.locator("#checks .fault").first.inner_text()
    page.save("small")
    page.until(lambda: "Saved and marked" in page.text("status"))
    assert cam_rig.load_cam(board.out / "small.yaml").follower.base_radius.si == 0.004
    for base in (20.0, 35.0):
        page.page.locator("#undo").click()
        page.until(lambda b=base: board.base_radius_mm == pytest.approx(b))
    page.settled()
    assert page.text("checks_title") == "Contour checks: all 6 ok"


def test_peaks_of_two_laws_are_in_tables(chromium, board):
    """The peaks of the law and of a second law are in tables, with the titles of their cams."""
    with serve(BoardPages(board)) as panel, in_browser(chromium, BoardPage) as page:
        page.open(panel.address)
        page.settled()
        shown = page.page
        assert shown.locator("#second_peaks").is_hidden()
        shown.select_option("#second", label="Polynomial 4-5-6-7")
        shown.locator("#second_peaks").wait_for()
        rows = [
            shown.locator(f"#{name} tr").all_inner_texts() for name in ("peaks", "second_peaks")
        ]
        curvature = ["0.0686403", "56.081°", "-0.0686403", "123.92°", "5.7735"]
        assert rows[0][2].split("\t")[1:] == curvature
        assert [row.split("\t")[-1] for row in rows[1][1:]] == ["2.1875", "7.5132", "52.5"]
        captions = [
            shown.locator(f"#{name} caption").inner_text() for name in ("peaks", "second_peaks")
        ]
        assert captions == ["Polynomial 3-4-5: joints C2", "Polynomial 4-5-6-7: joints C3"]
        assert "Polynomial 4-5-6-7" in shown.locator("#key").inner_text()
