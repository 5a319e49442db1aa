"""cam-rig fit rig, as a person uses it."""

import json

import pytest
from typer.testing import CliRunner

import cam_rig
from cam_rig.cli.main import app
from cam_rig.simulation.instruments import InstrumentErrors, measured_run

from ..foreign_bags import joint, number, write_bag

TABLE = """mass_kg,spring_N/mm,rpm
0,2,336.8
0,4.03,449.8
0,8,622.6
0.5,2,284.0
0.5,4.03,385.7
0.5,8,529.5
1,2,257.2
1,4.03,342.6
1,8,469.7
"""


def call(*arguments):
    return CliRunner().invoke(app, ["fit", "rig", *map(str, arguments)])


@pytest.fixture
def jumps(tmp_path):
    path = tmp_path / "jumps.csv"
    path.write_text(TABLE, encoding="utf-8")
    return path


def test_a_table_becomes_a_rig_that_loads(tmp_path, jumps):
    """Table to rig file, picture and JSON; what was found is identified, the rest assumed."""
    out = tmp_path / "bench.yaml"
    result = call(
        *(jumps, "poly345", "--given", "damping=8.6", "--out", out),
        *("--plot", tmp_path / "j.png", "--json", tmp_path / "j.json"),
    )
    assert result.exit_code == 0, result.output
    rig = cam_rig.load_rig(out)
    assert rig.follower.mass.origin == "identified"
    assert rig.follower.mass.si == pytest.approx(1.3, abs=0.05)
    assert rig.follower.damping.origin == "given"
    assert rig.follower.spring_stiffness.origin == "assumed"
    data = json.loads((tmp_path / "j.json").read_text(encoding="utf-8"))
    assert data["numbers"]["restitution"]["value"] is None
    assert (tmp_path / "j.png").stat().st_size > 10_000


def test_a_bag_of_another_program(tmp_path, law_345, tm21):
    """Encoder and load cell of a bench, mapped in a line."""
    errors = InstrumentErrors(rate=500, encoder_rate=500)
    run = measured_run(law_345, tm21, "one_mass", (200.0, 300.0, 400.0), errors, 1, turns=3.0)
    bag = write_bag(
        tmp_path / "bench",
        {
            "/encoder": (joint, run.angle.time, run.angle.value),
            "/cell": (number, run.force.time, run.force.value),
        },
    )
    topics = "angle=/encoder.position[0] force=/cell.data"
    out = tmp_path / "bench.yaml"
    result = call(bag, "poly345", "--topics", topics, "--rig", "tm21", "--out", out)
    assert result.exit_code == 0, result.output
    assert cam_rig.load_rig(out).follower.mass.si == pytest.approx(1.3, abs=0.02)
    assert "never leaves the cam" in result.output


@pytest.fixture
def law_345():
    return cam_rig.build_law(cam_rig.load_cam("poly345"))


@pytest.fixture
def tm21():
    return cam_rig.load_rig("tm21")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--given", "mas=1"], "did you mean"),
        (["--given", "mass=-1"], "allowed"),
        (["--topics", "angle=/a.b"], "no meaning"),
        (["--tolerance", "0"], "tolerance"),
        (["--out", "rig.txt"], "yaml"),
        (["--csv", "-", "--json", "-"], "both go to stdout"),
    ],
)
def test_what_does_not_fit_is_said_in_a_line(jumps, more, words):
    result = call(jumps, "poly345", *more)
    assert result.exit_code == 2, result.output
    assert words in result.output
    assert "Traceback" not in result.output
