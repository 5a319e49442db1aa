"""Recordings beside a run: laws as their own curves, orders as the spectra's own numbers."""

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import CamRigError
from cam_rig.laws import chart as law_chart
from cam_rig.laws.catalogue import ORDERS, rise_curves
from cam_rig.laws.chart import save_laws
from cam_rig.paper.orders.chart import entity, orders_tabs, save_orders
from cam_rig.paper.orders.spectrum import RANGE, loudest, waterfall
from cam_rig.show.chart import SPEED
from cam_rig.show.looks import short
from cam_rig.units import RPM

from .conftest import Picture

STRIPS = "LineStrips2D:strips"
SPEEDS = (300.0, 350.0, 400.0)
UNITS = ("h", "h/β", "h/β²", "h/β³")


def test_each_curve_is_the_law(tmp_path):
    """Heights in the chart are the values, to a scale that all laws of the chart share."""
    curves = [rise_curves(name) for name in ("poly345", "cycloidal", "simple_harmonic")]
    save_laws(curves, "u", UNITS, tmp_path / "a.rrd")
    picture = Picture(tmp_path / "a.rrd")
    for order in ORDERS:
        drawn, values = [], []
        for curve in curves:
            (strips,) = picture.column(f"{law_chart.entity(order)}/{curve.name}", STRIPS)
            drawn.append(np.array([list(point) for point in strips[0]])[:, 1])
            values.append(curve.motion[order])
        scale, start = np.polyfit(np.concatenate(values), np.concatenate(drawn), 1)
        assert scale < 0.0  # the plane's y is down
        fitted = scale * np.concatenate(values) + start
        np.testing.assert_allclose(np.concatenate(drawn), fitted, atol=1e-4)
    with pytest.raises(CamRigError, match=r"ends in '.png'; allowed: .rrd"):
        save_laws(curves, "u", UNITS, tmp_path / "a.png")


@pytest.fixture(scope="module")
def found():
    law = cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig = cam_rig.load_rig("paper_table2")
    return waterfall({"poly345": law}, "elastic_stem", rig, [rpm * RPM for rpm in SPEEDS], 40)


def test_bars_are_the_levels_of_the_speed(found, tmp_path):
    """To scale, each at its speed on the timeline; a stroke is within 60 dB of the loudest."""
    path = tmp_path / "a.rrd"
    save_orders(found, path)
    picture, (study,) = Picture(path), found
    view = entity(study, "level", "lines")
    assert picture.numbers(f"{view}/orders", SPEED).tolist() == list(SPEEDS)
    low = 10.0 * np.ceil(loudest(found, "level") / 10.0) - RANGE
    for spectrum, bars in zip(study.spectra, picture.column(f"{view}/orders", STRIPS), strict=True):
        ends = np.array([np.array(list(bar)) for bar in bars])
        heights = ends[:, 0, 1] - ends[:, 1, 1]
        levels = np.clip(spectrum.level[1:], low, None) - low
        np.testing.assert_allclose(heights / heights.max(), levels / levels.max(), atol=1e-5)
    (strokes,) = picture.column(f"{entity(study, 'level', 'rays')}/orders", STRIPS)
    shown = study.values("level") > loudest(found, "level") - RANGE
    assert len(strokes) == int(shown.sum()) < 0.6 * shown.size
    with pytest.raises(CamRigError, match=r"ends in '.png'; allowed: .rrd"):
        save_orders(found, tmp_path / "a.png")


def test_tabs_and_charts_are_named_in_words(found):
    """A cam by its title, a long one shortened; without one by its name in words."""
    long = "A cam whose title has about forty letters"
    for titles, name in (({}, "Polynomial 3-4-5"), ({"poly345": long}, short(long))):
        (tab,) = orders_tabs(found, titles)
        assert tab.name == name
        charts = [view for row in tab.contents for view in row.contents]
        assert len(charts) == 4 and not any("poly" in str(view.name) for view in charts)
