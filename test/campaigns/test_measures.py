"""What is measured of a point: the rig's own numbers, rows where there is none, and 20 draws."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import cam_rig
from cam_rig.campaigns.measures import MEASURES, parse_limits, parse_measures
from cam_rig.campaigns.point import make_point, measure_batch
from cam_rig.dynamics import TwoMassParameters
from cam_rig.errors import ConfigError
from cam_rig.units import RPM, TURN

PRELOAD = "rig.follower.preload"
WAVE = {
    "profile.waviness.amplitude": {"values": [2], "unit": "um"},
    "profile.waviness.wavelength": {"values": [10], "unit": "deg"},
}
GRID = {"kind": "grid"}


def measured(study, vary, *measures, **parts):
    campaign = study(vary=vary, measures=list(measures), plan=GRID, **parts)
    return measure_batch(campaign, 0, campaign.total)


def test_a_wave_at_the_stems_resonance_takes_a_fifth_of_the_jump_speed(study):
    """2 µm of 10°: from 413 to about 320 rpm; 1e-12 m changes nothing."""
    rows = measured(study, WAVE, "jump_speed")
    assert rows.measures[0, 0] == pytest.approx(320.0, abs=1.0)
    tiny = WAVE | {"profile.waviness.amplitude": {"values": [0.0, 1e-12], "unit": "m"}}
    none, least = measured(study, tiny, "jump_speed").measures[:, 0]
    assert none == pytest.approx(413.44, abs=0.005)
    assert least == pytest.approx(none, rel=1e-6)


def test_measures_are_those_of_the_commands(study):
    """At the base, each is what the library gives on its own."""
    law, rig = cam_rig.build_law(cam_rig.load_cam("poly345")), cam_rig.load_rig("paper_table2")
    names = [
        "jump_speed",
        "jump_speed_steady",
        "sound_level@300rpm",
        "peak_contact_force_rigid@300rpm",
    ]
    vary = {PRELOAD: {"values": [30.6], "unit": "N"}}
    found = measured(study, vary, *names).measures[0]
    motion = cam_rig.simulate(law, rig, model="two_mass", rpm=300, turns=33)
    expected = [
        cam_rig.jump_speed(law, rig).rpm,
        cam_rig.jump_speed(law, rig, duration=None).rpm,
        cam_rig.sound_level(motion, settle_turns=30).level_db,
        4030.0 * 0.05 + 30.6,  # at the top, where spring and preload alone press
    ]
    assert found == pytest.approx(expected, rel=2e-6)


def test_every_measure_has_a_number(study):
    """On the paper's rig, finite ones, at one speed each where they have one."""
    texts = [
        name + {"rpm": "@300rpm"}.get(quantity.where, "")
        for name, (quantity, _) in MEASURES.items()
    ]
    rows = measured(study, {PRELOAD: {"values": [30.6], "unit": "N"}}, *texts)
    assert rows.reasons == ("",)
    assert np.isfinite(rows.measures).all()


def test_no_jump_speed_is_a_number_too(study):
    """0 where contact is lost at every speed, ∞ where at none: rows, not errors."""
    loose = {PRELOAD: {"values": [0], "unit": "N"}}
    rows = measured(study, loose, "jump_speed", "jump_speed_rigid")
    assert rows.measures.tolist() == [[0.0, 0.0]]
    firm = {"cam.lift": {"values": [1e-9], "unit": "mm"}}
    rows = measured(study, firm, "jump_speed_rigid", base={"cam": "poly345", "rig": "tm21"})
    assert (rows.measures[0, 0], rows.reasons) == (pytest.approx(math.inf), ("",))


def test_what_cannot_be_made_is_a_row_with_its_reason(study):
    """A mass below zero, a turn that is not one: no number, and why; the others are untouched."""
    rows = measured(study, {"rig.follower.mass": {"values": [-1, 1.3], "unit": "kg"}}, "jump_speed")
    assert "follower.mass" in rows.reasons[0]
    assert np.isnan(rows.measures[0, 0])
    assert rows.reasons[1] == ""
    assert rows.measures[1, 0] > 400.0
    span = {"cam.segments[1].span": {"values": [100], "unit": "deg"}}
    assert "missing 17.5°" in measured(study, span, "jump_speed").reasons[0]


def test_a_measure_that_fails_leaves_the_others(study):
    """No shaft on the rig: twist has a reason, the jump speed a number."""
    vary = {PRELOAD: {"values": [40], "unit": "N"}}
    base = {"cam": "poly345", "rig": "tm21"}
    rows = measured(study, vary, "twist@300rpm", "jump_speed_rigid", base=base)
    assert rows.reasons[0].startswith("twist@300rpm: ")
    assert np.isnan(rows.measures[0]).tolist() == [True, False]


