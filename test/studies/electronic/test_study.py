"""Motion of the follower under each form, and the command."""

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_contact_loss_speed
from cam_rig.dynamics.vibration import low_dwell
from cam_rig.studies.electronic.study import BY, CONTROLLER_RPM, dwell_vibration
from cam_rig.studies.electronic.tables import Interpolation, sample_table, table_law

from ...cli.conftest import call
from .test_errors import SMOOTH


@pytest.mark.parametrize("target", ["codesys", "codesys_builder"])
@pytest.mark.parametrize("name", SMOOTH)
def test_the_follower_moves_as_under_the_exact_law(name, target, tmp_path):
    """Read back, residual vibration is within 5 % and the jump speed within 0.1 %.

    A cam that is tuned to the stem has no residual vibration. A controller with the default errors
    then leaves at most 10 nm.
    """
    cam = cam_rig.load_cam(name)
    if not cam.follower.sprung:
        return
    rig = cam_rig.load_rig("paper_table2")
    follower, law = FollowerParameters.on_stem(rig, BY), cam_rig.build_law(cam)
    path = tmp_path / "cam.st"
    path.write_text(cam_rig.electronic(cam, target).text, encoding="utf-8")
    back = cam_rig.read_electronic(path, target).law
    exact, made = (
        dwell_vibration(x, follower, CONTROLLER_RPM, low_dwell(law)) for x in (law, back)
    )
    assert made == pytest.approx(exact, rel=0.05, abs=1e-8)
    speeds = [find_contact_loss_speed(x, rig) for x in (law, back)]
    assert speeds[1] == pytest.approx(speeds[0], rel=1e-3)


def test_tables_vibrate_by_their_interpolation():
    """64 points of 4-5-6-7 vibrate by lines and cubics, less by a spline; errors shrink."""
    result = cam_rig.electronic(
        "poly4567", points=[64, 256], interpolation=["linear", "cubic", "spline"], rpm=150.0
    )
    rows = {(row.form, row.count): row for row in result.rows}
    law = rows["law", None]
    vibrations = [rows[name, 64].vibration for name in ("linear", "cubic", "spline")]
    assert vibrations == sorted(vibrations, reverse=True)
    assert vibrations[0] > 1e4 * law.vibration and vibrations[1] > 500.0 * law.vibration
    assert rows["spline", 256].vibration == pytest.approx(law.vibration, rel=0.05)
    assert rows["linear", 64].jump_rpm == 0.0 and np.isinf(rows["linear", 64].bounds.acceleration)
    ratio = rows["spline", 64].bounds.lift / rows["spline", 256].bounds.lift
    assert 50.0 < ratio < 400.0  # fourth order
    texts = result.summary()
    assert len(texts) == 3 and "64 points, cubic" in texts[1]
    assert "use at least 256 points, or polynomial segments" in texts[1]


def test_table_bounds_are_true_and_close():
    """Bounds of each interpolation are true and at most 3 times the error at many angles."""
    law, angles = cam_rig.build_law("bezier15"), np.linspace(0.0, 6.283, 20_001)
    result = cam_rig.electronic("bezier15", points=64, interpolation=["cubic", "sliding", "spline"])
    for row in result.rows[1:4]:
        made = table_law(sample_table(law, 64), Interpolation(row.form))
        for order, bound in enumerate(row.bounds[:3]):
            error = np.abs(made(angles, order) - law(angles, order)).max()
            assert error <= bound <= 3.0 * error


def test_a_cam_file_runs_as_the_controller(tmp_path, monkeypatch):
    """The cam file of a table has the law of the table and can be simulated."""
    monkeypatch.chdir(tmp_path)
    write = "electronic poly4567 --target table"
    read = "electronic --read t.csv --as table"
    done = call(*f"{write} --points 64 --out t.csv".split())
    assert done.exit_code == 0, done.stderr
    done = call(*f"{read} --interpolation cubic --out back.yaml".split())
    assert done.exit_code == 0, done.stderr
    law = cam_rig.build_law("back.yaml")
    exact = table_law(sample_table(cam_rig.build_law("poly4567"), 64), Interpolation.CUBIC)
    angles = np.linspace(0.0, 6.28, 1001)
    assert np.allclose(law(angles, 2), exact(angles, 2), rtol=0.0, atol=1e-9)
    assert len(cam_rig.simulate("back.yaml", "paper_table2", rpm=200, turns=1).time) > 100
    done = call(*f"{read} --out back.yaml".split())
    assert "exists already" in done.stderr


REFUSED = [
    ("electronic", "a cam or --read FILE is required"),
    ("electronic poly345 --read a.st", "cannot be combined"),
    ("electronic poly345 --target codesis", "--target: is 'codesis'; allowed: "),
    ("electronic poly345 --target table", "requires one number of --points"),
    ("electronic poly345 --points 4", "--points must be between 8 and 16384, got 4"),
    ("electronic poly345 --points x", "--points must be whole numbers"),
    ("electronic poly345 --lift-error 1", "--lift-error must be a number with a unit"),
    ("electronic poly345 --lift-error 5mm", "--lift-error must be 0.1 nm to 1 mm, got 5000 µm"),
    ("electronic poly345 --acceleration-error 200%", "--acceleration-error must be between"),
    ("electronic poly345 --interpolation bezier --points 64", "--interpolation must be linear or"),
    ("electronic poly345 --rig no_such_rig", "no such file"),
    ("electronic conjugate --points 64 --rig tm21", "conjugate"),
    ("electronic poly345 --rig tm21 --rpm 1e9", "speed is 1e+09 rpm"),
    ("electronic --read none.st --points 64", "--read cannot be combined with --points or"),
    ("electronic --read none.st", "none.st: cannot be read"),
    ("electronic --read a.csv --as table --interpolation linear,cubic", "one --interpolation"),
    ("electronic --read none.st --out a.txt", "ends in .yaml"),
]


@pytest.mark.parametrize(("line", "message"), REFUSED)
def test_wrong_options_are_refused(line, message):
    """A wrong option is one line with exit code 2."""
    done = call(*line.split())
    assert done.exit_code == 2 and message in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("options", ["", " --points 64 --interpolation cubic"])
def test_the_figure_is_drawn(options, tmp_path):
    """The figure has one panel without a rig, and three with the motion of the follower."""
    target = tmp_path / "a.png"
    done = call(*f"electronic poly4567{options} --plot {target}".split())
    assert done.exit_code == 0, done.stderr
    assert target.stat().st_size > 10_000
