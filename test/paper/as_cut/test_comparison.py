"""Cams as they were cut: the jump search and the noise levels run on the roller's law unchanged."""

import json
from functools import partial

import numpy as np
import pytest

from cam_rig import load_cam
from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.two_masses import FROM_REST
from cam_rig.dynamics.two_mass import first_lift_off
from cam_rig.errors import ConfigError
from cam_rig.laws import build_law
from cam_rig.paper.as_cut.study import CutBench, DrawnCam, cut_at, over_sizes, radii
from cam_rig.schema.load import config_root
from cam_rig.simulation.scene import open_scene
from cam_rig.units import RPM

from ...cli.conftest import call as run

CONFIG = config_root()


@pytest.fixture(scope="module")
def bench(table2):
    return CutBench.of(table2, open_scene(CONFIG / "scenes" / "tm21_sweep.yaml"))


@pytest.fixture(scope="module")
def drawn(bench):
    return DrawnCam.run(build_law(load_cam("bezier15")), bench)


def test_a_point_changes_nothing(drawn, bench):
    """With no roller the cam is the one that was drawn, whatever its base circle."""
    found = cut_at("bezier15", drawn, bench, 0.04, 0.0)
    assert found.cut.jump_rpm == pytest.approx(drawn.jump_rpm, rel=1e-5)
    assert np.abs(found.change).max() < 1e-9
    assert found.too_high.value < 1e-15


def test_bezier_15(drawn, bench, table2):
    """Highest above s, jump speed proven by the exact model, and noise nearly as before."""
    found = cut_at("bezier15", drawn, bench, *radii(load_cam("bezier15")))
    dense = np.linspace(0.0, 2.0 * np.pi, 20001)
    highest = (found.cut.law(dense) - drawn.law(dense)).max()
    assert found.too_high.value == pytest.approx(highest, rel=1e-6)
    follower = TwoMassParameters.from_rig(table2)

    def leaves(speed):
        return first_lift_off(found.cut.law, follower, speed, np.zeros(2), FROM_REST) is not None

    assert leaves(found.cut.jump_rpm * RPM * (1.0 + 1e-5))
    assert not leaves(found.cut.jump_rpm * RPM * (1.0 - 1e-5))
    assert found.cut.jump_rpm > drawn.jump_rpm
    assert np.abs(found.change).max() < 0.05


def test_it_grows_with_the_roller_and_falls_with_the_base(drawn, bench):
    """The first order, R_r s'²/(2 ρ (ρ + R_r)), does; so does what comes out."""
    own = cut_at("bezier15", drawn, bench, 0.05, 0.005)
    found = over_sizes(own, bench, (0.05, 0.08), (0.005, 0.015), "Bézier").rows
    sizes = [(row.base_radius, row.roller) for row in found]
    assert sizes == [(0.05, 0.005), (0.05, 0.015), (0.08, 0.005), (0.08, 0.015)]
    above = [row.too_high.value for row in found]
    assert above[0] < above[1] > above[3] > above[2] < above[0]


def test_other_followers_are_refused():
    """A face, and a guide beside the axis: R_b + s is nobody's contour there."""
    for name in ("flat", "eccentric_roller"):
        with pytest.raises(ConfigError, match="allowed: a roller in a guide without eccentricity"):
            radii(load_cam(name))


call = partial(run, "as-cut")


def test_the_command(tmp_path):
    """The cam's own radii where none are given."""
    files = ("--csv", tmp_path / "a.csv", "--plot", tmp_path / "a.png")
    result = call("bezier15", "--roller", 20, "--json", "-", *files)
    assert result.exit_code == 0, result.stderr
    data = json.loads(result.stdout)
    (row,) = data["as_cut"]
    assert (row["base_radius"], row["roller_radius"]) == (0.065, 0.02)
    assert row["jump"] < row["jump_cut"]
    assert max(one["change"] for one in data["levels"]) == row["change_to"]
    assert f"{1e3 * row['above_law']:.3f} mm too high, noise within" in result.stderr
