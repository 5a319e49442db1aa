"""cam-rig design: a file that runs, JSON, a picture, a design file, and refusals in a line."""

import json
from functools import partial

import numpy as np
import pytest

from cam_rig.laws import build_law
from cam_rig.laws.law import peak
from cam_rig.schema import load_cam
from cam_rig.studies.design import study

from ...cli import conftest as cli

SMALL = ("--minimise", "peak_jerk", "--pieces", "6", "--joints", "C2")
call, done, data_of = (partial(one, "design") for one in (cli.call, cli.done, cli.data_of))


def test_the_file_is_a_cam_with_the_values_of_the_table(tmp_path):
    """--out runs as a cam; JSON has start, result and bound in SI; the picture is one."""
    out, plot = tmp_path / "smooth.yaml", tmp_path / "smooth.png"
    data = data_of("poly345", *SMALL, "--out", out, "--plot", plot, "--csv", tmp_path / "a.csv")
    goal = data["measures"][0]
    law = build_law(load_cam(out))
    assert law.name == "smooth"
    assert goal["result"] == pytest.approx(abs(peak(law, 3).value), rel=1e-12)
    assert goal["bound"] <= goal["result"] < goal["start"]
    assert data["design"]["certified"]
    assert plot.read_bytes().startswith(b"\x89PNG")
    keys, row = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
    assert goal["unit"] == "m/rad^3"
    assert keys == "quantity,unit,start,result,bound,limit,active"
    assert row.startswith("peak_jerk,m/rad^3,")


def test_a_design_file_is_the_same_request(tmp_path):
    """Goal, limits and class in YAML give what the options give."""
    file = tmp_path / "asked.yaml"
    file.write_text(
        "start: poly345\nminimise: peak_jerk\nclass: {pieces: 6, joints: C2}\n", encoding="utf-8"
    )
    assert data_of(file)["measures"] == data_of("poly345", *SMALL)["measures"]
    both = call(file, "--minimise", "peak_jerk")
    assert both.exit_code == 2
    assert "has a goal and limits of its own" in both.stderr


LOCAL = ("--minimise", "shaft_torque@300rpm", "--pieces", "6")


@pytest.mark.parametrize(
    ("asked", "laws"), [(SMALL, 1), pytest.param(LOCAL, 3, marks=pytest.mark.long)]
)
def test_ctrl_c_keeps_the_best_law_so_far(tmp_path, monkeypatch, asked, laws):
    """Interrupted after some laws, each better: file, table and JSON are of the last; code 130."""
    solve, values = study.search_design, []

    def interrupted(cam, rig, request, name, told):
        def then_stop(file, value):
            told(file, value)
            values.append(value)
            if len(values) == laws:
                raise KeyboardInterrupt

        return solve(cam, rig, request, name, then_stop)

    monkeypatch.setattr(study, "search_design", interrupted)
    result = call("poly345", *asked, "--out", tmp_path / "kept.yaml", "--json", "-")
    assert result.exit_code == 130
    assert "without a bound" in result.stderr
    data = json.loads(result.stdout)
    found, goal = data["design"], data["measures"][0]
    assert (found["interrupted"], found["certified"], found["gap"]) == (True, False, None)
    assert goal["result"] < goal["start"]
    assert values == sorted(values, reverse=True)
    assert build_law(load_cam(tmp_path / "kept.yaml")).lift == pytest.approx(0.05, rel=1e-9)


def test_what_is_not_convex_says_local_and_has_no_bound(tmp_path):
    """In table, JSON and file, which is the same byte for byte with the same seed; a picture."""
    out, plot = tmp_path / "easy.yaml", tmp_path / "easy.png"
    goal = ["--minimise", "shaft_torque@250rpm", "--pieces", "1", "--degree", "8"]
    asked = [*goal, "--starts", "2", "--seed", "7", "--out", out, "--json", "-"]
    result = done("poly345", *asked, "--plot", plot)
    data = json.loads(result.stdout)
    found = data["design"]
    assert (found["starts"], found["seed"], found["certified"], found["gap"]) == (2, 7, False, None)
    assert 1 <= found["near"] <= 2
    assert data["measures"][0]["bound"] is None
    assert "local (2 starts, " in result.stderr
    text = out.read_text(encoding="utf-8")
    assert "seed 7, local (2 starts, " in text.splitlines()[0]
    assert "without a bound" in text.splitlines()[0]
    assert plot.read_bytes().startswith(b"\x89PNG")
    out.unlink()
    call("poly345", *asked)
    assert out.read_text(encoding="utf-8") == text


