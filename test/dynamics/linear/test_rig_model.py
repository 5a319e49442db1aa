"""Linear model of a rig against closed forms and the exact solution.

The model is a state-space system or a frequency response from the lift to the follower.
"""

import numpy as np
import pytest
from scipy.signal import lsim

import cam_rig
from cam_rig.dynamics import FollowerParameters, elastic_stem
from cam_rig.dynamics.linear import rig_model
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.schema import rig as schema

W = np.geomspace(1.0, 3e4, 40)


def rigs(count):
    """Yield rigs whose random mass, stiffness and damping cover several decades."""
    random = np.random.default_rng(5)
    for _ in range(count):
        mass, spring, stem = 10.0 ** random.uniform((-2, 2, 5), (2, 5, 9))
        critical = 2.0 * np.sqrt(mass * np.array([spring, stem]))
        damping, stem_damping = random.uniform(1e-3, 1e-2, 2) * critical
        yield cam_rig.Rig(
            mass=mass,
            spring=spring,
            preload=30.0,
            damping=damping,
            stem_stiffness=stem,
            roller_share=random.uniform(0.05, 0.9),
            stem_damping=stem_damping,
        )


def closed_form(rig, model, w):
    """Return the transfer functions x/s and F/s at the angular frequencies w (rad/s).

    x is the follower's displacement, F the contact force, and s the lift.
    """
    follower, s = rig.follower, 1j * w
    m, k, c = follower.mass.si, follower.spring_stiffness.si, follower.damping.si
    if model == "one_mass":
        return np.ones_like(s), k + c * s + m * s**2
    stem, roller = follower.stem_stiffness.si, 0.0
    if model == "two_mass":
        roller, stem = follower.roller_share.si * m, stem + follower.stem_damping.si * s
    x = stem / (stem + k + c * s + (m - roller) * s**2)
    return x, stem * (1.0 - x) + roller * s**2


@pytest.mark.parametrize("model", rig_model.MODELS)
def test_the_frequency_response_is_the_closed_form(model):
    """All outputs of the linear model's frequency response agree with closed forms.

    Velocity is jω x and acceleration −ω² x. The relative tolerance is 1e-10.
    """
    for rig in rigs(20):
        x, velocity, acceleration, force = rig.frequency_response(W, model)
        exact_x, exact_force = closed_form(rig, model, W)
        # Far above the natural frequency the vibration cancels the static part, which leaves
        # rounding errors.
        rounding = 1e-10 * (1.0 + np.abs(exact_x))
        assert (np.abs(x - exact_x) <= rounding).all()
        assert (np.abs(velocity - 1j * W * exact_x) <= W * rounding).all()
        assert (np.abs(acceleration + W**2 * exact_x) <= W**2 * rounding).all()
        scale = rig.follower.stem_stiffness.si * (1.0 + np.abs(exact_x)) + np.abs(exact_force)
        assert (np.abs(force - exact_force) <= 1e-9 * scale).all()


def test_the_state_space_converges_to_the_model():
    """A simulation of the linear state-space model converges to the exact model.

    Half the time step of scipy's lsim must reduce the error by more than 2.5.
    """
    rig, law = cam_rig.load_rig("tm21"), cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig, speed = rig.replace(stem_stiffness="40 N/mm"), 30.0
    system = rig.state_space()
    follower = FollowerParameters.from_rig(rig)
    errors = []
    for steps in (2000, 4000):
        time = np.linspace(0.0, 0.2, steps + 1)
        motion = law.motion_at(speed * time) * speed ** np.arange(3)[:, None]
        _, out, states = lsim(system, motion.T, time)
        exact = elastic_stem.response(law, follower, speed).states(np.zeros(2), 0.0, time)
        errors.append(np.abs(states.T - exact).max() / np.abs(exact).max())
    assert errors[1] < errors[0] / 2.5 < 1e-5  # second order, except at joints
    x = out[:, 0]
    assert np.abs(x - motion[0]).max() < 0.5 * law.lift  # lower because of the spring
    force = follower.stem_stiffness * (motion[0] - x)
    np.testing.assert_allclose(out[:, 3], force, rtol=1e-9, atol=1e-6)


def test_errors_of_the_linear_model():
    """A missing number, an unknown model and an invalid frequency are errors."""
    rigid = cam_rig.Rig(mass=1.3, spring=4000.0, preload=30.0)
    with pytest.raises(ConfigError, match="no state; allowed: a rig with stem_stiffness"):
        rigid.state_space()
    with pytest.raises(ConfigError, match="stem_stiffness: is missing"):
        rigid.state_space("elastic_stem")
    with pytest.raises(ConfigError, match="model: is 'torsional'; allowed: two_mass"):
        rigid.frequency_response(1.0, "torsional")
    with pytest.raises(ConfigError, match=r"w: is not all a number up to 1e[+]100"):
        rigid.frequency_response(np.array([1.0, np.nan]))
    elastic = cam_rig.Rig(mass=1.0, spring=1.0, preload=0.0, stem_stiffness=3.0)
    with pytest.raises(DynamicsError, match="mode without damping"):
        elastic.frequency_response(2.0)
    assert elastic.frequency_response(np.ones((2, 3))).shape == (4, 2, 3)


def test_a_rig_imports_the_right_module():
    """`cam_rig.schema.rig` refers to the linear model by its correct module name."""
    assert rig_model.__name__ == schema.LINEAR
