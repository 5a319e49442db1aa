"""`cam_rig.compare_run`: rows, sentences and a picture of a recorded run beside a model."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure

import cam_rig
from cam_rig.errors import ConfigError

GOLDEN = Path(__file__).parents[3] / "bags" / "golden"


def test_a_comparison_has_rows_sentences_and_a_picture():
    """A loaded scene or its name; a column for three speeds of each of two cams at most."""
    found = cam_rig.compare_run(GOLDEN, cam_rig.load_scene("quick"))
    assert repr(found).endswith("golden, quick: 8 speeds)")
    assert [row["rpm"] for row in found.plain()["speeds"]][:4] == [200.0, 300.0, 350.0, 400.0]
    assert found.plain()["conclusions"] == list(found.conclusions)
    figure = found.plot()
    assert isinstance(figure, Figure)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    expected = [f"TM21 concave cam\n{rpm} rpm" for rpm in (200, 350, 400)]
    assert titles == [*expected, "Bézier degree 15\n200 rpm", "Bézier degree 15\n400 rpm"]


def test_arguments_that_do_not_fit_the_bag_are_refused():
    """With what is allowed."""
    with pytest.raises(ConfigError, match="exact angles"):
        cam_rig.compare_run(GOLDEN, "quick", offset_deg=3.0)
    with pytest.raises(ConfigError, match="names whole topics"):
        cam_rig.compare_run(GOLDEN, "quick", topics="angle=/a lift=/b", namespace="/rig2")
