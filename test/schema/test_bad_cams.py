"""Cam files that describe no cam."""

import pytest

RISE = "{law: poly345, to: 1,"
SPAN = "span: {identified: 117.5, unit: deg"


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        (
            SPAN,
            "span: {identified: 100, unit: deg",
            "segments",
            "spans sum to 342.5°; allowed: 360°",
        ),
        (SPAN, "span: {identified: 120, unit: deg", "segments", "too much by 2.5°"),
        (SPAN, "span: {identified: -117.5, unit: deg", "segments[1].span", "greater than 0 deg"),
        (SPAN, "span: {identified: 0, unit: deg", "segments[1].span", "is 0 deg; allowed: "),
        (SPAN, "span: {identified: 361, unit: deg", "segments[1].span", "at most 360 deg"),
        (SPAN, "span: {identified: .nan, unit: deg", "segments[1].span", "is nan; allowed: finite"),
        (SPAN, "span: {identified: 117.5, unit: mm", "segments[1].span", "allowed: rad, deg, turn"),
        (RISE, "{law: poly345, to: 2,", "segments[1].to", "is 2; allowed: less than or equal to 1"),
        (RISE, "{law: poly345, to: .nan,", "segments[1].to", "is nan; allowed: a finite number"),
        (RISE, "{law: poly345, to: up,", "segments[1].to", "is 'up'; allowed: a valid number"),
        (RISE, "{law: poly345,", "segments[1].to", "missing; it is required"),
        (RISE, "{law: poly345, to: 1, too: 2,", "segments[1].too", "did you mean 'to'?"),
        (RISE, "{law: poly346, to: 1,", "segments[1].law", "(did you mean 'poly345'?); allowed"),
        ("type: roller", "type: wheel", "follower.type", "is 'wheel'; allowed: 'point', 'roller'"),
        ("  type: roller", "  # type:", "follower.type", "missing; allowed: one of conjugate, "),
        ("type: roller", "type: point", "follower.roller_radius", "unknown key, value a mapping"),
        ("type: roller", "type: flat", "follower.roller_radius", "base_radius, eccentricity, "),
        ("  roller_radius:", "  # roller_radius:", "follower.roller_radius", "missing; it is requ"),
        ("  roller_radius:", "  roller_radios:", "follower.roller_radios", "mean 'roller_radius'?"),
        (
            "  roller_radius: {assumed: 10,",
            "  roller_radius: {assumed: 0,",
            "follower.roller_radius",
            "is 0 mm; allowed: greater than 0 mm",
        ),
        ("type: roller", "type: oscillating_roller", "follower.pivot_distance", "missing"),
        ("name: poly345", "name: Poly 345", "name", "is 'Poly 345'"),
        ("name: poly345", "name: guide", "name", "is 'guide', another frame of the rig"),
        ("lift: {given: 0.05", "lift: {given: -0.05", "lift", "is -0.05 m; allowed: greater than"),
    ],
)
def test_wrong_cam(refuse, old, new, key, words):
    """The line names the key, and the value or the reason."""
    message = refuse("cam", old, new)
    assert message.startswith(f"{key}: ")
    assert words in message


def test_unknown_law_lists_the_laws(refuse):
    """A law that does not exist is answered with those that do."""
    message = refuse("cam", RISE, "{law: poly346, to: 1,")
    for law in ("dwell", "poly345", "poly4567", "cycloidal", "bezier", "tangent_arcs"):
        assert f"'{law}'" in message


@pytest.mark.parametrize(
    ("segments", "key"),
    [
        ("", "segments"),
        ("segments: []", "segments"),
        ("segments: 3", "segments"),
        ("segments: [3]", "segments[0]"),
        ("segments: [{law: dwell}]", "segments[0].span"),
    ],
)
def test_wrong_segments(config_dir, error_of, segments, key):
    """No segment, an empty list, or something else than a segment."""
    text = (config_dir / "cams" / "poly345.yaml").read_text(encoding="utf-8")
    assert error_of("cam", text.split("segments:")[0] + segments).startswith(f"{key}: ")


@pytest.mark.parametrize(
    ("old", "new"),
    [(RISE, "{to: 1,"), ("name: poly345", "name: Poly 345"), ("segments:", "segments: []\nx:")],
    ids=["no law", "pattern", "empty list"],
)
def test_always_says_what_is_allowed(refuse, old, new):
    """Limits that the library checks, not this code, are said in the same words."""
    assert "allowed: " in refuse("cam", old, new)
