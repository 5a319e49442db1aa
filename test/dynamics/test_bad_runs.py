"""Numbers that no run can begin with: each is refused by name, with its limit."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerState, Interval
from cam_rig.errors import CamRigError
from cam_rig.laws import Law
from cam_rig.schema import load_rig
from cam_rig.units import TURN

NAN, INF = math.nan, math.inf
pytestmark = pytest.mark.usefixtures("at_once")


@pytest.fixture(scope="module")
def paper_rig(config_dir):
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


def advance(law, name, rig, *, angle=0.0, speed=10.0, state=None, parameters=None):
    parameters = MODELS[name].parameters(rig) if parameters is None else parameters
    interval = Interval(0, 100_000_000, angle, speed)
    return MODELS[name].advance(law, parameters, state, interval, 1000)


@pytest.mark.parametrize(
    ("name", "speed"),
    [
        *itertools.product(MODELS, [0.0, -10.0]),
    ],
)
def test_speed(laws, paper_rig, name, speed):
    """A cam that stands still, or turns backwards, has no law of time."""
    with pytest.raises(CamRigError, match=rf"speed is {speed!r}.*allowed: finite and above 0"):
        advance(laws["poly345"], name, paper_rig, speed=speed)


@pytest.mark.parametrize("speed", [NAN, INF])
@pytest.mark.parametrize("name", list(MODELS))
def test_no_speed(laws, paper_rig, name, speed):
    """No cam turns at no number."""
    with pytest.raises(CamRigError, match=r"speed is (nan|inf).*allowed: finite"):
        advance(laws["poly345"], name, paper_rig, speed=speed)


@pytest.mark.parametrize("angle", [NAN, INF])
@pytest.mark.parametrize("name", list(MODELS))
def test_angle(laws, paper_rig, name, angle):
    """No place on the cam."""
    with pytest.raises(CamRigError, match=rf"angle is {angle!r}.*allowed: finite"):
        advance(laws["poly345"], name, paper_rig, angle=angle)


@pytest.mark.parametrize(
    ("numbers", "inner"), [((NAN, 0.0, 0.0), ()), ((0.0, INF, 0.0), ()), ((0.0, 0.0, 0.0), (NAN,))]
)
def test_state(numbers, inner):
    """A follower that is nowhere cannot be made, so no model ever meets it."""
    with pytest.raises(CamRigError, match=r"a follower whose \w+ is (nan|inf); allowed: finite"):
        FollowerState(*numbers, True, inner=inner)


@pytest.mark.parametrize("name", list(MODELS))
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_law(paper_rig, name, value):
    """A law with a number that is none cannot be made, so no model ever meets it."""
    ordinates = np.zeros((6, 1))
    ordinates[3] = value
    with pytest.raises(CamRigError, match=r"law 'broken': .* must be finite"):
        advance(Law("broken", np.array([0.0, TURN]), ordinates), name, paper_rig)


MASSES = {"two_mass": "roller_mass", "torsional": "cam_inertia"}
DAMPINGS = {"torsional": "shaft_damping"}


@pytest.mark.variants(8)
@pytest.mark.parametrize("name", list(MODELS))
@pytest.mark.parametrize("value", [-1.3, 0.0, NAN, INF])
def test_mass(paper_rig, name, value):
    """Each model's inertia: above zero."""
    key = MASSES.get(name, "mass")
    with pytest.raises(CamRigError, match=rf"{key} is {value!r}; allowed: finite and > 0"):
        replace(MODELS[name].parameters(paper_rig), **{key: value})


@pytest.mark.parametrize("name", list(MODELS))
@pytest.mark.parametrize("value", [-8.6, NAN, INF])
def test_damping(paper_rig, name, value):
    """A damper that pushes is a motor."""
    key = DAMPINGS.get(name, "damping")
    with pytest.raises(CamRigError, match=rf"{key} is {value!r}; allowed: finite and ≥ 0"):
        replace(MODELS[name].parameters(paper_rig), **{key: value})


@pytest.mark.parametrize("name", ["one_mass", "two_mass"])
@pytest.mark.parametrize("value", [1.0, 1.5, -0.1, NAN])
def test_restitution(paper_rig, name, value):
    """At e = 1 bounces never end, above it they grow."""
    with pytest.raises(CamRigError, match=rf"restitution is {value!r}; allowed: .*in \[0, 1\)"):
        replace(MODELS[name].parameters(paper_rig), restitution=value)
