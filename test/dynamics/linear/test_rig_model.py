"""A rig's linear model for scipy: the closed forms of its transfer, and the exact propagator."""

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
    """Rigs of numbers over some decades; the last numbers are those of the stem."""
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
    """x/s and F/s by hand."""
    own, s = rig.follower, 1j * w
    m, k, c = own.mass.si, own.spring_stiffness.si, own.damping.si
    if model == "one_mass":
        return np.ones_like(s), k + c * s + m * s**2
    stem, roller = own.stem_stiffness.si, 0.0
    if model == "two_mass":
        roller, stem = own.roller_share.si * m, stem + own.stem_damping.si * s
    x = stem / (stem + k + c * s + (m - roller) * s**2)
    return x, stem * (1.0 - x) + roller * s**2


@pytest.mark.parametrize("model", rig_model.MODELS)
def test_the_frequency_response_is_the_closed_form(model):
    """Also velocity and acceleration: jω and (jω)² of the displacement."""
    for rig in rigs(20):
        x, velocity, acceleration, force = rig.frequency_response(W, model)
        by_hand, pushed = closed_form(rig, model, W)
        # the vibration about the static share cancels it far above the eigenfrequency
        rounding = 1e-10 * (1.0 + np.abs(by_hand))
        assert (np.abs(x - by_hand) <= rounding).all()
        assert (np.abs(velocity - 1j * W * by_hand) <= W * rounding).all()
        assert (np.abs(acceleration + W**2 * by_hand) <= W**2 * rounding).all()
        scale = rig.follower.stem_stiffness.si * (1.0 + np.abs(by_hand)) + np.abs(pushed)
        assert (np.abs(force - pushed) <= 1e-9 * scale).all()


def test_the_state_space_moves_as_the_model_does():
    """scipy's lsim, which joins its input by lines, comes as near as its steps are short."""
    rig, law = cam_rig.load_rig("tm21"), cam_rig.build_law(cam_rig.load_cam("poly345"))
    rig, speed = rig.replace(stem_stiffness="40 N/mm"), 30.0
    system = rig.state_space()
    own = FollowerParameters.from_rig(rig)
    away = []
    for steps in (2000, 4000):
        time = np.linspace(0.0, 0.2, steps + 1)
        motion = law.motion_at(speed * time) * speed ** np.arange(3)[:, None]
        _, out, states = lsim(system, motion.T, time)
        exact = elastic_stem.response(law, own, speed).states(np.zeros(2), 0.0, time)
        away.append(np.abs(states.T - exact).max() / np.abs(exact).max())
    assert away[1] < away[0] / 2.5 < 1e-5  # by the square of the step, but for joints between
    x = out[:, 0]
    assert np.abs(x - motion[0]).max() < 0.5 * law.lift  # near the law, below it by the spring
    pushed = own.stem_stiffness * (motion[0] - x)
    np.testing.assert_allclose(out[:, 3], pushed, rtol=1e-9, atol=1e-6)


def test_what_a_rig_cannot_tell():
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


def test_the_model_is_where_a_rig_looks_for_it():
    assert rig_model.__name__ == schema.LINEAR
