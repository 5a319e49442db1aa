"""Rises of the handbooks: members of families, peak factors, and names of laws."""

import math
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cam_rig.errors import ConfigError
from cam_rig.laws import bernstein, build_law
from cam_rig.laws.bernstein import join_pieces
from cam_rig.laws.catalogue import rise_curves, rise_figures
from cam_rig.laws.families import FAMILIES, family_rise, mirror
from cam_rig.laws.law import continuity, extremes, joints
from cam_rig.laws.segments import unit_rise
from cam_rig.schema.law_names import LAW_NAMES, MANUALS, law_name
from cam_rig.schema.motions import MOTIONS
from cam_rig.schema.segments import SEGMENT_LAWS

from ..conftest import dwell, rise

#: Shares b, c and d of the members of the family of sine, constant and cosine acceleration.
MEMBERS = {
    "modified_trapezoid": (0.25, 0.5, 0.25),
    "simple_harmonic": (0.0, 0.0, 1.0),
    "modified_sine": (0.25, 0.0, 0.75),
    "cycloidal": (0.5, 0.0, 0.5),
}
#: Peak velocity and acceleration that handbooks print, to their digits, and the class.
PRINTED = {
    "poly5": ("1.8750", "5.7735", 2),
    "poly7": ("2.1875", "7.5132", 3),
    "harmonic_combination": ("2.3562", "8.5473", 3),
    "sine_line_combination": ("2.0000", "6.2832", 2),
    "scca": ("2.0000", "4.8881", 2),
    "modified_constant_velocity": ("1.2753", "8.0127", 2),
    "parabolic": ("2.0000", "4.0000", 1),
    "double_harmonic": ("2.0405", "9.8696", 1),
    "gutman13": ("2.0000", "5.1302", 2),
    "freudenstein13": ("2.0000", "5.3856", 2),
    "freudenstein135": ("2.0000", "5.0603", 2),
    "poly8": ("1.7767", "5.2683", 1),
    "low_impact_crossover": ("1.4583", "6.5066", 2),
}


def derivatives(pieces, u):
    """Return s to s''' of pieces at abscissae inside of pieces, ``(4, len(u))``."""
    breaks, columns = pieces
    ordinates, spans = join_pieces(columns), np.diff(breaks)
    i = np.clip(np.searchsorted(breaks, u, side="right") - 1, 0, spans.size - 1)
    rows = []
    for _ in range(4):
        local = (u - np.array(breaks)[i]) / spans[i]
        rows.append(
            [bernstein.evaluate(ordinates[:, k], x)[0] for k, x in zip(i, local, strict=True)]
        )
        ordinates = bernstein.derivative(ordinates) / spans
    return np.array(rows)


def test_peak_factors_are_those_of_the_handbooks():
    """Peak factors and classes of all rises of the handbooks have the printed digits."""
    assert PRINTED.keys() == FAMILIES.keys()
    for name, (velocity, acceleration, order) in PRINTED.items():
        figures = rise_figures(name)
        assert f"{figures.peak_velocity:.4f}" == velocity, name
        assert f"{figures.peak_acceleration:.4f}" == acceleration, name
        assert figures.continuity == order, name


@pytest.mark.parametrize("name", MEMBERS)
def test_members_of_the_family_are_the_named_rises(name):
    """A member of the family is the rise with its own formula, to rounding."""
    u = np.linspace(0.003, 0.997, 71)
    shares = dict(zip("bcd", MEMBERS[name], strict=True))
    result, expected = (
        derivatives(pieces, u) for pieces in (family_rise("scca", shares), unit_rise(name))
    )
    for order, limit in enumerate((1e-14, 1e-13, 1e-12, 2e-11)):
        scale = np.abs(expected[order]).max()
        np.testing.assert_allclose(result[order], expected[order], rtol=0, atol=limit * scale)


