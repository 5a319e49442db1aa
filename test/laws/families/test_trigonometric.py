"""Trigonometric polynomials: the fit is the sum of waves, all around."""

import mpmath as mp
import numpy as np
import pytest

from cam_rig.laws import build_law
from cam_rig.laws.law import SMOOTHEST, joints, peak
from cam_rig.units import TURN

COSINE, SINE, MEAN = [-0.4, 0.05, 0, 0.02], [0.1, -0.03, 0.01], 0.5
LIFT = 0.05


@pytest.fixture(scope="module")
def wavy(make_cam):
    segment = {"law": "trigonometric", "span": 360, "mean": MEAN, "cosine": COSINE, "sine": SINE}
    return build_law(make_cam(segment, lift=LIFT))


@pytest.mark.parametrize(("order", "tolerance"), [(0, 1e-14), (1, 1e-13), (2, 1e-12), (3, 1e-11)])
def test_against_fifty_digits(wavy, order, tolerance):
    """Value and derivatives of eq. 2.2, relative to their peaks."""
    angles = np.linspace(0.0, TURN, 97)

    def exact(theta):
        total = mp.mpf(MEAN) if order == 0 else mp.mpf(0)
        for waves, phase in ((COSINE, order), (SINE, order - 1)):
            for i, size in enumerate(waves, start=1):
                total += mp.mpf(size) * mp.mpf(i) ** order * mp.cos(i * theta + phase * mp.pi / 2)
        return total

    with mp.workdps(50):
        expected = LIFT * np.array([float(exact(mp.mpf(x))) for x in angles])
    np.testing.assert_allclose(
        wavy(angles, order), expected, rtol=0, atol=tolerance * np.abs(expected).max()
    )


def test_smooth_everywhere(wavy):
    """No joint between the pieces of the fit, nor where the turn closes, is seen at C4."""
    assert {joint.continuity for joint in joints(wavy)} == {SMOOTHEST}


def test_fifty_harmonics(make_cam):
    """The highest harmonic allowed is followed: its slope is 50 times its size."""
    cosine = [0.0] * 49 + [0.5]
    law = build_law(make_cam({"law": "trigonometric", "span": 360, "mean": 0.5, "cosine": cosine}))
    assert law.lift == pytest.approx(LIFT, rel=1e-12)
    assert abs(peak(law, 1).value) == pytest.approx(25.0 * LIFT, rel=1e-12)
    assert abs(peak(law, 3).value) == pytest.approx(0.5 * 50**3 * LIFT, rel=1e-10)


def test_shipped_law_is_flat_at_both_ends(laws):
    """Its velocity is 15/16 sin⁵: five derivatives vanish at the bottom and at the top."""
    law = laws["trigonometric"]
    angles = np.linspace(0.0, TURN, 61)
    np.testing.assert_allclose(
        law(angles, 1) / LIFT, 15 / 16 * np.sin(angles) ** 5, rtol=0, atol=1e-13
    )
