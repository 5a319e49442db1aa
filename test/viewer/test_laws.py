"""The recording of laws shows their own curves, in one chart for each derivative."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cam_rig.errors import CamRigError
from cam_rig.laws.catalogue import ORDERS, rise_curves
from cam_rig.laws.chart import entity, save_laws

from .conftest import Picture

NAMES = ("poly345", "cycloidal", "simple_harmonic")
UNITS = ("h", "h/β", "h/β²", "h/β³")


def test_each_curve_is_the_law(tmp_path: Path) -> None:
    """Heights in the chart are the values, to a scale that all laws of the chart share."""
    path, curves = tmp_path / "a.rrd", [rise_curves(name) for name in NAMES]
    save_laws(curves, "u", UNITS, path)
    picture = Picture(path)
    for order in ORDERS:
        drawn, values = [], []
        for curve in curves:
            (strips,) = picture.column(f"{entity(order)}/{curve.name}", "LineStrips2D:strips")
            drawn.append(np.array([list(point) for point in strips[0]])[:, 1])
            values.append(curve.motion[order])
        scale, start = np.polyfit(np.concatenate(values), np.concatenate(drawn), 1)
        assert scale < 0.0  # the plane's y is down
        fitted = scale * np.concatenate(values) + start
        np.testing.assert_allclose(np.concatenate(drawn), fitted, atol=1e-4)


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    """As no viewer opens it."""
    with pytest.raises(CamRigError, match=r"ends in '.png'; allowed: .rrd"):
        save_laws([rise_curves("poly345")], "u", UNITS, tmp_path / "a.png")
