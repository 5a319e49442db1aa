"""Tests of the identification of simulated rigs from force and lift.

The true parameters are known. 4 standard errors are allowed.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit
from scipy.signal import lfilter

import cam_rig
from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.errors import ConfigError
from cam_rig.studies.fit_rig.run.fit import fit_run
from cam_rig.studies.fit_rig.run.noise_model import estimate_force_noise

from .machines import jump_rpm

IN_CONTACT, WITH_FLIGHTS = (150.0, 220.0, 290.0, 350.0, 410.0), (200.0, 350.0, 460.0)
#: Instrument errors of simulated runs, with half the default sample rates (Hz) to save time.
QUICK = InstrumentErrors(rate=800, encoder_rate=800)


def numbers(fit):
    return {number.name: number for number in fit.numbers}


def gauge(fit, key):
    return next(one.value for one in fit.instruments if one.key == key)


def require_true(fit, rig, *names):
    """Require that a fit identifies `names` and is correct.

    All errors must be below 4 standard errors.
    """
    found = {n.name: (n.value - getattr(rig.follower, n.name).si) / n.error for n in fit.identified}
    assert set(names) <= set(found)
    assert found and max(map(abs, found.values())) < 4.0, found


def machine(cam, rig, **changes):
    """Return a law, a rig with changed parameters, and its jump speed (rpm).

    The follower is taken as rigid.
    """
    law = cam_rig.build_law(cam_rig.load_cam(cam))
    rig = cam_rig.load_rig(rig).with_follower(**changes)
    return law, rig, jump_rpm(law, rig)


def test_fit_agrees_with_scipy(law, rig):
    """The rig fit agrees with scipy's `curve_fit` of closed forms of force and lift.

    Values agree within 5 % of their standard errors, and standard errors within 10 %.
    """
    errors = replace(QUICK, counts=0)
    run = measured_run(law, rig, "one_mass", IN_CONTACT, errors, 3)
    fit = fit_run(law, run, rig, "one_mass")
    like, x = fit.solution.likelihood, fit.solution.x
    count = len(like.segments)
    speeds = [like.speed_of(x, i) for i in range(count)]
    data = np.concatenate([v for h in like.segments for v in (h.lift.value, h.force.value)])
    deviations = (
        (np.full(segment.lift.value.size, like.lift_noise), like.force_deviation(i))
        for i, segment in enumerate(like.segments)
    )
    sigma = np.concatenate([part for both in deviations for part in both])

    def shown(_, m, k, preload, c, zero, clock, *phases):
        parts = []
        for segment, speed, phase in zip(like.segments, speeds, phases, strict=True):
            rate, begin = speed * (1.0 + 1e-6 * clock), segment.angle + phase
            parts.append(law.motion_at(begin + rate * segment.lift.since)[0] + zero)
            s, slope, bend = law.motion_at(begin + rate * segment.force.since)
            parts.append(m * speed**2 * bend + c * speed * slope + k * s + preload)
        return np.concatenate(parts)

    phases = x[like.instruments.phases]
    start = [1.0, 3000.0, 5.0, 5.0, 0.0, 0.0, *phases]
    found, covariance = curve_fit(
        *(shown, None, data, start, sigma),
        absolute_sigma=True,
        method="trf",
        x_scale=np.abs(start) + 1e-3,
    )
    errors = np.sqrt(np.diag(covariance))
    for k, name in enumerate(("mass", "spring_stiffness", "preload", "damping")):
        number = numbers(fit)[name]
        assert abs(number.value - found[k]) < 0.05 * errors[k], name
        assert number.error == pytest.approx(errors[k], rel=0.1), name  # errors may correlate


@pytest.mark.long
def test_flights_identify_the_restitution(law, rig):
    """Speeds with flights identify all follower parameters and instrument errors.

    They are above the jump speed. The restitution follows from the bounces. In flight the force is
    zero, so the sensor's reading there is its zero error, which is then not attributed to the
    preload.
    """
    other = rig.with_follower(restitution=0.3)
    run = measured_run(law, other, "one_mass", WITH_FLIGHTS, seed=4)
    fit = fit_run(law, run, rig, "one_mass")
    require_true(fit, other, "restitution")
    assert gauge(fit, "clock_drift") == pytest.approx(200e-6, abs=5e-6)
    assert np.degrees(gauge(fit, "encoder_offset")) == pytest.approx(3.0 - 180.0 / 1024, abs=0.03)
    assert gauge(fit, "lift_noise") == pytest.approx(10e-6, rel=0.05)
    assert [segment.lift_offs > 0 for segment in fit.segments] == [False, False, True]
    fit = fit_run(law, with_force(run, run.force.value - 12.0), rig, "one_mass")
    assert gauge(fit, "force_zero") == pytest.approx(-12.0, abs=0.5)
    assert numbers(fit)["mass"].value == pytest.approx(1.3, abs=0.005)


def test_a_coarse_encoder_s_zero_has_the_error_of_its_steps(law, rig):
    """The zero angle of a coarse encoder is within 4 of its standard errors.

    The encoder has 100 counts per turn. The standard error includes the error of the encoder's
    steps. From the noise of the lift alone, zero and clock were 20 standard errors off.
    """
    errors = replace(QUICK, counts=100)
    fit = fit_run(law, measured_run(law, rig, "one_mass", IN_CONTACT[:2], errors, 1), rig)
    true = {"encoder_offset": errors.offset - np.pi / errors.counts, "clock_drift": errors.clock}
    found = {one.key: one for one in fit.instruments}
    off = {k: (found[k].value - value) / found[k].error for k, value in true.items()}
    assert max(map(abs, off.values())) < 4.0, off


def test_contact_identifies_no_restitution(law, rig):
    """The restitution of a follower that stays in contact is not identified.

    Lifts without forces then identify no parameter, because the lift is that of the law.
    """
    run = measured_run(law, rig, "one_mass", IN_CONTACT[:3], QUICK, 1)
    fit = fit_run(law, run, rig)
    assert numbers(fit)["restitution"].value is None
    assert "never leaves the cam" in numbers(fit)["restitution"].reason
    assert "rigid stem" in numbers(fit)["stem_stiffness"].reason
    fit = fit_run(law, replace(run, force=None), rig)
    assert fit.identified == ()
    assert any("No parameter" in text for text in fit.conclusions())


def test_a_rig_without_a_restitution_is_fitted_and_a_tiny_mass_reported(law, rig):
    """A base rig without a restitution is accepted in a fit.

    A fitted mass that is tiny is reported. Here the force in kN is read as N, which gives a
    thousandth of the mass.
    """
    follower = rig.follower.model_copy(update={"restitution": None})
    plain = rig.model_copy(update={"follower": follower})
    run = measured_run(law, rig, "one_mass", IN_CONTACT[:3], QUICK, 1)
    fit = fit_run(law, run, plain, "one_mass")
    require_true(fit, rig, "mass", "spring_stiffness")
    unusual = "outside the usual size of a bench"
    assert not any(unusual in text for text in fit.conclusions())
    fit = fit_run(law, with_force(run, 1e-3 * run.force.value), plain, "one_mass")
    assert sum(unusual in text for text in fit.conclusions()) == 2


@pytest.mark.long
def test_lifts_alone_identify_ratios_to_the_mass(law, rig):
    """Lifts with flights, without forces, identify the ratios k/m, c/m and preload/m.

    With a given mass all parameters are identified. At a single speed several followers have the
    same flights, so no parameter is identified.
    """
    other = rig.with_follower(restitution=0.3)
    rpms = (*WITH_FLIGHTS, 500.0)
    run = replace(measured_run(law, other, "one_mass", rpms, seed=4), force=None)
    free = fit_run(law, run, rig)
    assert [n.name for n in free.identified] == ["restitution"]
    assert "ratio to the mass" in numbers(free)["spring_stiffness"].reason
    known = fit_run(law, run, rig, fixed={"mass": 1.3})
    require_true(known, other, "spring_stiffness", "damping")
    run = measured_run(law, rig, "one_mass", WITH_FLIGHTS, seed=4)
    single = fit_run(law, replace(run, force=None), rig)
    assert single.identified == ()
    assert "a single speed with lift-offs" in numbers(single)["spring_stiffness"].reason


def test_backlash_is_identified(law, rig):
    """A backlash of 0.2 mm in the lift gauge is identified within 2 %.

    The errors of the follower's parameters stay below 4 standard errors.
    """
    errors = replace(QUICK, backlash=2e-4)
    fit = fit_run(law, measured_run(law, rig, "one_mass", IN_CONTACT, errors, 5), rig)
    assert gauge(fit, "lift_backlash") == pytest.approx(2e-4, rel=0.02)
    require_true(fit, rig)
    assert any("backlash" in words for words in fit.conclusions())


@pytest.mark.long
def test_a_force_sensor_s_resonance_is_no_stem(law, rig):
    """The resonance of a force sensor is identified, and not taken for a stem.

    It is at 300 Hz with 2 % damping. The follower is one rigid mass.
    """
    errors = InstrumentErrors(sensor_frequency=300.0)
    run = measured_run(law, rig, "one_mass", (150.0, 250.0, 330.0, 400.0), errors, 5)
    fit = fit_run(law, run, rig)
    assert fit.model == "one_mass"
    assert gauge(fit, "force_sensor_resonance") == pytest.approx(300.0, rel=0.01)
    require_true(fit, rig)


@pytest.mark.slow
def test_a_stem_shows_in_the_force(law, rig, paper_rig):
    """Without a given model, two masses are identified from the force of a stem.

    The stem is elastic. Stiffness and damping of the stem and the roller's share of the mass are
    identified.
    """
    run = measured_run(law, paper_rig, "two_mass", (200.0, 280.0, 340.0, 380.0), QUICK, 2)
    fit = fit_run(law, run, rig)
    assert fit.model == "two_mass"
    require_true(fit, paper_rig, "mass", "stem_stiffness", "roller_share", "stem_damping")


@pytest.mark.long
def test_a_stem_that_leaves_a_cam_of_arcs():
    """On a cam of arcs every fitted two-mass parameter is within 4 standard errors.

    Jumps of acceleration excite the stem, so that it lifts off at 0.7 of the rigid jump speed. If
    the force sensor has a zero error, no preload is identified, because the two add up.
    """
    law, rig, jump = machine("arcs_straight", "paper_table2", mass=1.0)
    like = cam_rig.load_rig("tm21")
    run = measured_run(law, rig, "two_mass", (0.4 * jump, 0.7 * jump, 1.1 * jump), QUICK, 1)
    fit = fit_run(law, run, like, None, {"restitution": 0.0})
    require_true(fit, rig, "mass", "spring_stiffness", "preload", "damping")
    run = measured_run(law, rig, "two_mass", (0.4 * jump, 0.6 * jump, 0.9 * jump), QUICK, 1)
    fit = fit_run(law, with_force(run, run.force.value + 8.0), like, "two_mass")
    assert re.search(r"in flight the force reads [78]\.\d+ N", numbers(fit)["preload"].reason)
    require_true(fit, rig, "mass", "spring_stiffness")


def test_noise_has_a_floor_and_a_relative_part():
    """Constant and relative part of the force noise are found within 5 %."""
    random = np.random.default_rng(1)
    force = random.uniform(0.0, 200.0, 20_000)
    residual = np.hypot(0.5, 0.01 * force) * random.standard_normal(force.size)
    assert estimate_force_noise(residual, force) == pytest.approx((0.5, 0.01), rel=0.05)


def with_force(run, value):
    """Return a measured run with other force values."""
    return replace(run, force=replace(run.force, value=value))


def test_a_force_alone_finds_the_encoder_s_zero(law, rig):
    """Force readings alone identify the encoder's zero angle, here 140°.

    With a wrong zero, a mass or a spring would be negative.
    """
    errors = replace(QUICK, offset=np.radians(140.0))
    run = measured_run(law, rig, "one_mass", IN_CONTACT[:3], errors, 7)
    fit = fit_run(law, replace(run, lift=None), rig, "one_mass")
    require_true(fit, rig)


def test_invalid_runs_are_errors(law, rig):
    """Missing, constant or negated signals and impossible fixed values are errors."""
    run = measured_run(law, rig, "one_mass", (200.0,), QUICK, 1)
    force = run.force.value
    for measured, fixed, words in (
        (replace(run, lift=None, force=None), {}, "must contain a lift or a contact force"),
        (with_force(run, 0.0 * force + 7.0), {}, "constant at 7"),
        (with_force(run, -force), {}, "change its sign"),
        (run, {"mass": -1.0}, r"mass must be between 1e-06 and 1e\+06 kg, got -1"),
    ):
        with pytest.raises(ConfigError, match=words):
            fit_run(law, measured, rig, fixed=fixed)


def test_another_cam_identifies_no_parameter(law, laws, rig):
    """A fit with the law of another cam identifies no parameter, as the report states."""
    run = measured_run(law, rig, "one_mass", IN_CONTACT[:2], QUICK, 1)
    fit = fit_run(laws["bezier15"], run, rig)
    assert fit.identified == ()
    assert all("are cam, unit and sign correct" in number.reason for number in fit.numbers)
    assert any("another cam" in words for words in fit.conclusions())


@pytest.mark.slow
def test_a_stem_s_numbers_need_a_stem(law, rig, paper_rig):
    """Fixed parameters of an elastic stem are refused for a model without a stem.

    Two masses in turn require a contact force. With both, the parameters are used as given.
    """
    run = measured_run(law, paper_rig, "two_mass", (200.0, 300.0), QUICK, 1)
    with pytest.raises(ConfigError, match=r"roller_share.*two_mass"):
        fit_run(law, run, rig, None, {"roller_share": 0.4})
    with pytest.raises(ConfigError, match=r"requires a contact force.*one_mass"):
        fit_run(law, replace(run, force=None), rig, "two_mass")
    fit = fit_run(law, run, rig, "two_mass", {"roller_share": 0.4, "stem_damping": 9.0})
    assert numbers(fit)["roller_share"].origin == "given"
    assert numbers(fit)["stem_stiffness"].value is not None


@pytest.mark.long
def test_correlated_noise_of_the_force_drops_no_speed_on_the_cam(law, paper_rig):
    """Correlated noise of the force excludes no speed in contact from the fit.

    It has 2 N, and the correlation of samples k apart is 0.9ᵏ.
    """
    run = measured_run(law, paper_rig, "two_mass", (150.0, 220.0, 290.0), QUICK, 1)
    steps = np.random.default_rng(1).normal(0.0, 2.0 * np.sqrt(1.0 - 0.81), run.force.value.size)
    run = with_force(run, run.force.value + lfilter([1.0], [1.0, -0.9], steps))
    fit = fit_run(law, run, paper_rig, "two_mass")
    assert fit.excluded == ()
    require_true(fit, paper_rig, "mass", "stem_stiffness")


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_lifts_identify_a_rig_far_from_the_start(seed):
    """Lifts identify parameters that are 0.6 to 1.6 times the start values of the fit."""
    random = np.random.default_rng(seed)
    base = cam_rig.load_rig("tm21")
    names = ("spring_stiffness", "preload", "damping")
    own = {n: getattr(base.follower, n).si * float(random.uniform(0.6, 1.6)) for n in names}
    own["restitution"] = float(random.uniform(0.2, 0.5))
    law, other, jump = machine(("cycloidal", "bezier15")[seed % 2], "tm21", **own)
    rpms = 0.5 * jump, 1.08 * jump, 1.2 * jump
    run = replace(measured_run(law, other, "one_mass", rpms, seed=seed), force=None)
    fit = fit_run(law, run, base, fixed={"mass": other.follower.mass.si})
    require_true(fit, other, "spring_stiffness", "restitution")


def test_one_speed_in_contact_is_enough(rig):
    """A fit of speeds with flights needs only one speed in contact.

    No speed is excluded, and the parameters are within 4 standard errors.
    """
    law, other, _ = machine("tm21", "tm21", mass=1.8)
    run = measured_run(law, other, "one_mass", (200.0, 300.0, 350.0), QUICK)
    fit = fit_run(law, run, rig, fixed={"restitution": 0.0})
    assert fit.excluded == ()
    require_true(fit, other)


def test_a_follower_that_bounces_at_random_is_refused(law, rig, paper_rig):
    """A measured run whose motion is not periodic is refused with the reason."""
    run = measured_run(law, paper_rig, "two_mass", (600.0, 650.0), seed=2)
    with pytest.raises(ConfigError, match="below the jump speed"):
        fit_run(law, run, rig)


def test_outliers_of_the_force_are_reported(law, rig):
    """Spikes of 20 standard deviations in 0.5 % of the force samples are reported."""
    run = measured_run(law, rig, "one_mass", IN_CONTACT[:3], QUICK, 1)
    force = run.force.value.copy()
    force[::200] += 0.2 * force.max()
    fit = fit_run(law, with_force(run, force), rig, "one_mass")
    count = sum(segment.force.value.size for segment in fit.solution.likelihood.segments)
    (words,) = [words for words in fit.conclusions() if "outliers" in words]
    assert f"of {count} samples of the force" in words
    assert not any("outliers" in words for words in fit_run(law, run, rig).conclusions())


def test_force_on_a_dwell_alone_is_fitted(rig):
    """A follower with almost no preload on a cam with a dwell is identified.

    At some trial zero angles of the encoder all samples in contact are on the dwell, where they
    determine little.
    """
    law, other, jump = machine("tm21", "tm21", preload=0.2)
    run = measured_run(law, other, "one_mass", (0.5 * jump, 0.9 * jump), QUICK, 103)
    require_true(fit_run(law, run, rig, "one_mass"), other)
