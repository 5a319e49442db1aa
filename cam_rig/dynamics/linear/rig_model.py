"""A rig's own linear model in contact, as scipy.signal and python-control have it.

The law is the input, with its derivatives: u = (s, ṡ, s̈), so that no output is improper. Outputs
are displacement x (m), velocity (m/s) and acceleration (m/s²) of the follower, of two masses of the
end mass, and the contact force (N). All are deviations from what the preload alone makes:
ẋ = A x + B u, y = C x + D u with the matrices that the models themselves run on. In steady state
at a frequency ω the law is one number s, and u = (1, jω, −ω²) s.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import StateSpace

from cam_rig.arguments import checked
from cam_rig.dynamics import elastic_stem
from cam_rig.dynamics.free_masses import (
    NEEDED,
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

#: A law that the models' matrices are taken with: they depend on no law and no speed.
DWELL = Law("dwell", np.array([0.0, TURN]), np.zeros((1, 1)))
#: Models by how much of a rig they need, the most first.
RIGID, ELASTIC, TWO = "one_mass", "elastic_stem", "two_mass"
MODELS = (TWO, ELASTIC, RIGID)
#: Angular frequencies (rad/s) whose square is a number, by far.
FASTEST = 1e100


@checked
def state_space(rig: RigConfig, model: str | None = None) -> StateSpace:
    """Matrices A, B, C, D of a rig's model in contact; `RigConfig.state_space` says more."""
    system, drive, outputs = _matrices(rig, model)
    if not system.size:
        raise ConfigError(
            f"rig {rig.name}: a rigid follower in contact has no state; allowed: a rig with "
            "stem_stiffness, or frequency_response"
        )
    return StateSpace(system, drive, outputs.state, outputs.law)


@checked
def frequency_response(
    rig: RigConfig, w: float | FloatArray, model: str | None = None
) -> ComplexArray:
    """Outputs per lift at frequencies; `RigConfig.frequency_response` says more."""
    rates = np.asarray(w, dtype=np.float64)
    if not (np.abs(rates) <= FASTEST).all():
        raise ConfigError(f"w: is not all a number up to {FASTEST:g}; allowed: rad/s")
    system, drive, outputs = _matrices(rig, model)
    s = 1j * rates.ravel()
    law = np.stack([np.ones_like(s), s, s**2])
    found = outputs.law @ law
    if system.size:
        unit = np.eye(system.shape[0])
        try:
            states = np.linalg.solve(s[:, None, None] * unit - system, (drive @ law).T[..., None])
        except np.linalg.LinAlgError:
            raise DynamicsError(
                f"rig {rig.name}: w has the frequency of a mode without damping; allowed: damping, "
                "or another frequency"
            ) from None
        found = found + outputs.state @ states[..., 0].T
    return np.asarray(found.reshape(len(found), *rates.shape))


def _matrices(rig: RigConfig, model: str | None) -> tuple[FloatArray, FloatArray, Outputs]:
    """A, B, and C and D of displacement, velocity, acceleration and force."""
    chosen = _own(rig) if model is None else model
    if chosen == RIGID:
        force = force_weights(FollowerParameters.from_rig(rig), 1.0)
        outputs = Outputs(np.zeros((4, 0)), np.vstack([np.eye(3), force]), np.zeros(4))
        return np.zeros((0, 0)), np.zeros((0, 3)), outputs
    if chosen == ELASTIC:
        stem = FollowerParameters.on_stem(rig, "the model elastic_stem", "take the model one_mass")
        found = elastic_stem.response(DWELL, stem, 1.0)
        return found.matrix, found.drive, elastic_stem.outputs(stem)
    if chosen != TWO:
        raise ConfigError(f"model: is {chosen!r}; allowed: {', '.join(MODELS)}")
    masses = TwoMassParameters.from_rig(rig)
    found, pushed = contact_response(DWELL, masses, 1.0), force_output(masses)
    share = masses.share * np.eye(3)
    state = np.vstack([np.eye(2), found.matrix[1:], pushed.state])
    law = np.vstack([share[:2], found.drive[1:] + share[2:], pushed.law])
    return found.matrix, found.drive, Outputs(state, law, np.zeros(4))


def _own(rig: RigConfig) -> str:
    """The fullest model that the rig's numbers suffice for."""
    if all(getattr(rig.follower, key) is not None for key in NEEDED):
        return TWO
    return RIGID if rig.follower.stem_stiffness is None else ELASTIC
