"""Polydyne cams and shaped rises: identities, residual vibration, and refusals."""

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.vibration import residual_vibration, steady_turn
from cam_rig.errors import CamRigError
from cam_rig.laws import build_law
from cam_rig.laws.law import continuity
from cam_rig.schema.load import load_rig, rig_path
from cam_rig.units import RPM

FOLLOWER = {"type": "point", "base_radius": 0.04}
#: Largest amplitude (m) of a tuned cam that is rounding.
ROUNDING_M = 1e-12


def cam_of(rise, rig="paper_table2", rpm=300.0, lift=0.05, span=117.5, **keys):
    """Return a cam with a rise, its fall, and dwells. A tuned rise has speed and rig."""
    speed = {"speed": rpm * RPM, "rig": rig}
    if "shaping" in keys:
        keys["shaping"] = {"kind": keys["shaping"], **speed}
    elif rise == "polydyne":
        keys |= speed
    events = [{"law": rise, "span": math.radians(span), "to": to, **keys} for to in (1.0, 0.0)]
    dwell = {"law": "dwell", "span": math.radians(180.0 - span)}
    segments = [events[0], dwell, events[1], dwell]
    return cam_rig.Cam("tuned", lift=lift, segments=segments, follower=FOLLOWER)


@pytest.fixture(scope="module")
def stem():
    """Follower of the rig as one mass on its stem."""
    return FollowerParameters.from_rig(
        cam_rig.load_rig(cam_rig.schema.load.rig_path("paper_table2"))
    )


def amplitudes(law, stem, *rpm):
    """Return the residual amplitudes (m) of a law at speeds in rpm."""
    return residual_vibration(law, stem, RPM * np.array(rpm))


def test_the_mass_of_a_polydyne_cam_makes_the_motion(stem, laws):
    """At its speed the mass makes the motion of the follower's law, to rounding.

    Its motion has the static fraction of the lift.
    """
    law = build_law(cam_of("polydyne", follower="poly4567"))
    turn = steady_turn(law, stem, 300.0 * RPM)
    rigid = build_law(cam_of("poly4567"))
    fraction = stem.stem / (stem.stem + stem.spring_stiffness)
    np.testing.assert_allclose(turn.displacement, fraction * rigid(turn.angle), rtol=0, atol=1e-14)
    assert law.lift == pytest.approx(0.05, rel=1e-9)


def test_residual_vibration_of_shipped_cams(stem, laws):
    """At 300 rpm the tuned cams rest in the dwell, at 400 rpm they do not."""
    assert amplitudes(laws["poly4567"], stem, 300)[0] == pytest.approx(2.56e-6, rel=2e-3)
    for name, other in (("polydyne_300", 3.436e-6), ("shaped_300", 2.35e-6)):
        tuned, detuned = amplitudes(laws[name], stem, 300, 400)
        assert tuned < ROUNDING_M
        assert detuned == pytest.approx(other, rel=2e-3)


@pytest.mark.parametrize("rise", ["poly4567", "bezier9", "poly7", "harmonic_combination"])
def test_a_polydyne_cam_is_its_formula_in_fifty_digits(stem, rise):
    """s to s'' of a polydyne cam are those of x̂ + (c ω x̂' + m ω² x̂'')/(k + k_s)."""
    law, base = (
        build_law(cam_of(name, **keys))
        for name, keys in (("polydyne", {"follower": rise}), (rise, {}))
    )
    speed, angle = 300.0 * RPM, np.linspace(0.05, 2.0, 23)
    total = stem.stem + stem.spring_stiffness
    for order in range(3):
        terms = [base(angle, order + k) for k in range(3)]
        exact = (
            terms[0]
            + stem.damping * speed / total * terms[1]
            + stem.mass * speed**2 / total * terms[2]
        )
        scale = np.abs(exact).max()
        np.testing.assert_allclose(law(angle, order), exact, rtol=0, atol=1e-11 * scale)


def test_a_polydyne_cam_has_the_class_of_its_motion_less_two():
    """The class of a polydyne cam is that of the follower's motion less two."""
    for name, order in (("poly345", 0), ("poly4567", 1), ("bezier9", 2)):
        assert continuity(build_law(cam_of("polydyne", follower=name))) == order


