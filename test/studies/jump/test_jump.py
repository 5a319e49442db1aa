"""Tests of jump speeds, also along ramps, and of the command `cam-rig jump`.

They are compared with Table 2 of the paper. The jump speed is the lowest cam speed with a loss of
contact. The paper is the article on Bézier cams that docs/glossary.md lists.
"""

import json
import math
from dataclasses import replace
from functools import partial

import pytest

from cam_rig.dynamics.jump.any_follower import find_jump
from cam_rig.dynamics.jump.two_masses import Jump
from cam_rig.errors import ConfigError
from cam_rig.schema import load_tables
from cam_rig.studies.jump.comparison import (
    JumpResult,
    JumpRow,
    find_jumps,
    jump_along_ramp,
    references,
    rms_difference,
)
from cam_rig.units import RPM
from examples.paper.refit import with_event

from ...cli.conftest import call as run

FIVE = {"bezier15": 570, "poly345": 415, "poly4567": 390, "cycloidal": 410, "bezier_segments": 400}


@pytest.fixture(scope="module")
def published(config_dir):
    """Tables of the paper, as stored in the configuration folder."""
    return load_tables(config_dir / "published" / "tables" / "paper.yaml")


@pytest.fixture(scope="module")
def found(cam_set, published):
    """Jump speeds of the five cams of the paper's Table 2, with the published values."""
    return find_jumps(cam_set, references(cam_set, published))


def test_table_2(found):
    """The computed jump speeds agree with the paper's Table 2 within 1 % r.m.s.

    The rig was fitted to four of the laws. The fifth, a test, agrees within 1 % too.
    """
    compared = found.comparison
    assert (compared.cams, compared.fitted, compared.same_ranking) == (4, True, True)
    assert compared.rms == rms_difference(row for row in found.rows if row.role == "fitted") < 0.01
    assert compared.turns[1] < compared.published_turns[0]  # the published times are not reproduced
    (test,) = [row for row in found.rows if row.role == "test"]
    assert test.cam == "bezier_segments"
    assert abs(test.difference) < 0.01
    assert {row.cam: row.published_rpm for row in found.rows} == FIVE
    assert "ranking as published" in found.summary()[0]


def test_slow_ramp_is_the_steady_state(laws, two_mass):
    """On a slow speed ramp contact is lost within two turns of the steady jump speed.

    On a fast ramp it is lost at a higher speed.
    """
    law = laws["poly4567"]
    steady = find_jump(law, two_mass, None).rpm
    slow, fast = (jump_along_ramp(law, two_mass, rate * RPM) for rate in (20.0, 2000.0))
    turn = 20.0 * 60.0 / steady  # rise of the speed per turn, rpm
    assert steady - 0.1 * turn < slow.rpm < steady + 2.0 * turn
    assert fast.rpm > slow.rpm
    assert slow.time == pytest.approx(slow.rpm / 20.0, rel=1e-12)


def test_the_role_depends_on_the_content_of_the_files(cam_set, published):
    """A cam is compared with the paper only with the rig and the angles of the paper.

    It is then marked as fitted or as a test of the fit. With another rig or other angles it has no
    mark. A cam with another law is not in the table.
    """
    roles = {cam: known.role for cam, known in references(cam_set, published).items()}
    assert roles == dict.fromkeys(FIVE, "fitted") | {"bezier_segments": "test"}
    other = replace(cam_set, rig=cam_set.rig.with_follower(stem_stiffness=2e6))
    assert {known.role for known in references(other, published).values()} == {""}
    wider = with_event(cam_set.cams["poly345"], 2.0)
    poly4567 = cam_set.cams["poly4567"].model_copy(update={"name": "cycloidal"})
    cams = cam_set.cams | {"poly345": wider, "cycloidal": poly4567}
    found = references(replace(cam_set, cams=cams), published)
    assert found["poly345"].role == ""
    assert found["poly4567"].role == "fitted"
    assert "cycloidal" not in found


def test_comparison_on_another_rig(found):
    """On a rig that was not fitted to the published speeds, all cams are compared.

    Without published speeds, or along a ramp, there is no comparison.
    """

    def compared(**changes):
        return replace(found, rows=tuple(replace(row, **changes) for row in found.rows)).comparison

    assert (compared(role="").cams, compared(role="").fitted) == (5, False)
    assert compared(published_rpm=None, role="") is None
    assert compared(ramp=350.0) is None


