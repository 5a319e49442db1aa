"""Tables of the lessons whose steps are done on the drawing board, against the board's results."""

from __future__ import annotations

import re

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.kinetostatic import shaft_torque
from cam_rig.panel.board.board import Board
from cam_rig.panel.board.evaluation import evaluate_full
from cam_rig.units import RPM, TURN

from ..docs.conftest import DOCS, text

#: Lessons in English and in Spanish.
FOLDERS = ("course", "course/es")
RPM_OF_LESSONS = 300.0


def table_rows(folder, lesson, columns):
    """Return the rows of the tables of a lesson with a number of columns, by first cell.

    Cells that start with a number are numbers.
    """
    page = text(DOCS / folder / f"{lesson}.md").replace("−", "-")
    page = page.replace(",", ".") if folder.endswith("es") else page
    lines = [line for line in page.splitlines() if line.startswith("| ")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {
        first: [float(number[0]) if (number := re.match(r"-?[\d.]+", c)) else c for c in row]
        for first, *row in cells
        if len(row) == columns - 1
    }


def rounded(value, digits):
    return float(f"{value:.{digits}g}")


@pytest.fixture
def on_flywheel(tmp_path):
    """Drawing board with a flywheel of finite inertia."""
    return Board(cam_rig.load_cam("poly345"), cam_rig.load_rig("paper_flywheel"), tmp_path)


@pytest.mark.parametrize("folder", FOLDERS)
def test_the_peaks_of_lesson_1_are_those_of_the_board(board, folder):
    """Peaks and coefficients of the laws in lesson 1 are those that the board displays."""
    figures = board.evaluate_fast()["figures"]
    rows = table_rows(folder, "1_motion_laws", 6)
    units = ("s′, m/rad", "s″, m/rad²", "s‴, m/rad³")
    units = [unit if unit in rows else unit.replace(",", ".") for unit in units]
    for unit, peak in zip(units, figures["peaks"], strict=True):
        expected = []
        for place in ("largest", "least"):
            expected += [rounded(peak[place]["value"], 6), rounded(peak[place]["angle_deg"], 5)]
        assert rows[unit] == [*expected, rounded(peak["coefficient"], 5)]
    names = {title: name for name, title in board.page_data()["cams"].items()}
    laws = table_rows(folder, "1_motion_laws", 5)
    laws = {
        title.replace(".", ","): row for title, row in laws.items() if row[-1] in ("C1", "C2", "C3")
    }
    assert len(laws) == 5
    for title, row in laws.items():
        shown = board.second_law(names[title])["figures"]
        coefficients = [rounded(peak["coefficient"], 5) for peak in shown["peaks"]]
        assert row == [*coefficients, f"C{shown['continuity']}"], title


@pytest.mark.parametrize("folder", FOLDERS)
def test_the_radii_of_lesson_2_are_those_of_the_board(board, folder):
    """The least radii of curvature in lesson 2 are those that the board displays."""
    board.choose("flat", None)
    rows = table_rows(folder, "2_size_of_a_cam", 3)
    rows = {first: row for first, row in rows.items() if first.endswith(" mm")}
    assert list(rows) == ["4 mm", "7 mm", "22 mm"]
    for first, (radius, result) in rows.items():
        board.update(board.ordinates.tolist(), RPM_OF_LESSONS, float(first.split()[0]))
        full = evaluate_full(board.cam, board.law(), board.rig, RPM_OF_LESSONS)
        convex = next(c for c in full["checks"] if c["title"] == "convex radius of curvature")
        assert radius == rounded(convex["value"], 5)
        assert convex["passed"] == (result in ("ok", "bien"))
        assert full["can_be_made"] == (result not in ("undercut", "rebaje"))


@pytest.mark.parametrize("folder", FOLDERS)
def test_the_torques_of_lesson_5_are_those_of_the_board(on_flywheel, folder):
    """Torque, twist and speed fluctuation in lesson 5 are those that the board displays."""
    board, speed = on_flywheel, RPM_OF_LESSONS * RPM
    names = {title: name for name, title in board.page_data()["cams"].items()}
    rows = table_rows(folder, "5_torsion", 6)
    rows = {title: row for title, row in rows.items() if title in names}
    assert len(rows) == 3
    for title, row in rows.items():
        board.choose(names[title], None)
        law, follower = board.law(), FollowerParameters.from_rig(board.rig)
        angles = np.linspace(0.0, TURN, 720, endpoint=False)  # those that the page draws
        torque = [shaft_torque(law, follower, angle, speed) for angle in angles.tolist()]
        shaft = evaluate_full(board.cam, law, board.rig, RPM_OF_LESSONS)["shaft"]
        expected = [rounded(x, 3) for x in (max(torque), min(torque), sum(torque) / len(torque))]
        expected += [rounded(shaft["twist_deg"]["value"], 4)]
        assert row == [*expected, rounded(shaft["fluctuation_percent"]["value"], 3)], title