def test_events_share_what_dwells_leave(tmp_path):
    """--keep dwells,lift, and a limit on one event: the file's spans are the table's."""
    data = data_of(
        *("poly345", "--minimise", "peak_acceleration", "--pieces", "4", "--joints", "C1"),
        *("--keep", "dwells,lift", "--limit", "event_angle@1<=110deg", "--starts", "2"),
        *("--out", tmp_path / "moved.yaml"),
    )
    spans = [np.degrees(event["span"]) for event in data["events"]]
    assert spans == pytest.approx([110.0, 125.0], abs=1e-3)
    assert data["design"]["bound_at_these_events"] <= data["measures"][0]["result"]
    text = (tmp_path / "moved.yaml").read_text(encoding="utf-8")
    assert "dwells are the start's" in text and "found with the law" in text
    assert len(build_law(load_cam(tmp_path / "moved.yaml")).spans) == 4 + 4 + 3


POLY, SHARED = ("poly345", *SMALL), ("--keep", "dwells,lift")
TWO = ("--limit", "event_angle@1<=90deg", "--limit", "event_angle@2<=90deg")
SLOW = ("--limit", "peak_acceleration<=20mm/rad^2", "--starts", "1")
TORQUE = ("--limit", "shaft_torque@300rpm<=6Nm")
REFUSED = (
    (["poly345"], 2, "needed: one, to minimise or to maximise"),
    (["poly345", "--minimise", "jump_speed"], 2, "allowed: maximise"),
    (["poly345", "--maximise", "shaft_torque@300rpm"], 2, "allowed: minimise"),
    (["poly345", "--maximise", "jump_sped"], 2, "did you mean 'jump_speed'"),
    (["poly345", *SMALL[:4], "--joints", "3"], 2, "allowed: C1 to C6"),
    (["poly345", *SMALL[:2], "--pieces", "0"], 2, "pieces is 0; allowed: 1 to 200"),
    ([*POLY, "--keep", "dwells"], 2, "allowed: events,dwells,lift or dwells,lift or"),
    ([*POLY, "--limit", "event_angle@1<=90deg"], 2, "events stay; allowed:"),
    ([*POLY, "--keep", "lift", "--limit", "event_angle@3<=90deg"], 2, "has 2 events"),
    ([*POLY, *SHARED, *TWO], 2, "no spans of events keep them"),
    ([*POLY, *SHARED, *SLOW], 1, "have a law; of the last: no law of the class keeps"),
    (["bezier15", *SMALL, *SHARED], 2, "has one event"),
    (["poly345", "--minimise", "shaft_torque@300rpm", "--starts", "0"], 2, "allowed: 1 to"),
    (["poly345", "--minimise", "shaft_torque@300rpm", "--seed", "-1"], 2, "0 and above"),
    (["flat", "--minimise", "pressure_angle"], 2, "pressure angle no law changes"),
    ([*POLY, "--limit", "radius_of_curvature>=80mm"], 1, "a dwell of 'poly345' breaks it"),
    ([*POLY, "--limit", "shaft_torque@300rpm<=1Nm", "--starts", "1"], 1, "was found that keeps"),
    (["poly345", "--maximise", "jump_speed", *TORQUE], 2, "as a limit"),
    ([*POLY, "--out", "a.yml"], 2, "ends in .yaml"),
    ([*POLY, "--limit", "lift@90deg<=1kg"], 2, "one of mm, m"),
    ([*POLY, "--limit", "lift@150deg<=1mm"], 1, "no law of the class keeps"),
    (["tm21", "--maximise", "jump_speed_steady", "--rig", "tm21"], 2, "jump_speed_rigid"),
    (["nowhere", *SMALL], 2, "no such file"),
    ([*POLY, "--pareto", "peak_jerk", "--out", "a.yaml"], 2, "no --out"),
    ([*POLY, "--pareto", "peak_jerk"], 2, "is the goal"),
    ([*POLY, "--pareto", "peak_acceleration", "--points", "2"], 2, "allowed: 3 to 200"),
    ([*POLY, "--pareto", "event_angle@1", *SHARED], 2, "allowed: without --keep"),
)


def test_refusals_are_one_line():
    """What is wrong, what is allowed, on stderr, with the error's code."""
    for arguments, code, words in REFUSED:
        result = call(*arguments)
        assert (result.exit_code, result.stdout) == (code, ""), words
        assert words in result.stderr
        assert len(result.stderr.strip().splitlines()) == 1