def quarter_waves(b, c, d, constant_velocity, share):
    """Return lengths, shapes and signs of the accelerations of a rise, with 50 digits.

    A shape is the function of 0 to 1 that is the acceleration in the part.
    """
    up, flat, down = (lambda x: mp.sin(mp.pi * x / 2), lambda x: 1, lambda x: mp.cos(mp.pi * x / 2))
    first = (1 - constant_velocity) * share
    second = (1 - constant_velocity) * (1 - share)
    parts = [(b * first, up, 1), (c * first, flat, 1), (d * first, down, 1)]
    parts += [(constant_velocity, flat, 0)]
    ratio = -first / second
    parts += [(d * second, up, ratio), (c * second, flat, ratio), (b * second, down, ratio)]
    return parts


@pytest.mark.parametrize(
    "shares",
    [
        ("0.25", "0.5", "0.25", "0", "0.5"),
        ("0.25", "0", "0.75", "0.2", "0.5"),
        ("0.25", "0", "0.75", "0.33", "0.5"),
        ("0.25", "0", "0.75", "0.66", "0.5"),
        ("0.4", "0.2", "0.4", "0.1", "0.3"),
        ("0", "1", "0", "0", "0.7"),
    ],
)
def test_the_family_is_the_integral_of_its_quarter_waves(shares):
    """Level and slope at the ends of the parts are integrals of the accelerations.

    The integrals have 50 digits.
    """
    with mp.workdps(50):
        numbers = [mp.mpf(share) for share in shares]
        level, slope, edges = mp.mpf(0), mp.mpf(0), [(mp.mpf(0), mp.mpf(0), mp.mpf(0))]
        for width, shape, size in quarter_waves(*numbers):
            if width == 0:
                continue
            area = size * width * mp.quad(shape, [0, 1])
            moment = size * width**2 * mp.quad(lambda x, f=shape: (1 - x) * f(x), [0, 1])
            level, slope = level + slope * width + moment, slope + area
            edges.append((edges[-1][0] + width, level, slope))
        expected = [(float(u), float(s / level), float(v / level)) for u, s, v in edges[1:-1]]
    keys = ("b", "c", "d", "constant_velocity", "acceleration_share")
    pieces = family_rise("scca", dict(zip(keys, map(float, shares), strict=True)))
    values = derivatives(pieces, np.array([u for u, _, _ in expected]))
    np.testing.assert_allclose(values[0], [s for _, s, _ in expected], rtol=0, atol=1e-14)
    np.testing.assert_allclose(values[1], [v for _, _, v in expected], rtol=0, atol=1e-13)


CLOSED_FORMS = {
    "double_harmonic": lambda u: (1 - mp.cos(mp.pi * u)) / 2 - (1 - mp.cos(2 * mp.pi * u)) / 8,
    "gutman13": lambda u: (
        u - 15 * mp.sin(2 * mp.pi * u) / (32 * mp.pi) - mp.sin(6 * mp.pi * u) / (96 * mp.pi)
    ),
    "freudenstein13": lambda u: (
        u - (27 * mp.sin(2 * mp.pi * u) / 28 + mp.sin(6 * mp.pi * u) / 84) / (2 * mp.pi)
    ),
    "freudenstein135": lambda u: (
        u
        - mp.mpf(1125)
        / 1192
        / (2 * mp.pi)
        * (mp.sin(2 * mp.pi * u) + mp.sin(6 * mp.pi * u) / 54 + mp.sin(10 * mp.pi * u) / 1250)
    ),
    "poly8": lambda u: sum(
        mp.mpf(text) * u**power
        for text, power in (
            ("6.09755", 3),
            ("-20.78040", 5),
            ("26.73155", 6),
            ("-13.60965", 7),
            ("2.56095", 8),
        )
    ),
    "low_impact_crossover": lambda u: (
        mp.mpf(1) / 2
        + 35 * (2 * u - 1) / mp.mpf(48)
        - 7 * (2 * u - 1) ** 5 / mp.mpf(16)
        + 5 * (2 * u - 1) ** 7 / mp.mpf(24)
    ),
}


@pytest.mark.parametrize("name", CLOSED_FORMS)
def test_derivatives_agree_with_differences_of_fifty_digits(name):
    """s to s''' of a rise agree with differences of its formula in 50 digits."""
    u = np.linspace(0.01, 0.99, 13)
    result = derivatives(unit_rise(name), u)
    with mp.workdps(50):
        expected = np.array(
            [
                [float(mp.diff(CLOSED_FORMS[name], mp.mpf(x), order)) for x in u]
                for order in range(4)
            ]
        )
    for order, limit in enumerate((1e-14, 1e-13, 1e-12, 1e-11)):
        scale = np.abs(expected[order]).max()
        np.testing.assert_allclose(result[order], expected[order], rtol=0, atol=limit * scale)


