"""The words beside the picture."""

from __future__ import annotations

from cam_rig.viewer.run_view import about

from ..conftest import SmallBag


def test_numbers_are_listed_by_origin(bag: SmallBag) -> None:
    """Scene, cams and rig, each number with its unit under given, assumed or identified."""
    words = about(bag.loaded, 1)
    assert words.startswith("# Two cams, two speeds\n")
    assert "## Polynomial 3-4-5" in words
    assert "**given:** lift 0.05 m" in words
    assert "**assumed:** base_radius 65 mm; roller_radius 10 mm" in words
    assert "**identified:** segments[1].span 117.5 deg" in words
    assert "mass 1.3 kg" in words
    assert "Of every" not in words


def test_thinning_is_told(bag: SmallBag) -> None:
    """Whoever looks at the curves knows what they are."""
    assert "Of every 26 samples the curves show the minimum and the maximum." in about(
        bag.loaded, 26
    )