def test_runs_and_ramps_have_limits(cam_set):
    """A duration of a run or a speed ramp out of range raises ConfigError.

    Durations are at most 60 s, ramps 1 to 100 000 rpm/s.
    """
    for duration in (0.0, -1.0, 60.1, 1e9, math.nan, math.inf):
        with pytest.raises(ConfigError, match="allowed: above 0, to 60 s, or the steady state"):
            find_jumps(cam_set.select(["poly345"]), {}, duration)
    for ramp in (0.0, -3.0, 0.5, 1e9, math.nan):
        with pytest.raises(ConfigError, match=r"ramp must be between 1 and 100000 rpm/s, got"):
            find_jumps(cam_set.select(["poly345"]), {}, ramp=ramp)


# -- table of the results

AT = Jump(40.0, math.pi, 0.5)
FITTED = JumpRow("a", AT, Jump(41.0, 0.0, 0.0), 400.0, 1.5, "fitted", rigid_rpm=390.0)


def shown(cam_set, *rows):
    (table,) = JumpResult(cam_set, rows).to_display({"a": "The cam"})
    return table


def test_a_row_has_its_units(cam_set):
    """The table of jump speeds has columns in rpm, degrees and percent.

    A column in which no row has a value is omitted.
    """
    table = shown(cam_set, FITTED)
    assert table.caption == "Jump speed on rig paper_table2: two masses, 1.7 s from rest"
    row = dict(zip([column.title for column in table.columns], table.rows[0], strict=True))
    assert (row["cam"], row["rigid [rpm]"]) == ("The cam", 390.0)
    assert row["jump speed [rpm]"] == pytest.approx(1200.0 / math.pi)
    assert row["difference [%]"] == pytest.approx(100.0 * (3.0 / math.pi - 1.0))
    assert row["cam angle [°]"] == pytest.approx(180.0)
    bare = shown(cam_set, JumpRow("a", AT))
    assert " ".join(c.heading for c in bare.columns) == "cam jump speed cam angle time"
    assert not any("Fitted" in note for note in bare.notes)


# -- the command `cam-rig jump`


call = partial(run, "jump")


def run_json(*arguments):
    """Run `cam-rig jump` with JSON.

    The results are its rows by cam, the run data, and stderr.
    """
    result = call(*arguments, "--json", "-")
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    return {row["cam"]: row for row in data["jump"]}, data["run"], " ".join(result.stderr.split())


def test_other_cams_and_runs(tmp_path):
    """A cam that is not in the paper, or a ramp, is not compared with the paper."""
    rows, run, words = run_json("modified_sine", "--steady", "--plot", tmp_path / "a.png")
    row = rows["modified_sine"]
    assert row["published_rpm"] is run["duration"] is None
    assert "no jump speed of these cams is published" in words
    ramped, run, words = run_json("modified_sine", "poly345", "--ramp", 400)
    assert ramped["modified_sine"]["rpm"] > row["rpm"]
    assert (ramped["poly345"]["published_rpm"], ramped["poly345"]["difference"]) == (415, None)
    assert run["ramp"] == 400.0
    assert "two masses, along a ramp of 400 rpm/s" in words
    assert "no comparison" in words
    assert "fitted" not in words


def test_a_rig_without_a_stem_has_a_jump_speed():
    """A rig without an elastic stem has the jump speed of one rigid mass.

    Text and JSON state the rig and the kind of follower.
    """
    rows, run, words = run_json("poly345", "--rig", "tm21")
    assert (run["rig"], run["follower"]) == ("tm21", "one rigid mass")
    assert rows["poly345"]["rpm"] == pytest.approx(438.29, abs=0.01)
    assert "rig tm21: one rigid mass" in words
    ramped, _, _ = run_json("poly345", "--rig", "tm21", "--ramp", 300)
    assert ramped["poly345"]["rpm"] > rows["poly345"]["rpm"]


def test_a_rig_of_four_numbers_has_a_jump_speed(tmp_path, rig):
    """A rig file with only mass, spring, damping and preload is sufficient.

    It has the jump speed of the complete rig. With an incomplete stem it is refused.
    """
    keys = {"mass", "spring_stiffness", "damping", "preload"}
    four = rig.follower.model_dump(exclude_none=True, include=keys)
    path = tmp_path / "mine.yaml"
    path.write_text(json.dumps({"name": "mine", "title": "mine", "follower": four}))
    mine, whole = (run_json("poly345", "--rig", rig)[0]["poly345"]["rpm"] for rig in (path, "tm21"))
    assert mine == whole
    half = four | {"roller_share": {"given": 0.4, "unit": "1"}}
    path.write_text(json.dumps({"name": "mine", "title": "mine", "follower": half}))
    refused = call("poly345", "--rig", path)
    assert refused.exit_code == 2
    words = " ".join(refused.stderr.split())
    missing = "follower.stem_stiffness, follower.stem_damping: are missing"
    assert f"rig mine: {missing}; needed by two masses" in words
