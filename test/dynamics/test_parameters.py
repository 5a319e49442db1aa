"""The follower's numbers: taken from the rig file, and refused when impossible."""

import dataclasses
import math

import pytest

from cam_rig.dynamics import FollowerParameters
from cam_rig.errors import DynamicsError


@pytest.mark.parametrize(
    ("name", "value", "limit"),
    [
        *[
            (name, value, "> 0")
            for name in ("mass", "spring_stiffness", "stem_stiffness")
            for value in (0.0, -1.0, math.nan, math.inf)
        ],
        *[
            (name, value, "≥ 0")
            for name in ("damping", "preload")
            for value in (-1e-9, math.nan, math.inf)
        ],
        *[("restitution", value, r"in \[0, 1\)") for value in (1.0, -0.1, math.nan)],
    ],
)
def test_bad_parameter(follower, name, value, limit):
    """The error has the name, the value and the limit."""
    with pytest.raises(DynamicsError, match=f"{name} is {value!r}; allowed: finite and {limit}"):
        dataclasses.replace(follower, **{name: value})


def test_from_rig(rig):
    """Numbers come in SI, each from its own key."""
    follower = FollowerParameters.from_rig(rig)
    for name in (field.name for field in dataclasses.fields(follower)):
        assert getattr(follower, name) == getattr(rig.follower, name).si


def test_contact_time_is_half_a_period(follower):
    """A mass on its stem pushes for half a period: sin(√(k/m) T) = 0 for the first time."""
    rate = math.sqrt(follower.stem_stiffness / follower.mass)
    assert rate * follower.contact_time == pytest.approx(math.pi, rel=1e-15)
