"""A law as scipy's Bernstein polynomials and back; its derivative as a law."""

import numpy as np
import pytest
from scipy.interpolate import BPoly

import cam_rig
from cam_rig.errors import LawError
from cam_rig.schema.load import config_root

CAMS = sorted(path.stem for path in (config_root() / "cams").glob("*.yaml"))


def laws():
    """All shipped laws."""
    for name in CAMS:
        yield cam_rig.build_law(cam_rig.load_cam(name))


def test_the_way_there_and_back_is_exact():
    """Ordinates and breakpoints bit for bit; scipy's values to rounding, beyond the turn too."""
    angle = np.random.default_rng(1).uniform(-10.0, 20.0, 500)
    for law in laws():
        bpoly = law.to_bpoly()
        again = cam_rig.Law.from_bpoly(bpoly, law.name)
        assert again.name == law.name
        assert np.array_equal(again.breaks, law.breaks)
        assert np.array_equal(again.ordinates, law.ordinates)
        scale = np.abs(law.ordinates).max()
        steepest = law.bounds[1] + scale
        np.testing.assert_allclose(bpoly(angle), law(angle), rtol=0, atol=1e-13 * steepest)


def test_the_derivative_is_a_law():
    """Of any order; also of the derivative that scipy makes."""
    angle = np.linspace(0.0, 6.28, 400)
    for law in laws():
        for order in (1, 2, 3):
            derived = law.derivative(order)
            scale = max(np.abs(derived.ordinates).max(), 1e-300)
            np.testing.assert_allclose(derived(angle), law(angle, order), rtol=0, atol=1e-9 * scale)
            theirs = law.to_bpoly().derivative(order)(angle)
            np.testing.assert_allclose(theirs, law(angle, order), rtol=0, atol=1e-8 * scale)
        assert law.derivative(0).name == law.name


def test_what_is_no_law_for_scipy():
    turn = [0.0, np.pi, 2.0 * np.pi]
    with pytest.raises(TypeError, match=r"bpoly: is .* allowed: a scipy.interpolate.BPoly"):
        cam_rig.Law.from_bpoly([[0.0]])
    with pytest.raises(LawError, match="complex ordinates"):
        cam_rig.Law.from_bpoly(BPoly(np.ones((2, 2)) * 1j, turn))
    with pytest.raises(LawError, match="must rise from 0 to 2π"):
        cam_rig.Law.from_bpoly(BPoly(np.ones((2, 1)), [0.0, 1.0]))
    with pytest.raises(LawError, match="do not fit"):
        cam_rig.Law.from_bpoly(BPoly(np.ones((2, 2, 3)), turn))


def test_its_repr_is_one_short_line_and_its_plot_has_four_panels():
    for law in laws():
        assert len(repr(law)) < 120 and "\n" not in repr(law)
    assert len(law.plot().axes) >= 4
