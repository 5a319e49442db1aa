"""The board without HTTP: what it takes, what it says of a law, and the files it saves."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError, LawError, RefusedError
from cam_rig.panel.board.board import MAX_RPM, Board
from cam_rig.panel.board.drawable import at_rest, file_jump, level
from cam_rig.schema import CamConfig
from cam_rig.units import RPM


def with_one_moved(board: Board, lifts: float) -> list[float]:
    """The ordinates, one in the middle of the rise moved."""
    ordinates = board.ordinates.tolist()
    ordinates[board.drawn.handles[7].index] += lifts
    return ordinates


def test_a_page_gets_what_json_can_carry(board: Board) -> None:
    """No infinity, no array: the rig's weights in SI, and a number for every handle."""
    page = json.loads(json.dumps(board.page(), allow_nan=False))
    assert page["rig"]["mass"] == cam_rig.load_rig("paper_table2").follower.mass.si
    assert len(page["handles"]) == 30
    assert page["drawn_as"] == {"degree": 5, "exact": True}
    assert page["start_made"]


def test_a_change_moves_free_ordinates_alone(board: Board) -> None:
    """The ends of segments stay, whatever a page sends."""
    start = board.ordinates
    board.take([x + 0.01 for x in start.tolist()], 450)
    free = [handle.index for handle in board.drawn.handles]
    moved = np.flatnonzero(board.ordinates != start)
    assert moved.tolist() == free
    assert board.rpm == 450.0


@pytest.mark.parametrize(
    "ordinates", [None, [], [0.0] * 41, ["0"] * 42, [True] * 42, [math.nan] * 42, [101.0] * 42]
)
def test_wrong_ordinates_are_refused_and_change_nothing(board: Board, ordinates: object) -> None:
    """What a page sends is not trusted."""
    before, version = board.ordinates, board.version
    with pytest.raises(RefusedError, match="ordinates: allowed"):
        board.take(ordinates, 300)
    assert board.ordinates is before
    assert board.version == version


@pytest.mark.parametrize("rpm", [None, "300", True, 0, -1, math.inf, math.nan, 2 * MAX_RPM])
def test_wrong_speeds_are_refused(board: Board, rpm: object) -> None:
    """From 1 to 1e5 rpm, as a number."""
    with pytest.raises(RefusedError, match="rpm: is"):
        board.take(board.ordinates.tolist(), rpm)
    assert board.version == 0


def test_what_is_said_at_once_is_the_cores(board: Board) -> None:
    """Rigid jump speed and contour are those of the law that `build_law` makes of the file."""
    board.take(with_one_moved(board, 0.01), 300)
    law = cam_rig.build_law(cam_rig.load_cam(board.save("moved", board.ordinates.tolist())))
    rig = cam_rig.load_rig("tm21").with_follower(
        **{
            key: getattr(board.rig.follower, key).si
            for key in ("mass", "spring_stiffness", "damping", "preload", "stem_stiffness")
        }
    )  # without the split of the mass its follower is one rigid mass
    found = board.at_once()
    assert found["faults"] == []
    assert found["jump_rigid"]["value"] == pytest.approx(cam_rig.jump_speed(law, rig).rpm, rel=1e-9)
    points = np.array(found["discs"][0]["points"])
    contour = cam_rig.contour(cam_rig.load_cam(board.out / "moved.yaml"), points=360)
    assert np.abs(points - 1e3 * np.stack([contour.x, contour.y])).max() <= 1e-4


def test_what_is_said_at_rest_is_the_cores(board: Board) -> None:
    """Jump speed of two masses, residual vibration, level, each by its own command's function."""
    law = board.law()
    found = at_rest(board.cam, law, board.rig, 300.0)
    assert found["jump"]["value"] == pytest.approx(cam_rig.jump_speed(law, board.rig).rpm)
    motion = cam_rig.simulate(law, board.rig, rpm=300, turns=6)
    assert found["level_db"]["value"] == pytest.approx(
        cam_rig.sound_level(motion).level_db, abs=0.01
    )
    assert found["residual_um"]["value"] > 0.0
    assert found["checks"] == []


def test_the_level_goes_on_where_contact_is_lost(board: Board) -> None:
    """Above the jump speed the landings are heard: it is simulated, not held on the cam."""
    rpm = 1.1 * board.at_once()["jump_rigid"]["value"]
    jumping = cam_rig.simulate(board.law(), board.rig, rpm=rpm, turns=6)
    held = cam_rig.simulate(board.law(), board.rig, model="kinetostatic", rpm=rpm, turns=6)
    found = level(board.law(), board.rig, rpm)
    assert found == cam_rig.sound_level(jumping).level_db
    assert found > cam_rig.sound_level(held).level_db + 0.5