def test_unknown_measures_and_limits_are_refused():
    """In a line, with what there is."""
    with pytest.raises(ConfigError, match="did you mean 'jump_speed'"):
        parse_measures(["jump_sped"], "two_mass")
    with pytest.raises(ConfigError, match="is not measured"):
        parse_limits(["twist@300rpm<=1deg"], parse_measures(["jump_speed"], "two_mass"), "two_mass")
    with pytest.raises(ConfigError, match="stands twice"):
        parse_measures(["jump_speed", "jump_speed"], "two_mass")


@pytest.mark.long
@pytest.mark.slow
def test_twenty_draws_agree_with_an_independent_integrator(study):
    """Contact holds 3e-4 below each jump speed, and is lost 3e-4 above it."""
    spread = {"uniform": 10, "unit": "%"}
    vary = {
        "profile.waviness.amplitude": {"range": [0, 3], "unit": "um"},
        "profile.waviness.wavelength": {"range": [10, 30], "unit": "deg"},
        "profile.waviness.phase": {"range": [0, 360], "unit": "deg"},
        PRELOAD: spread,
        "rig.follower.mass": spread,
        "rig.follower.stem_stiffness": spread,
    }
    plan = {"kind": "latin_hypercube", "points": 20, "seed": 8}
    campaign = study(vary=vary, plan=plan, measures=["jump_speed"])
    rows = measure_batch(campaign, 0, 20)
    masses = [TwoMassParameters.from_rig(make_point(campaign, row).rig) for row in rows.inputs]
    below, above = least_forces(masses, rows.inputs, rows.measures[:, 0] * RPM)
    assert (below > 0.0).all()
    assert (above < 0.0).all()


def least_forces(masses, inputs, jumps):
    """The least contact force (N) of 1.7 s from rest, 3e-4 below and above speeds, ``(2, n)``.

    By DOP853 in the equations of motion, all runs side by side. The lift is 3-4-5 in closed form
    and the wave a sine, not the rig's piecewise polynomial.
    """
    speed = np.outer([1.0 - 3e-4, 1.0 + 3e-4], jumps).ravel()
    amplitude, wavelength, phase = np.tile(inputs[:, :3], (2, 1)).T
    p = SimpleNamespace(
        **{name: np.tile([getattr(one, name) for one in masses], 2) for name in vars(masses[0])}
    )
    k, closing, rise = TURN / wavelength, 2.0 * wavelength, math.radians(117.5)

    def wave(angle):
        sine, cosine = np.sin(k * angle + phase), np.cos(k * angle + phase)
        return amplitude * np.stack([sine, k * cosine, -(k**2) * sine])

    def cam(time):
        angle = np.mod(speed * time, TURN)
        s, ahead = wave(angle), wave(angle - TURN)
        t = np.clip((angle - TURN + closing) / closing, 0.0, 1.0)
        w = 35 * t**4 - 84 * t**5 + 70 * t**6 - 20 * t**7
        dw = 140 * (t * (1 - t)) ** 3 / closing
        ddw = 420 * (t * (1 - t)) ** 2 * (1 - 2 * t) / closing**2
        gap = ahead - s
        s = s + np.stack(
            [w * gap[0], w * gap[1] + dw * gap[0], w * gap[2] + 2 * dw * gap[1] + ddw * gap[0]]
        )
        for begin, lift in ((31.25, 0.05), (211.25, -0.05)):
            x = np.clip((angle - math.radians(begin)) / rise, 0.0, 1.0)
            slope = 30 * (x * (1 - x)) ** 2 / rise
            bend = 60 * x * (1 - x) * (1 - 2 * x) / rise**2
            s = s + lift * np.stack([10 * x**3 - 15 * x**4 + 6 * x**5, slope, bend])
        return s[0], s[1] * speed, s[2] * speed**2

    def rate(time, state):
        y, v = state.reshape(2, -1)
        s, ds, _ = cam(time)
        force = p.stem_damping * (ds - v) + p.stem_stiffness * (s - y)
        load = p.spring_stiffness * y + p.damping * v + p.preload
        return np.concatenate([v, (force - load) / p.end_mass])

    whole = p.stem_stiffness + p.spring_stiffness
    share, (lift, rate_of_lift, _) = p.stem_stiffness / whole, cam(0.0)
    start = np.concatenate([share * lift - p.preload / whole, share * rate_of_lift])
    times = np.linspace(0.0, 1.7, 30_001)
    tight = {"rtol": 1e-8, "atol": 1e-13, "max_step": 2e-3}
    run = solve_ivp(rate, (0.0, 1.7), start, "DOP853", times, **tight)
    least = np.full(speed.size, np.inf)
    for time, state in zip(times, run.y.T, strict=True):
        (y, v), (s, ds, dds) = state.reshape(2, -1), cam(time)
        force = p.roller_mass * dds + p.stem_damping * (ds - v) + p.stem_stiffness * (s - y)
        np.minimum(least, force, out=least)
    return least.reshape(2, -1)