def test_the_crossover_has_neither_acceleration_nor_jerk():
    """In the middle of the low-impact crossover s'' and s''' are zero, s is one half."""
    values = derivatives(unit_rise("low_impact_crossover"), np.array([0.5]))[:, 0]
    assert values == pytest.approx([0.5, 35 / 24, 0.0, 0.0], abs=1e-13)


@given(
    st.floats(1.0, 300.0),
    st.floats(1e-6, 1.0),
    st.sampled_from([name for name in PRINTED if name not in MOTIONS]),
    st.booleans(),
)
def test_a_rise_of_any_span_and_lift_has_its_peak_factors(make_cam, span, lift, name, mirrored):
    """The law of a cam with a rise has its peaks times lift over powers of the span."""
    low = 360.0 - span - 30.0
    segment = rise(span, 1.0, name) | {"mirrored": mirrored}
    law = build_law(make_cam(segment, rise(30.0, 0.0), dwell(low), lift=lift))
    figures, beta = rise_figures(name), math.radians(span)
    assert law.lift == pytest.approx(lift, rel=1e-12)
    own = law.breaks[:-1] < beta * (1.0 - 1e-9)
    for order, factor in ((1, figures.peak_velocity), (2, figures.peak_acceleration)):
        u = np.linspace(0.0, 1.0, 401)
        values = bernstein.evaluate(law.derivative_ordinates(order)[:, own], u)
        assert np.abs(values).max() == pytest.approx(factor * lift / beta**order, rel=2e-4)


