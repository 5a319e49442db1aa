"""The largest waviness: a formula where first order is exact, and what ends a search."""

import numpy as np
import pytest

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.errors import ConfigError
from cam_rig.studies.campaign.campaign import WAVE, WAVELENGTH
from cam_rig.studies.campaign.inputs import ProfileErrors
from cam_rig.studies.campaign.largest_waviness import WavinessSearch, least_steps, resonances
from cam_rig.units import RPM, TURN

from .conftest import SMALL

WAVY = {
    WAVE: {"values": [2], "unit": "um"},
    WAVELENGTH: {"range": [10, 40], "unit": "deg"},
    "profile.waviness.phase": {"range": [0, 360], "unit": "deg"},
    "rig.follower.preload": {"uniform": 10, "unit": "%"},
}
PAIR = {"inputs": [WAVE, "rig.follower.preload"], "coefficient": 0.5}
RIGID = {"vary": WAVY, "limits": ["jump_speed_rigid>=350rpm"]}


@pytest.fixture
def search(study):
    """A search of rigid followers, with other parts where they are given."""

    def made(**parts):
        return WavinessSearch(study(**(RIGID | parts)))

    return made


def exact(campaign, wavelength, speed):
    """Of each draw the amplitude (m) at which the force of one mass first touches zero at a speed.

    The force is linear in the amplitude: m Ω² s'' + c Ω s' + k s + F, over angles 1/20° apart.
    """
    angle = np.linspace(0.0, TURN, 7200, endpoint=False)
    paths = [one.path for one in campaign.inputs]
    follower, found = FollowerParameters.from_rig(campaign.rig), []
    for row in campaign.draws.rows(0, campaign.total):
        drawn = dict(zip(paths, row.tolist(), strict=True))
        phase = drawn["profile.waviness.phase"]
        wave = ProfileErrors(waviness=1.0, wavelength=wavelength, waviness_phase=phase)
        weights = follower.spring_stiffness, follower.damping * speed, follower.mass * speed**2
        law = [campaign.law(angle, order) for order in range(3)]
        force = sum(w * s for w, s in zip(weights, law, strict=True))
        force = force + drawn["rig.follower.preload"]
        by_wave = sum(w * s for w, s in zip(weights, wave.at(angle), strict=True))
        lifting = by_wave < 0.0
        found.append(float((-force[lifting] / by_wave[lifting]).min()))
    return np.sort(found)


@pytest.mark.variants(1)
@pytest.mark.parametrize("wavelength", [TURN / 24.0, TURN / 17.3])
def test_a_rigid_follower_loses_contact_where_the_formula_says(search, wavelength):
    """A wave that divides the turn and one that does not; of 120 draws one may lose the limit."""
    asked = search(plan={"kind": "sobol", "points": 120, "seed": 3})
    found, expected = asked.at(wavelength), exact(asked.campaign, wavelength, 350.0 * RPM)
    ratio = asked.amplitudes[2] / asked.amplitudes[1] * 1.001
    assert found.outcome == "found"
    assert expected[1] / ratio <= found.amplitude <= expected[1] * 1.001
    assert found.low is None  # 120 draws do not tell
    assert expected[4] / ratio <= found.high <= expected[4] * 1.001
    assert found.evaluations < 3 * asked.campaign.total


@pytest.mark.parametrize(
    ("rpm", "outcome", "end"),
    [(600, "lost without waviness", 0), (0.001, "kept at the largest amplitude", -1)],
)
def test_both_ends_of_the_amplitudes_are_said(search, rpm, outcome, end):
    """No draw keeps the limit without waviness; all do with the largest."""
    asked = search(limits=[f"jump_speed_rigid>={rpm}rpm"])
    found = asked.at(TURN / 12.0)
    assert (found.outcome, found.amplitude) == (outcome, asked.amplitudes[end])


def test_wavelengths_fill_the_range_and_every_other_divides_the_turn(search):
    """With those about the stem's resonance where a limit on two masses has one."""
    found = search().wavelengths(9)
    whole = np.abs(TURN / found - np.round(TURN / found)) < 1e-9
    assert (found.size, whole.sum()) == (9, 5)
    assert (found[0], found[-1]) == pytest.approx(np.radians([10.0, 40.0]))
    parts = {"limits": ["jump_speed>=400rpm"], "measures": ["jump_speed"]}
    elastic = search(**parts)
    assert set(resonances(elastic.campaign)) < set(elastic.wavelengths(9))
    assert np.degrees(resonances(elastic.campaign)) == pytest.approx([11.846], abs=1e-3)


def test_a_list_of_one_and_an_endless_distribution_have_wavelengths(search):
    """One row, however many are asked for; a normal one from its 1 % to its 99 %."""
    one = WAVY | {WAVELENGTH: {"values": [12], "unit": "deg"}}
    assert np.degrees(search(vary=one).wavelengths(8)) == pytest.approx([12.0])
    endless = WAVY | {WAVELENGTH: {"normal": 2, "mean": 20, "unit": "deg"}}
    found = np.degrees(search(vary=endless).wavelengths(8))
    assert 15.3 < found.min() < 16.0 and 23.5 < found.max() < 24.7


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"limits": []}, "limits: has none"),
        ({"vary": {"rig.follower.mass": {"uniform": 1, "unit": "%"}}}, "vary: has no profile"),
        ({"plan": {"kind": "shares", "points": 4}}, "is shares; allowed"),
        ({"correlated": [PAIR]}, "correlated: "),
    ],
)
def test_studies_without_an_answer_are_refused(search, parts, words):
    """In one line, with what is missing."""
    with pytest.raises(ConfigError, match=words):
        search(**parts)


def test_the_smallest_steps_are_found_with_few_questions():
    """Against sorting all of them; ties, and draws that keep it at no step or at all."""
    random = np.random.default_rng(4)
    own, asked = random.integers(-1, 100, 300), []

    def keeps(draw, step):
        asked.append(draw)
        return bool(step <= own[draw])

    assert least_steps(keeps, 300, 7, 100) == np.sort(own)[:7].tolist()
    assert len(asked) < 300 + 40 * 7
    assert least_steps(keeps, 3, 3, 100) == np.sort(own[:3]).tolist()


def test_the_largest_waviness_of_a_count_or_of_a_list():
    """The same rows for the wavelengths that a count has come to; what is refused."""
    wavy = {
        WAVE: {"values": [2], "unit": "um"},
        WAVELENGTH: {"range": [12, 60], "unit": "deg"},
        "profile.waviness.phase": {"range": [0, 360], "unit": "deg"},
    }
    study = SMALL | RIGID | {"vary": wavy, "plan": {"kind": "sobol", "points": 8}}
    found = cam_rig.largest_waviness(study, 3)
    assert [one.outcome for one in found.wavelengths] == ["found"] * 3
    table = found.to_pandas()
    assert table.amplitude.is_monotonic_increasing and table.low.isna().all()
    again = cam_rig.largest_waviness(study, table.wavelength.to_numpy())
    assert again.to_pandas().equals(table)
    (axes,) = found.plot().axes
    assert axes.lines[0].get_ydata() == pytest.approx(table.amplitude * 1e6)
    with pytest.raises(ConfigError, match=r"is 500 deg; allowed: 0\.1 to 360 deg"):
        cam_rig.largest_waviness(study, [np.radians(500.0)])
    with pytest.raises(ConfigError, match="wavelengths: is 0; allowed"):
        cam_rig.largest_waviness(study, 0)
    with pytest.raises(ConfigError, match="needed for the largest waviness"):
        cam_rig.largest_waviness(study | {"limits": []}, 3)