def test_an_undercut_law_is_a_fault_with_its_angle(board: Board) -> None:
    """At once by the contour as it is drawn, at rest by the checks of `cam-rig profile`."""
    board.take(with_one_moved(board, 0.5), 300)
    found = board.at_once()
    keys = {fault["key"]: fault["angle_deg"] for fault in found["faults"]}
    assert keys["undercut"] == pytest.approx(92.0, abs=4.0)
    assert found["discs"][0]["undercut"]
    checks = at_rest(board.cam, board.law(), board.rig, 300.0)["checks"]
    assert any("convex radius of curvature" in words for words in checks)


def test_a_follower_out_of_reach_is_a_fault_in_words(tmp_path: Path) -> None:
    """Where there is no contour, the reason is all there is."""
    cam = cam_rig.load_cam("oscillating_roller")
    short = cam.follower.model_copy(update={"arm": cam.lift})  # 20 mm, and the pivot is 90 mm away
    board = Board(cam.model_copy(update={"follower": short}), cam_rig.load_rig("tm21"), tmp_path)
    found = board.at_once()
    assert found["discs"] == []
    assert [fault["key"] for fault in found["faults"]] == ["error"]
    assert "out of reach" in found["faults"][0]["words"]
    assert at_rest(board.cam, board.law(), board.rig, 300.0)["checks"]


@pytest.mark.parametrize("rpm", [1.0, MAX_RPM])
def test_the_slowest_and_the_fastest_speed_have_numbers_or_words(board: Board, rpm: float) -> None:
    """At either end of the knob there is an answer."""
    found = at_rest(board.cam, board.law(), board.rig, rpm)
    for key in ("jump", "residual_um", "level_db"):
        (kind,) = found[key]
        assert kind in ("value", "words")
    assert "value" in found["jump"]
    json.dumps(found, allow_nan=False)


def test_a_stand_in_is_told_with_the_files_own_jump_speed() -> None:
    """That of the law in the file, not of what is drawn for it."""
    rig = cam_rig.load_rig("paper_table2")
    cam = cam_rig.load_cam("trigonometric")
    wanted = cam_rig.jump_speed(cam_rig.build_law(cam), rig).rpm
    assert file_jump(cam, rig)["value"] == pytest.approx(wanted)


def test_another_law_is_a_shipped_cams(board: Board) -> None:
    """By its name, and by nothing that looks like a path."""
    assert board.other("cycloidal")["name"] == "cycloidal"
    for name in ("nobody", "../rigs/tm21", ""):
        with pytest.raises((ConfigError, LawError)):
            board.other(name)


def test_a_speed_is_in_rpm(board: Board) -> None:
    """The jump speed found is where the least force is zero."""
    law, rig = board.law(), board.rig.follower
    speed = board.at_once()["jump_rigid"]["value"] * RPM
    s, slope, bend = law.motion_at(np.linspace(0.0, 2.0 * np.pi, 20001))
    force = rig.mass.si * bend * speed**2 + rig.damping.si * slope * speed
    force += rig.spring_stiffness.si * s + rig.preload.si
    assert abs(force.min()) <= 1e-3 * force.max()


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", ["poly345", "bezier15", "flat", "conjugate", "oscillating_point"])
def test_any_law_that_a_page_may_draw_has_an_answer(tmp_path: Path, name: str) -> None:
    """Numbers or words, and nothing that JSON does not have, however wild the law."""
    board = Board(cam_rig.load_cam(name), cam_rig.load_rig("tm21"), tmp_path)
    random = np.random.default_rng(5)
    for size in (1e-9, 1e-3, 0.1, 1.0, 10.0, 90.0) * 3:
        moved = board.drawn.ordinates + size * random.uniform(-1.0, 1.0, board.ordinates.size)
        board.take(np.clip(moved, -100.0, 100.0).tolist(), 300)
        found = board.at_once()
        json.dumps(found, allow_nan=False)
        assert found["discs"] or found["faults"]
        json.dumps(board.page(), allow_nan=False)


def test_a_law_whose_velocity_jumps_is_drawn_and_its_jump_speed_says_why(tmp_path: Path) -> None:
    """Its contour is there; no follower stays on it at any speed."""
    cam = cam_rig.load_cam("bezier15").model_dump(exclude_none=True)
    half = {"assumed": 180.0, "unit": "deg", "source": "test"}
    rise = {"assumed": [0.0, 0.2, 0.6, 1.0], "unit": "1", "source": "test"}
    fall = {"assumed": [1.0, 0.6, 0.2, 0.0], "unit": "1", "source": "test"}
    cam["segments"] = [
        {"law": "bezier", "span": half, "ordinates": rise},
        {"law": "bezier", "span": half, "ordinates": fall},
    ]
    board = Board(CamConfig.model_validate(cam), cam_rig.load_rig("tm21"), tmp_path)
    assert len(board.drawn.handles) == 4
    found = board.at_once()
    assert found["discs"]
    assert "velocity" in found["jump_rigid"]["words"]
