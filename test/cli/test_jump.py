"""cam-rig jump: the promised JSON, a table, a plot, and refusals in a line."""

import json

import pytest
from typer.testing import CliRunner

from cam_rig.cli.main import app
from cam_rig.schema import load_rig
from cam_rig.schema.load import config_root

RIG = load_rig(config_root() / "rigs" / "tm21.yaml").model_dump(exclude_none=True)
FIVE = {"bezier15": 570, "poly345": 415, "poly4567": 390, "cycloidal": 410, "bezier_segments": 400}


def call(*arguments):
    return CliRunner().invoke(app, ["jump", *(str(a) for a in arguments)])


def test_the_promised_json():
    """Each cam of Table 2 with its speed, the published one, angle and time."""
    result = call("--json", "-")
    assert result.exit_code == 0
    data = json.loads(result.stdout)
    assert {cam: row["published_rpm"] for cam, row in data.items()} == FIVE
    for row in data.values():
        assert {"rpm", "published_rpm", "angle_deg", "time_s"} <= set(row)
        assert row["rpm"] == pytest.approx(row["published_rpm"], rel=0.01)
        assert 0.0 <= row["angle_deg"] < 360.0
        assert 0.0 < row["time_s"] < 1.7
    assert "ranking as published" in " ".join(result.stderr.split())


def test_other_cams_and_ways(tmp_path):
    """A cam the paper does not have has nothing beside it; steady state and ramp go as well."""
    result = call("modified_sine", "--steady", "--json", "-", "--plot", tmp_path / "a.png")
    assert result.exit_code == 0
    row = json.loads(result.stdout)["modified_sine"]
    assert row["published_rpm"] is None
    assert "nothing is published" in result.stderr
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    ramped = call("modified_sine", "--ramp", 400, "--json", "-")
    assert json.loads(ramped.stdout)["modified_sine"]["rpm"] > row["rpm"]
    known = call("poly345", "--ramp", 400, "--json", "-")
    row = json.loads(known.stdout)["poly345"]
    assert (row["published_rpm"], row["difference"]) == (415, None)
    assert "nothing is compared" in known.stderr
    assert "fitted" not in known.stderr


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["no_such_cam"], 2, "no_such_cam.yaml: no such file"),
        (["poly345", "poly345"], 2, "is named twice"),
        (["conjugate"], 2, "follower.type is 'conjugate'; allowed on a rig"),
        (
            ["worked_example_constant_velocity"],
            1,
            "one slope; where it falls contact is lost",
        ),
        (["--rig", "tm21", "--refit"], 2, "follower.roller_share: is missing"),
        (["--rig", "no_such_rig"], 2, "no_such_rig.yaml: no such file"),
        (["--from-rest", "-1"], 1, "the run from rest lasts -1 s; allowed: above 0"),
        (["--from-rest", "1e9"], 1, "lasts 1e+09 s; allowed: above 0, to 60 s"),
        (["--ramp", "1e9"], 1, "ramp is 1e+09 rpm/s; allowed: 1 to 100000 rpm/s"),
        (["--steady", "--ramp", "100"], 2, "allowed: one of them"),
        (["--steady", "--from-rest", "3"], 2, "allowed: one of them"),
        (["--ramp", "350", "--plot", "{tmp}/a.png"], 2, "--ramp holds none"),
        (["poly345", "--refit"], 2, "needed: bezier15, poly345, poly4567, cycloidal"),
        (["--refit", "--json", "{tmp}/a.json"], 2, "allowed: --refit alone"),
        (["poly345", "--plot", "{tmp}/a.xyz"], 2, "unknown kind of picture"),
    ],
)
def test_refusals(tmp_path, arguments, code, words):
    """A mistake gives a line and a code, and writes nothing."""
    result = call(*(a.replace("{tmp}", str(tmp_path)) for a in arguments))
    assert result.exit_code == code
    assert words in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_stem_that_rings_for_ever(tmp_path):
    """No damping: no steady state, and the remedy is named."""
    text = (config_root() / "rigs" / "paper_table2.yaml").read_text(encoding="utf-8")
    rig = tmp_path / "paper_table2.yaml"
    rig.write_text(text.replace("given: 8.642", "given: 0").replace("assumed: 8.642", "assumed: 0"))
    result = call("poly345", "--rig", rig, "--steady", "--json", tmp_path / "out.json")
    assert result.exit_code == 1
    assert "no steady state" in result.stderr
    assert list(tmp_path.iterdir()) == [rig]


def test_a_rig_without_a_stem_has_a_jump_speed(tmp_path):
    """Its one mass leaves the cam too; rig and follower are named, in words and in JSON."""
    result = call("poly345", "--rig", "tm21", "--json", "-", "--plot", tmp_path / "a.png")
    assert result.exit_code == 0
    row = json.loads(result.stdout)["poly345"]
    assert (row["rig"], row["follower"]) == ("tm21", "one rigid mass")
    assert row["rpm"] == pytest.approx(438.29, abs=0.01)
    assert "rig tm21: one rigid mass" in " ".join(result.stderr.split())
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    ramped = call("poly345", "--rig", "tm21", "--ramp", 300, "--json", "-")
    assert json.loads(ramped.stdout)["poly345"]["rpm"] > row["rpm"]


def test_a_scene_brings_its_rig():
    """The cams of a scene turn on its rig, and on another where that is asked for."""
    own = json.loads(call("quick", "--json", "-").stdout)
    assert set(own) == {"tm21", "bezier15"}
    assert {row["rig"] for row in own.values()} == {"tm21"}
    other = json.loads(call("quick", "--rig", "paper_table2", "--json", "-").stdout)
    assert {row["follower"] for row in other.values()} == {"two masses"}


def test_a_rig_of_four_numbers_is_enough(tmp_path):
    """Mass, spring, damping and preload have a jump speed, that of the same rig with all else."""
    four = {key: RIG["follower"][key] for key in ("mass", "spring_stiffness", "damping", "preload")}
    path = tmp_path / "mine.yaml"
    path.write_text(json.dumps({"name": "mine", "title": "mine", "follower": four}))
    mine = call("poly345", "--rig", path, "--json", "-")
    assert mine.exit_code == 0, mine.output
    whole = json.loads(call("poly345", "--rig", "tm21", "--json", "-").stdout)["poly345"]
    assert json.loads(mine.stdout)["poly345"]["rpm"] == whole["rpm"]
    half = four | {"roller_share": {"given": 0.4, "unit": "1"}}
    path.write_text(json.dumps({"name": "mine", "title": "mine", "follower": half}))
    refused = call("poly345", "--rig", path)
    assert refused.exit_code == 2
    words = " ".join(refused.stderr.split())
    assert "rig mine: follower.stem_stiffness: is missing; needed by two masses" in words
