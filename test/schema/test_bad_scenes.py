"""Scenes that cannot be run."""

import re

import pytest


@pytest.fixture
def scene_error(config_dir, error_of):
    """The error of the scene with another value for one key."""

    def load(key: str, value: str) -> str:
        text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
        wrong, count = re.subn(rf"(?m)^( *){key}:.*$", rf"\g<1>{key}: {value}", text, count=1)
        assert count == 1
        return error_of("scene", wrong)

    return load


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("cams", "[poly345, tm21, poly345]", "names a cam twice; allowed: each once"),
        ("cams", "tm21", "cams: is 'tm21'; allowed: a valid list"),
        ("cams", "[]", "cams: is []"),
        ("cams", "[../tm21]", "cams[0]: is '../tm21'"),
        (
            "model",
            "three_mass",
            "model: is 'three_mass' (did you mean 'two_mass'?); allowed: 'kinetostatic', ",
        ),
        ("sample_rate", "{given: 99, unit: Hz}", "sample_rate: is 99 Hz; allowed: at least 100 Hz"),
        ("sample_rate", "{given: 2, unit: MHz}", "sample_rate: has unit 'MHz'"),
        ("sample_rate", "{given: 2000, unit: kHz}", "sample_rate: is 2000 kHz; allowed: at most"),
        ("sample_rate", "{given: 440.5, unit: Hz}", "sample_rate: is 440.5 Hz; allowed: a whole"),
        ("turns", "{given: 2.5, unit: turns}", "turns: is 2.5 turns; allowed: a whole number"),
        ("turns", "{given: 0, unit: turns}", "program.turns: is 0 turns; allowed: at least 1"),
        (
            "settle_turns",
            "{given: 1000, unit: turns}",
            "settle_turns: is 1000 turns; allowed: less",
        ),
        ("settle_turns", "{given: -1, unit: turns}", "is -1 turns; allowed: at least 0"),
        (
            "ticks_per_turn",
            "0",
            "program.ticks_per_turn: is 0; allowed: greater than or equal to 1",
        ),
        ("ticks_per_turn", "1.5", "program.ticks_per_turn: is 1.5; allowed: a valid integer"),
        ("points_per_turn", "0", "points_per_turn: is 0; allowed: greater than or equal to 1"),
        (
            "points_per_turn",
            "3601",
            "points_per_turn: is 3601; allowed: less than or equal",
        ),
        ("points_per_turn", "7.5", "points_per_turn: is 7.5; allowed: a valid integer"),
        ("ticks_per_turn", "many", "program.ticks_per_turn: is 'many'; allowed: a valid integer"),
    ],
)
def test_wrong_scene(scene_error, key, value, words):
    """The line names the key, the value, and what is allowed."""
    assert words in scene_error(key, value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("200, 210", "-200, 210", "program.speeds: is -200 rpm; allowed: at least 0.01 rpm"),
        ("200, 210", "0, 210", "program.speeds: is 0 rpm; allowed: at least 0.01 rpm"),
        ("200, 210", ".nan, 210", "allowed: finite numbers"),
        ("200, 210", ".inf, 210", "allowed: finite numbers"),
        (
            "unit: rpm",
            "unit: Hz",
            "program.speeds: has unit 'Hz', not a speed; allowed: rad/s, rpm",
        ),
    ],
)
def test_wrong_speeds(refuse, old, new, words):
    """A cam that stands, turns backwards or at no speed at all is refused."""
    assert words in refuse("scene", old, new)


def test_sample_rate_too_low_for_a_tick(config_dir, error_of):
    """Each tick must hold at least two samples at the highest speed, or nothing is heard in it."""
    text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
    text = re.sub(r"sample_rate:.*", "sample_rate: {given: 8, unit: kHz}", text)
    text = re.sub(r"ticks_per_turn:.*", "ticks_per_turn: 1000", text)
    message = error_of("scene", text)
    assert message.startswith("sample_rate: 8000 Hz gives 1.2 samples a tick at the highest speed")
    assert message.endswith("allowed: at least 2, so 13334 Hz, or ticks_per_turn up to 600")


def test_ramp_too_short_for_a_sample(config_dir, error_of):
    """A ramp between two samples would be a tick in which nothing is heard."""
    text = (config_dir / "scenes" / "tm21_sweep.yaml").read_text(encoding="utf-8")
    ramp = '  ramp: {assumed: 0.1, unit: ms, source: "a test"}\n  ticks_per_turn:'
    message = error_of("scene", text.replace("  ticks_per_turn:", ramp))
    assert message.startswith("program.ramp: 0.0001 s has 1.2 samples at 12000 Hz; allowed: at le")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("range_rpm: [200, 400]", "range_rpm: [200]", "range_rpm[1]: missing"),
        ("range_rpm: [200, 400]", "range_rpm: [200, .inf]", "range_rpm[1]: is inf; allowed: a fin"),
        ("0.41488", ".nan", "regression_db.tm21[0]: is nan; allowed: a finite number"),
        ("0.41488", "low", "regression_db.tm21[0]: is 'low'; allowed: a valid number"),
    ],
)
def test_wrong_published(refuse, old, new, words):
    """Published curves are checked like everything else."""
    assert words in refuse("published", old, new)


def test_crossover_is_between_published_cams(refuse):
    """A crossover between cams without a curve could never be compared."""
    assert "bezier" in refuse("published", "between: [bezier15,", "between: [bezier,")
