"""Trial geometries of the identified cam."""

import pytest
from pydantic import ValidationError

from cam_rig.laws import build_law
from cam_rig.paper.noise.arc_cam import with_geometry


def test_with_geometry(cams):
    """Other numbers in the same file: a whole turn, the event in its middle, same origins."""
    trial = with_geometry(cams["tm21"], lift_mm=8.0, event_deg=130.0, nose_deg=90.0)
    spans = [segment.span.raw for segment in trial.segments]
    assert spans == [115.0, 130.0, 115.0]
    assert trial.segments[1].nose_span.raw == 90.0
    assert trial.lift.si == pytest.approx(0.008, rel=1e-15)
    origins = {key: number.origin for key, number in trial.numbers().items()}
    assert origins == {key: number.origin for key, number in cams["tm21"].numbers().items()}


def test_same_geometry_is_the_same_law(cams, laws):
    """Putting a cam's own numbers back changes nothing."""
    cam = cams["tm21"]
    event = cam.segments[1]
    again = with_geometry(cam, 1e3 * cam.lift.si, event.span.raw, event.nose_span.raw)
    assert build_law(again).lift == pytest.approx(laws["tm21"].lift, rel=1e-12)


def test_impossible_span(cams):
    """An event longer than a turn is refused like one in a file."""
    with pytest.raises(ValidationError, match="allowed"):
        with_geometry(cams["tm21"], 10.0, 400.0, 100.0)
