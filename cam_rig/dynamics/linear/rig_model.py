"""Linear model of a rig in contact, as for scipy.signal and python-control.

The model is ẋ = A x + B u, y = C x + D u, with the matrices that the follower models use. Inputs
are the law and its derivatives, u = (s, ṡ, s̈), so that no output is improper. Outputs are
displacement (m), velocity (m/s) and acceleration (m/s²) of the follower (of the end mass, for two
masses) and the contact force (N). All are deviations from the state under the preload alone. In
steady state at an angular frequency ω the law is one number s, and u = (1, jω, −ω²) s.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import StateSpace

from cam_rig.arguments import check_arguments
from cam_rig.dynamics import elastic_stem
from cam_rig.dynamics.free_masses import (
    TWO_MASS_KEYS,
    TwoMassParameters,
    contact_response,
    force_output,
)
from cam_rig.dynamics.kinetostatic import force_weights
from cam_rig.dynamics.linear.response import Outputs
from cam_rig.dynamics.parameters import FollowerParameters
from cam_rig.errors import ConfigError, DynamicsError
from cam_rig.laws import Law
from cam_rig.schema import RigConfig
from cam_rig.units import TURN, ComplexArray, FloatArray

#: Law without motion, with which the matrices of the models are created. The matrices do not depend
#: on the law.
DWELL = Law("dwell", np.array([0.0, TURN]), np.zeros((1, 1)))
#: Name of the model of one rigid mass, which has no state in contact.
RIGID = "one_mass"
#: Name of the model of one mass on an elastic stem.
ELASTIC = "elastic_stem"
#: Name of the model of two masses with an elastic stem between them.
TWO = "two_mass"
#: Models in descending order of the number of rig parameters that they need.
MODELS = (TWO, ELASTIC, RIGID)
#: Largest accepted angular frequency of a frequency response, rad/s. Its square is far below the
#: largest float.
MAX_FREQUENCY = 1e100


@check_arguments
def state_space(rig: RigConfig, model: str | None = None) -> StateSpace:
    """Return the matrices A, B, C, D of the linear model of a rig in contact.

    ``model`` is the name of the follower model (None: the most detailed model that the rig allows).
    `RigConfig.state_space` documents the result.
    """
    system, drive, outputs = _matrices(rig, model)
    if not system.size:
        raise ConfigError(
            f"rig {rig.name}: a rigid follower in contact has no state; allowed: a rig with "
            "stem_stiffness, or frequency_response"
        )
    return StateSpace(system, drive, outputs.state, outputs.law)


@check_arguments
def frequency_response(
    rig: RigConfig, w: float | FloatArray, model: str | None = None
) -> ComplexArray:
    """Return the complex outputs of the linear model per lift, at frequencies ``w``.

    ``w`` is in rad/s. The shape of the result is ``(4, *w.shape)``. The outputs are displacement,
    velocity, acceleration and contact force. ``model`` is the name of the follower model (None: the
    most detailed model that the rig allows). `RigConfig.frequency_response` documents the result.
    """
    frequencies = np.asarray(w, dtype=np.float64)
    if not (np.abs(frequencies) <= MAX_FREQUENCY).all():
        raise ConfigError(f"w: is not all a number up to {MAX_FREQUENCY:g}; allowed: rad/s")
    system, drive, outputs = _matrices(rig, model)
    s = 1j * frequencies.ravel()
    law = np.stack([np.ones_like(s), s, s**2])
    response = outputs.law @ law
    if system.size:
        unit = np.eye(system.shape[0])
        try:
            states = np.linalg.solve(s[:, None, None] * unit - system, (drive @ law).T[..., None])
        except np.linalg.LinAlgError:
            raise DynamicsError(
                f"rig {rig.name}: w has the frequency of a mode without damping; allowed: damping, "
                "or another frequency"
            ) from None
        response = response + outputs.state @ states[..., 0].T
    return np.asarray(response.reshape(len(response), *frequencies.shape))


def _matrices(rig: RigConfig, model: str | None) -> tuple[FloatArray, FloatArray, Outputs]:
    """Return the matrices A and B, and the outputs of the linear model of a rig.

    The outputs are displacement, velocity, acceleration and contact force. A and B are empty for a
    rigid follower.
    """
    has_two_masses = all(getattr(rig.follower, key) is not None for key in TWO_MASS_KEYS)
    most_detailed = RIGID if rig.follower.stem_stiffness is None else ELASTIC
    name = (TWO if has_two_masses else most_detailed) if model is None else model
    if name == RIGID:
        weights = force_weights(FollowerParameters.from_rig(rig), 1.0)
        outputs = Outputs(np.zeros((4, 0)), np.vstack([np.eye(3), weights]), np.zeros(4))
        return np.zeros((0, 0)), np.zeros((0, 3)), outputs
    if name == ELASTIC:
        stem = FollowerParameters.on_stem(rig, "the model elastic_stem", "take the model one_mass")
        response = elastic_stem.response(DWELL, stem, 1.0)
        return response.matrix, response.drive, elastic_stem.outputs(stem)
    if name != TWO:
        raise ConfigError(f"model: is {name!r}; allowed: {', '.join(MODELS)}")
    masses = TwoMassParameters.from_rig(rig)
    response, force = contact_response(DWELL, masses, 1.0), force_output(masses)
    share = masses.share * np.eye(3)
    state = np.vstack([np.eye(2), response.matrix[1:], force.state])
    law = np.vstack([share[:2], response.drive[1:] + share[2:], force.law])
    return response.matrix, response.drive, Outputs(state, law, np.zeros(4))
