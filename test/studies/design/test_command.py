"""Tests of `cam-rig design`: cam files, JSON, figures, design files and errors.

A design is a search for a motion law with a goal and limits.
"""

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
    """`--out` writes a valid cam file whose peak jerk is the reported result.

    JSON has the value of the start law, the result and its lower bound in SI units.
    """
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
    """A design file gives the result of the same goal, limits and class as options.

    The class is the set of laws that are searched. A design file together with the option
    --minimise is refused.
    """
    file = tmp_path / "asked.yaml"
    file.write_text(
        "start: poly345\nminimise: peak_jerk\nclass: {pieces: 6, joints: C2}\n", encoding="utf-8"
    )
    assert data_of(file)["measures"] == data_of("poly345", *SMALL)["measures"]
    both = call(file, "--minimise", "peak_jerk")
    assert both.exit_code == 2
    assert "has a goal and limits" in both.stderr


LOCAL = ("--minimise", "shaft_torque@300rpm", "--pieces", "6")


@pytest.mark.parametrize(
    ("arguments", "laws"), [(SMALL, 1), pytest.param(LOCAL, 3, marks=pytest.mark.long)]
)
def test_ctrl_c_keeps_the_best_law_so_far(tmp_path, monkeypatch, arguments, laws):
    """An interrupted search writes the best law so far and ends with exit code 130.

    The result has no bound.
    """
    solve, values = study.search_design, []

    def interrupted(cam, rig, request, name, on_better):
        def then_stop(file, value):
            on_better(file, value)
            values.append(value)
            if len(values) == laws:
                raise KeyboardInterrupt

        return solve(cam, rig, request, name, then_stop)

    monkeypatch.setattr(study, "search_design", interrupted)
    result = call("poly345", *arguments, "--out", tmp_path / "kept.yaml", "--json", "-")
    assert result.exit_code == 130
    assert "without a bound" in result.stderr
    data = json.loads(result.stdout)
    design_data, goal = data["design"], data["measures"][0]
    assert (design_data["interrupted"], design_data["certified"], design_data["gap"]) == (
        True,
        False,
        None,
    )
    assert goal["result"] < goal["start"]
    assert values == sorted(values, reverse=True)
    assert build_law(load_cam(tmp_path / "kept.yaml")).lift == pytest.approx(0.05, rel=1e-9)


def test_a_goal_that_is_not_convex_is_local_without_a_bound(tmp_path):
    """The result of a goal that is not convex is a local optimum without a bound.

    The cam file records seed and number of starts, and the same seed writes the same file.
    """
    out, plot = tmp_path / "easy.yaml", tmp_path / "easy.png"
    goal = ["--minimise", "shaft_torque@250rpm", "--pieces", "1", "--degree", "8"]
    arguments = [*goal, "--starts", "2", "--seed", "7", "--out", out, "--json", "-"]
    result = done("poly345", *arguments, "--plot", plot)
    data = json.loads(result.stdout)
    design_data = data["design"]
    assert (
        design_data["starts"],
        design_data["seed"],
        design_data["certified"],
        design_data["gap"],
    ) == (2, 7, False, None)
    assert 1 <= design_data["starts_agreeing"] <= 2
    assert data["measures"][0]["bound"] is None
    assert "local (2 starts, " in result.stderr
    text = out.read_text(encoding="utf-8")
    assert "seed 7, local (2 starts, " in text.splitlines()[0]
    assert "without a bound" in text.splitlines()[0]
    assert plot.read_bytes().startswith(b"\x89PNG")
    out.unlink()
    call("poly345", *arguments)
    assert out.read_text(encoding="utf-8") == text


def test_events_share_the_angle_between_kept_dwells(tmp_path):
    """With `--keep dwells,lift` rises and falls may exchange angle.

    They stay within their limits. The spans in the table are those of the cam file. The limit of
    110° on the first event (motion between two dwells) is active.
    """
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