def test_shaping_is_the_sum_of_delayed_copies(stem):
    """A shaped rise is the sum of copies with the amplitudes of the decay, in 50 digits."""
    beta = math.radians(117.5)
    with mp.workdps(50):
        rate = mp.sqrt((mp.mpf(stem.stem) + stem.spring_stiffness) / stem.mass)
        ratio = stem.damping / (2 * stem.mass * rate)
        damped = mp.sqrt(1 - ratio**2)
        delay, decay = 300 * RPM * mp.pi / (rate * damped), mp.exp(-mp.pi * ratio / damped)

        def rise(u):
            u = min(max(u, mp.mpf(0)), mp.mpf(1))
            return u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)

        for kind, sizes in (("ZV", (1, decay)), ("ZVD", (1, 2 * decay, decay**2))):
            law = build_law(cam_of("poly4567", shaping=kind))
            width, total = beta - (len(sizes) - 1) * delay, mp.fsum(sizes)
            for angle in np.linspace(0.0, beta, 33):
                exact = mp.fsum(
                    size / total * rise((mp.mpf(float(angle)) - i * delay) / width)
                    for i, size in enumerate(sizes)
                )
                assert float(law(angle)) == pytest.approx(float(exact) * 0.05, abs=2e-16)


@pytest.mark.parametrize("kind", ["ZV", "ZVD"])
@pytest.mark.parametrize("rise", ["poly345", "simple_harmonic", "scca", "gutman13", "cycloidal"])
def test_any_rise_can_be_shaped(stem, rise, kind):
    """A shaped rise of any law rests at its speed, and keeps the class of the law."""
    law, plain = build_law(cam_of(rise, shaping=kind)), build_law(cam_of(rise))
    assert amplitudes(law, stem, 300)[0] < 1e3 * ROUNDING_M < amplitudes(plain, stem, 300)[0]
    assert continuity(law) == continuity(plain)


def test_more_copies_are_less_sensitive_to_the_speed(stem):
    """Next to its speed ZVD vibrates less than ZV, and ZV less than the law itself."""
    plain = build_law(cam_of("poly345"))
    shaped = [build_law(cam_of("poly345", shaping=kind)) for kind in ("ZV", "ZVD")]
    sizes = [amplitudes(law, stem, 305)[0] for law in (plain, *shaped)]
    assert sizes[2] < 0.2 * sizes[1] < 0.2 * sizes[0]


@given(
    st.floats(10.0, 170.0),
    st.floats(1e-6, 1.0),
    st.floats(50.0, 400.0),
    st.sampled_from(("polydyne", "ZV", "ZVD")),
)
def test_tuned_cams_of_any_size_rest_at_their_speed(span, lift, rpm, kind):
    """Tuned cams of any span, lift and speed rest at their speed, or their span is too short."""
    keys = {"follower": "poly4567"} if kind == "polydyne" else {"shaping": kind}
    rise = kind if kind == "polydyne" else "poly4567"
    follower = FollowerParameters.from_rig(load_rig(rig_path("paper_table2")))
    try:
        law = build_law(cam_of(rise, rpm=rpm, lift=lift, span=span, **keys))
    except CamRigError as error:
        assert "(lengthen the span, " in str(error) or "lift is" in str(error)
        return
    assert free_vibration(law, math.radians(span), follower, rpm * RPM) < 1e-8


def free_vibration(law, span, stem, speed):
    """Return the free vibration that a rise leaves, relative to a rise of the worst shape.

    It is the integral of m s̈ + c ṡ times the free motion of the mass backwards in time.
    """
    total = stem.stem + stem.spring_stiffness
    rate = np.roots([stem.mass, stem.damping, total])[0]
    x, weights = np.polynomial.legendre.leggauss(40)
    angles, sizes = [], []
    for start, length in zip(law.breaks[:-1], law.spans, strict=True):
        if start < span * (1.0 - 1e-9):
            count = max(1, math.ceil(length * abs(rate) / speed))
            for k in range(count):
                part = length / count
                angles.append(start + part * (k + 0.5 * (x + 1.0)))
                sizes.append(0.5 * part * weights)
    angle, size = np.concatenate(angles), np.concatenate(sizes) / speed
    force = stem.mass * speed**2 * law(angle, 2) + stem.damping * speed * law(angle, 1)
    free = np.exp(-rate * angle / speed) * size
    return abs(np.sum(force * free)) / np.sum(np.abs(force) * np.abs(free))