def test_a_mirrored_rise_is_the_rise_backwards():
    """A mirrored rise is 1 − s(1 − u): a reversal at its start instead of at its end."""
    u = np.linspace(0.01, 0.99, 9)
    result = derivatives(mirror(unit_rise("poly8")), u)
    expected = derivatives(unit_rise("poly8"), 1.0 - u)
    np.testing.assert_allclose(result[0], 1.0 - expected[0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(result[1:], expected[1:] * [[1], [-1], [1]], rtol=0, atol=1e-11)


@pytest.mark.parametrize("share", [0.1, 0.3, 0.8])
def test_a_skewed_rise_keeps_its_class_and_shifts_its_peak(make_cam, share):
    """A skewed rise is C2 and accelerates in its share of the span.

    The peaks of acceleration and deceleration are in the inverse ratio of their times.
    """
    segment = rise(100.0, 1.0, "scca") | {"acceleration_share": share}
    law = build_law(make_cam(segment, rise(100.0, 0.0, "poly4567"), dwell(160.0)))
    assert continuity(law) == 2
    fastest = extremes(law, 1)[1]
    assert math.degrees(fastest.angle) == pytest.approx(100.0 * share, abs=1e-4)
    symmetric, beta = rise_figures("scca"), math.radians(100.0)
    assert fastest.value == pytest.approx(symmetric.peak_velocity * 0.05 / beta, rel=1e-12)
    u = np.array([0.5 * share, 1.0 - 0.5 * (1.0 - share)])
    up, down = law(beta * u, 2)
    assert up / -down == pytest.approx((1.0 - share) / share, rel=1e-11)


def test_the_curve_of_the_parabola_has_a_jump_in_the_middle():
    """The acceleration of the parabolic rise is 4, then −4."""
    curve = rise_curves("parabolic")
    assert np.unique(np.round(curve.motion[2], 9)).tolist() == [-4.0, 4.0]


# Names of laws.


def test_each_other_name_belongs_to_one_law():
    """Each name in the table leads to its law, in any case and spelling."""
    for row in LAW_NAMES:
        assert row.law in SEGMENT_LAWS
        for name in row.names:
            for spelling in (name, name.upper(), name.replace(" ", "_"), name.replace("-", "")):
                assert law_name(spelling) == row.law
    assert law_name("MOTIONFUNCTYPE_BESTEHORN") == "cycloidal"
    assert law_name("Low-impact crossover") == "low_impact_crossover"
    assert law_name("double harmonic") == "double_harmonic"
    assert {law_name(name) for name in SEGMENT_LAWS} == set(SEGMENT_LAWS)
    assert set(MANUALS) == {"twincat", "codesys", "siemens"}


def test_the_page_of_laws_has_the_table_of_names():
    """The table of names in docs/laws.md is that of the code."""
    page = (Path(__file__).parents[2] / "docs" / "laws.md").read_text(encoding="utf-8")
    table = page.partition("| law | TwinCAT |")[2].partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    columns = ("twincat", "codesys", "siemens", "other")
    assert cells == [
        [f"`{row.law}`", *(getattr(row, column) for column in columns)] for row in LAW_NAMES
    ]
    assert all(manual in page for manual in MANUALS.values())


def test_a_cam_accepts_another_name_of_a_law(make_cam):
    """A cam file with another name of a law has the law of the table."""
    other = make_cam(rise(180.0, 1.0, "Inclined Sine"), rise(180.0, 0.0, "MODSINUSLINIE"))
    assert [segment.law for segment in other.segments] == ["cycloidal", "modified_sine"]
    with pytest.raises(Exception, match=r"law: is 'simple sinus' .did you mean 'simple sine'."):
        make_cam(rise(180.0, 1.0, "simple sinus"), rise(180.0, 0.0))


#: Keys of a rise, and the message that refuses them.
REFUSALS = (
    (
        {"b": 0.5},
        "b, c, d: are 0.5, 0.5, 0.25 with the sum 1.25; allowed: a sum of 1, so give all three",
    ),
    ({"b": 1e-5, "c": 1 - 1e-5, "d": 0.0}, "b: is 1e-05; allowed: 0, or at least 0.001"),
    ({"acceleration_share": 0.05}, "acceleration_share: is 0.05; allowed: 0.1 to 0.9"),
    ({"acceleration_share": 0.95}, "acceleration_share: is 0.95; allowed: 0.1 to 0.9"),
    ({"constant_velocity": 0.99}, "constant_velocity: is 0.99; allowed: 0 to 0.95"),
    (
        {"constant_velocity": -0.1},
        "constant_velocity: is -0.1; allowed: at least 0",
    ),
    ({"b": math.nan}, "b: is nan; allowed: finite numbers"),
    ({"to": math.nan}, "to: is nan; allowed: a finite number"),
    ({"to": 1.5}, "to: is 1.5; allowed: less than or equal to 1"),
    ({"to": {"unit": "mm"}}, "to: has none; allowed: exactly one of given, assumed, identified"),
    ({"to": {"given": "x", "unit": "mm"}}, "to.given: is 'x'; allowed: a valid number"),
    ({"to": "20 kg"}, "to: has unit 'kg', not a length; allowed: m, cm, mm, um, in"),
    ({"mirrored": 1}, "mirrored: is 1; allowed: a valid boolean"),
)


@pytest.mark.parametrize(("keys", "message"), REFUSALS)
def test_wrong_parameters_are_refused(keys, message):
    """A wrong parameter is refused with the segment, its value and the limit."""
    import cam_rig

    segment = {"law": "scca", "span": "180 deg", "to": 1.0, **keys}
    with pytest.raises(ConfigError) as caught:
        cam_rig.Cam(
            "wrong",
            lift="20 mm",
            segments=[segment, {"law": "poly345", "span": "180 deg", "to": 0.0}],
            follower={"type": "point", "base_radius": 0.04},
        )
    text = str(caught.value)
    assert text.startswith("cam 'wrong': segments[0]") and text.endswith(message)


def test_a_level_may_be_a_length(make_cam):
    """The level of any segment may be a fraction of the lift, or a length."""
    length = {"assumed": 12.5, "unit": "mm"}
    law = build_law(
        make_cam(
            rise(90.0, 1.0, "gutman13"),
            rise(90.0, 0.0, "poly345") | {"to": length},
            rise(90.0, 0.0, "poly8") | {"mirrored": True},
            dwell(90.0),
        )
    )
    assert float(law(math.pi)) == pytest.approx(0.0125, rel=1e-14)
    assert [joint.continuity for joint in joints(law) if joint.angle < 1e-9] == [2]
