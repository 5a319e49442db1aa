"""Every kind of wrong number is refused in one line: key, value, and what is allowed."""

import re

import pytest

MASS = re.compile(r"  mass: \{.*\}")


@pytest.fixture
def mass_error(config_dir, error_of):
    """The error of the rig file with another value for the follower's mass."""

    def load(value: str) -> str:
        text = (config_dir / "rigs" / "tm21.yaml").read_text(encoding="utf-8")
        wrong, count = MASS.subn(f"  mass: {value}", text, count=1)
        assert count == 1
        return error_of("rig", wrong)

    return load


@pytest.mark.parametrize(
    ("value", "shown", "allowed"),
    [
        ("{given: -1.5, unit: kg}", "is -1.5 kg", "greater than 0 kg"),
        ("{given: 0, unit: kg}", "is 0 kg", "greater than 0 kg"),
        ("{given: .nan, unit: kg}", "is nan", "finite numbers"),
        ("{given: .inf, unit: kg}", "is inf", "finite numbers"),
        ("{given: 1e999, unit: kg}", "is inf", "finite numbers"),
        ("{given: 1, unit: lb}", "has unit 'lb', not a mass", "kg, g"),
        ("{given: 1, unit: mm}", "has unit 'mm', not a mass", "kg, g"),
        ("{given: [1, 2], unit: kg}", "is [1.0, 2.0]", "one number"),
        ("{given: [], unit: kg}", "is []", "one number"),
        ("{given: 1, assumed: 2, unit: kg}", "given and assumed", "exactly one of"),
        ("{unit: kg}", "has none", "exactly one of given, assumed, identified"),
        ("1.3", "is 1.3", ""),
        ("heavy", "is 'heavy'", ""),
        ("", "is None", ""),
        ("[1.3]", "is [1.3]", ""),
    ],
)
def test_wrong_quantity(mass_error, value, shown, allowed):
    """The line names the key, shows the value, and says what is allowed."""
    message = mass_error(value)
    assert message.startswith("follower.mass: ")
    assert shown in message
    assert f"allowed: {allowed}" in message


@pytest.mark.parametrize("value", ["abc", "{a: 1}", "[a]", "'1.3'", "true"])
def test_not_a_number(mass_error, value):
    """Text, even text of digits, a mapping or true is no number: values are taken as written."""
    message = mass_error(f"{{given: {value}, unit: kg}}")
    assert "follower.mass.given" in message
    assert "allowed: " in message


def test_key_has_no_names_of_python_types(mass_error):
    """The key is the one written in the file, without pydantic's union members."""
    assert mass_error("{given: abc, unit: kg}").startswith("follower.mass.given: ")


def test_missing_unit(mass_error):
    """A number without a unit is no quantity."""
    assert mass_error("{given: 1.3}") == "follower.mass.unit: missing; it is required"


def test_unknown_key_of_a_quantity(mass_error):
    """A misspelt origin is named, with the one that was meant."""
    message = mass_error("{givn: 1.3, unit: kg}")
    assert message.startswith("follower.mass.givn: unknown key, value 1.3")
    assert "did you mean 'given'?" in message
    assert "allowed: assumed, given, identified" in message


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "stem_stiffness",
            "{given: -3.3e8, unit: N/m}",
            "is -3.3e+08 N/m; allowed: greater than 0",
        ),
        ("mass", "{given: 1e-30, unit: kg}", "is 1e-30 kg; allowed: at least 1e-09 kg"),
        ("stem_stiffness", "{given: 1e-30, unit: N/m}", "is 1e-30 N/m; allowed: at least 1e-09"),
        ("spring_stiffness", "{given: 0, unit: N/m}", "is 0 N/m; allowed: greater than 0 N/m"),
        ("damping", "{given: -1, unit: N*s/m}", "is -1 N*s/m; allowed: at least 0"),
        ("preload", "{given: -1, unit: N}", "is -1 N; allowed: at least 0"),
        ("restitution", '{given: 1, unit: "1"}', "is 1; allowed: at most 0.999"),
        ("restitution", '{given: -0.1, unit: "1"}', "is -0.1; allowed: at least 0"),
        ("gain", "{given: 0, unit: Pa*s/N}", "is 0 Pa*s/N; allowed: greater than 0"),
        ("corner", "{given: -17, unit: Hz}", "is -17 Hz; allowed: greater than 0"),
        ("background", "{given: 73, unit: Hz}", "has unit 'Hz', not a level; allowed: dB"),
        ("background_at", "{given: 0, unit: rpm}", "is 0 rpm; allowed: greater than 0"),
    ],
)
def test_limits_of_the_rig(config_dir, error_of, key, value, words):
    """Each number of the rig file has its dimension and its limit."""
    text = (config_dir / "rigs" / "tm21.yaml").read_text(encoding="utf-8")
    wrong, count = re.subn(rf"  {key}: \{{.*\}}", f"  {key}: {value}", text, count=1)
    assert count == 1
    message = error_of("rig", wrong)
    assert f".{key}: " in message
    assert words in message