#: Law, further arguments of `cam_of`, and the message.
REFUSALS = (
    (
        "poly345",
        {"shaping": "ZVD", "span": 10.0},
        "segments[0]: span is 10°, ZVD delays by 11.4696°; allowed: at least 12.744°",
    ),
    (
        "bezier4_start",
        {"shaping": "ZV"},
        "segments[0]: shaping: the law is bezier4_start; allowed: a rise between rests",
    ),
    (
        "constant_velocity",
        {"shaping": "ZV"},
        "segments[0]: shaping: the law is constant_velocity; allowed: a rise between rests",
    ),
    (
        "poly345",
        {"shaping": "ZVX"},
        "shaping.kind: is 'ZVX' (did you mean 'ZV'?); allowed: 'ZV' or 'ZVD'",
    ),
    (
        "polydyne",
        {"follower": "simple_harmonic"},
        "segments[0]: follower is 'simple_harmonic' of class C1; allowed: a rise between dwells of "
        "class C2 or smoother",
    ),
    (
        "polydyne",
        {"follower": "bezier8_start"},
        "segments[0]: follower is 'bezier8_start' (did you mean 'bezier9'?); allowed: a rise",
    ),
    (
        "polydyne",
        {"follower": "poly4566"},
        "segments[0]: follower is 'poly4566' (did you mean 'poly4567'?); allowed: a rise",
    ),
    ("polydyne", {"follower": "poly4567", "rig": "tm22"}, "tm22.yaml: no such file (did you mean"),
    ("polydyne", {"follower": "poly4567", "rig": 3}, "segments[0].rig: is 3; allowed: the name of"),
    ("polydyne", {"follower": "poly4567", "rig": "../x"}, "rig: rigs: is '../x'; allowed: a name"),
    ("polydyne", {"follower": "poly4567", "rpm": -3.0}, "allowed: greater than 0 rad/s"),
    ("polydyne", {"follower": "poly4567", "rpm": math.nan}, "speed: is nan; allowed: finite"),
    ("polydyne", {"follower": "poly4567", "rpm": 1e5}, "mm; allowed: the same within 2 %"),
    ("polydyne", {"follower": "poly4567", "rpm": 1e8}, "allowed: at most 1e+06 rad/s"),
)


@pytest.mark.parametrize(("rise", "keys", "message"), REFUSALS)
def test_impossible_tunings_are_refused(rise, keys, message):
    """An impossible tuning is refused in one line with segment, value, limit and remedy."""
    with pytest.raises(CamRigError) as caught:
        build_law(cam_of(rise, **keys))
    assert message in str(caught.value) and "\n" not in str(caught.value)
    assert str(caught.value).startswith("cam 'tuned': ")


def test_a_stem_that_does_not_oscillate_is_refused(paper_rig):
    """A rig without stem, or with an overdamped stem, is refused by its name."""
    soft = paper_rig.replace(follower={**dict(paper_rig.follower), "damping": 1e4})
    with pytest.raises(CamRigError, match=r"damping ratio of the stem of paper_table2 is 3\.9"):
        build_law(cam_of("poly4567", rig=soft, shaping="ZV"))
    stiff = paper_rig.replace(follower={**dict(paper_rig.follower), "stem_stiffness": None})
    with pytest.raises(CamRigError, match=r"'paper_table2' without stem_stiffness; allowed: a rig"):
        cam_of("poly4567", rig=stiff, shaping="ZV")


def test_a_saved_tuned_cam_contains_the_numbers_of_its_rig(tmp_path, cams):
    """A tuned cam that is saved and read again has the same law, without the rig's file.

    The numbers of the rig are not among those of the cam.
    """
    for name in ("polydyne_300", "shaped_300"):
        cam = cams[name]
        cam.save(tmp_path / f"{name}.yaml")
        again = cam_rig.load_cam(tmp_path / f"{name}.yaml")
        np.testing.assert_array_equal(build_law(again).ordinates, build_law(cam).ordinates)
        assert not [key for key in cam.numbers() if "rig" in key]


def test_a_rig_next_to_the_cam_is_used(tmp_path, config_dir, laws):
    """The rig of a tuned cam is searched for next to the folder of the cam first."""
    rig = (config_dir / "rigs" / "paper_table2.yaml").read_text(encoding="utf-8")
    cam = (config_dir / "cams" / "polydyne_300.yaml").read_text(encoding="utf-8")
    (tmp_path / "rigs").mkdir()
    (tmp_path / "cams").mkdir()
    soft = rig.replace("given: 1.3,", "given: 2.6,")
    (tmp_path / "rigs" / "paper_table2.yaml").write_text(soft, encoding="utf-8")
    (tmp_path / "cams" / "polydyne_300.yaml").write_text(cam, encoding="utf-8")
    law = build_law(cam_rig.load_cam(tmp_path / "cams" / "polydyne_300.yaml"))
    assert np.abs(law.ordinates - laws["polydyne_300"].ordinates).max() > 1e-6
