"""Exact derivatives of the jump speed by the numbers of the rig and the cam.

At the jump speed Ω the least contact force is zero, at one angle of one turn: F(Ω, θ; p) = 0 and
∂F/∂θ = 0. Therefore dΩ/dp = −(∂F/∂p)/(∂F/∂Ω) for a number p, both at that angle. F is an analytic
function of all numbers. Its derivatives are computed by a step of 1e-30 along the imaginary axis,
which has no cancellation (Squire and Trapp 1998).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.any_follower import follower_of
from cam_rig.dynamics.jump.two_masses import REST_DURATION_S, solve_threshold
from cam_rig.dynamics.modal.first_zero import Climb
from cam_rig.errors import CamRigError, DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.quantities.values import Subject
from cam_rig.schema import RigConfig
from cam_rig.studies.campaign.campaign import CampaignMeasure, make_point
from cam_rig.studies.campaign.inputs import ProfileErrors
from cam_rig.units import RPM, TURN, FloatArray

if TYPE_CHECKING:
    from cam_rig.studies.campaign.results import CampaignResult

#: Imaginary step in a number (SI) for its derivative. It is so small that its square is negligible.
IMAGINARY_STEP = 1e-30
#: Smallest distance (rad of cam angle) between the loss of contact and the end of a run. If it is
#: smaller, the jump speed has no derivative.
END_DISTANCE = 1e-6
#: Keys of the follower's numbers in a rig file on which the motion of two masses depends.
FOLLOWER = (
    *("mass", "roller_share", "spring_stiffness", "stem_stiffness"),
    *("damping", "stem_damping", "preload"),
)


def touch_of(law: Law, follower: TwoMassParameters, duration: float | None) -> Climb:
    """Return the jump speed of a law and the cam angle at which contact is first lost.

    The jump speed is the lowest speed with loss of contact. ``duration`` (s) is that of the run
    from rest, None for the steady state. A loss of contact at the end of the run raises a
    `DynamicsError`, because the jump speed then has no derivative.
    """
    touch = solve_threshold(law, follower, duration)
    if duration is not None and duration * touch.speed - touch.angle < END_DISTANCE:
        raise DynamicsError(
            "no derivative: contact is lost at the end of the run, not where the force is least"
        )
    return touch


def contact_force(
    law: Law,
    ordinates: NDArray[Any],
    numbers: Mapping[str, complex],
    speed: complex,
    angle: float,
    duration: float | None,
) -> complex:
    """Return the contact force (N) of two masses at an angle (rad) of a run.

    The angle is counted from the start of the run. The follower's ``numbers`` (SI), the ordinates
    of the law ``(p + 1, n)`` (m), and the speed (rad/s) may be complex. The method is that of
    `cam_rig.dynamics.modal.motion`: a polynomial in each piece of the law, and a free vibration
    that compensates its jumps at joints. ``duration`` None is the steady state.
    """
    p, touched = numbers, angle % TURN
    stiffness = p["stem_stiffness"] + p["spring_stiffness"]
    damping = p["stem_damping"] + p["damping"]
    share, end = p["stem_stiffness"] / stiffness, p["end_mass"]
    top = np.array([0.0, (p["stem_damping"] - damping * share) / end, -share])
    free = _FreeVibration(stiffness / end, damping / end)
    s = _derivatives(law, ordinates) * (speed ** np.arange(law.degree + 2))[:, None, None]
    series = taylor_series(top, np.array([free.stiffness, free.damping, 1.0]), law.degree + 1)
    forced = np.stack([np.tensordot(series, s[k : k + law.degree + 1], 1) for k in (0, 1)])
    piece = law.piece(touched)
    free_state = _free_vibration_state(law, free, forced, speed, angle, duration)
    u = np.array([(touched - law.breaks[piece]) / law.spans[piece]])
    basis = bernstein.basis(law.degree, u)[0]
    state = forced[:, :, piece] @ basis + free_state
    ratio = p["spring_stiffness"] / stiffness
    force = np.array([p["stem_stiffness"] * ratio, p["stem_damping"] * ratio, p["roller_mass"]])
    stem = np.array([p["stem_stiffness"], p["stem_damping"]])
    return complex(force @ (s[:3, :, piece] @ basis) - stem @ state + share * p["preload"])


def taylor_series(top: NDArray[Any], bottom: NDArray[Any], count: int) -> NDArray[Any]:
    """Return the first ``count`` Taylor coefficients of a ratio of two polynomials.

    ``top`` and ``bottom`` are the coefficients of the polynomials in rising order.
    """
    dtype = np.result_type(top, bottom)
    coefficients = np.zeros(count, dtype)
    remainder = np.zeros(count + bottom.size, dtype)
    remainder[: top.size] = top
    for k in range(count):
        coefficients[k] = remainder[k] / bottom[0]
        remainder[k : k + bottom.size] -= coefficients[k] * bottom
    return coefficients


def _derivatives(law: Law, ordinates: NDArray[Any]) -> NDArray[Any]:
    """Return the Bernstein ordinates of s and of all its derivatives by θ.

    The shape is ``(p + 2, p + 1, n)`` for a law of degree p with n pieces.
    """
    rows = [ordinates]
    for _ in range(law.degree + 1):
        rows.append(bernstein.derivative(rows[-1]) / law.spans)
    return np.stack([bernstein.elevate(row, law.degree) for row in rows])


def _free_vibration_state(
    law: Law,
    free: _FreeVibration,
    forced: NDArray[Any],
    speed: complex,
    angle: float,
    duration: float | None,
) -> NDArray[Any]:
    """Return the free vibration (η, η̇) of the end mass where contact is lost.

    It is the sum of the vibrations excited at all earlier joints between pieces of the law, each
    decayed since then. ``forced`` are the Bernstein ordinates of the polynomial solution in each
    piece. ``angle`` (rad) is the angle of the loss of contact. ``duration`` is that of the run from
    rest, None for the steady state.
    """
    jumps = np.roll(forced[:, -1], 1, axis=1) - forced[:, 0]
    turns, touched = divmod(angle, TURN)
    starts, passed = law.breaks[:-1], slice(1, law.piece(touched) + 1)
    state = free.after((touched - starts[passed]) / speed, jumps[:, passed])
    if duration is None:
        turn = free.after((TURN - starts[1:]) / speed, jumps[:, 1:]) + jumps[:, 0]
        initial = np.linalg.solve(np.eye(2) - free.flow(TURN / speed), turn)
        return np.asarray(state + free.flow(touched / speed) @ initial)
    total_angle = TURN * turns + touched
    # the run starts at rest at θ = 0
    state = state - free.flow(total_angle / speed) @ forced[:, 0, 0]
    for ahead in (total_angle - TURN * turn for turn in range(int(turns))):
        state = state + free.after((ahead - starts[1:]) / speed, jumps[:, 1:])
        state = state + free.flow((ahead - TURN) / speed) @ jumps[:, 0]
    return np.asarray(state)


@dataclass(frozen=True)
class _FreeVibration:
    """Free vibration η̈ + damping η̇ + stiffness η = 0 of the end mass.

    Both coefficients are divided by the mass. They may be complex, for derivatives by an imaginary
    step.
    """

    stiffness: complex
    damping: complex

    def flow(self, time: complex) -> NDArray[Any]:
        """Return the matrix e^{At}, ``(2, 2)``, that advances (η, η̇) by a time (s)."""
        return np.stack([self.after(np.array([time]), x[:, None]) for x in np.eye(2)], axis=1)

    def after(self, times: NDArray[Any], states: NDArray[Any]) -> NDArray[Any]:
        """Return the sum, ``(2,)``, of n states (η, η̇), each advanced by its time (s).

        ``states`` is ``(2, n)`` and ``times`` is ``(n,)``.
        """
        half = 0.5 * self.damping
        pulse = np.sqrt(self.stiffness - half**2 + 0j)
        fading, (y, v) = np.exp(-half * times), states
        sine, cosine = np.sin(pulse * times) / pulse, np.cos(pulse * times)
        displacement = fading * (cosine * y + sine * (v + half * y))
        rate = fading * (cosine * v - sine * (self.stiffness * y + half * v))
        return np.array([displacement.sum(), rate.sum()])


@dataclass(frozen=True)
class JumpSensitivity:
    """Derivative dΩ/dp (SI) of the jump speed Ω by an input p of a campaign.

    The jump speed is the lowest speed with loss of contact. ``value`` is the value (SI) of the
    input at which the derivative is computed. The derivative is None if the input moves joints
    between pieces of the law, or is neither a number of the follower nor of the profile errors.
    """

    path: str
    value: float
    derivative: float | None


def jump_sensitivities(
    point: Subject, inputs: Mapping[str, float], duration: float | None
) -> tuple[JumpSensitivity, ...]:
    """Return the derivatives of the jump speed of two masses by each input.

    ``point`` is the rig at which they are computed, and ``inputs`` are its input values (SI) by
    path. Derivatives exist for the numbers of the follower, and for size, amplitudes and phases of
    profile errors. The derivative by any other input is None.
    """
    law, follower = point.law, TwoMassParameters.from_rig(point.rig)
    touch, numbers = touch_of(law, follower, duration), _numbers(point.rig)

    def slope(changed: Mapping[str, complex], rows: NDArray[Any], speed: complex) -> float:
        return contact_force(law, rows, changed, speed, touch.angle, duration).imag / IMAGINARY_STEP

    profile = "profile."
    errors = ProfileErrors.of(
        {path.removeprefix(profile): x for path, x in inputs.items() if path.startswith(profile)}
    )
    by_speed = slope(numbers, law.ordinates, complex(touch.speed, IMAGINARY_STEP))
    sensitivities = []
    for path, value in inputs.items():
        root, _, name = path.rpartition(".")
        derivative = None
        if root == "rig.follower" and name in FOLLOWER:
            moved = _numbers(point.rig, name)
            derivative = -slope(moved, law.ordinates, touch.speed) / by_speed
        elif (ordinates := _error_slope(path, errors, law)) is not None:
            rows = law.ordinates + 1j * IMAGINARY_STEP * ordinates
            derivative = -slope(numbers, rows, touch.speed) / by_speed
        sensitivities.append(JumpSensitivity(path, value, derivative))
    return tuple(sensitivities)


def _error_slope(path: str, errors: ProfileErrors, law: Law) -> FloatArray | None:
    """Return the derivative of the law's ordinates ``(p + 1, n)`` by a profile error.

    The result is None if the path is not that of a profile error with a derivative.
    """
    eccentric = replace(errors, size=0.0, waviness=0.0)
    wavy = replace(errors, size=0.0, eccentricity=0.0)
    phases = errors.eccentricity_phase + 0.5 * math.pi, errors.waviness_phase + 0.5 * math.pi
    moved = {
        "profile.size": ProfileErrors(size=1.0),
        "profile.eccentricity.amplitude": replace(eccentric, eccentricity=1.0),
        "profile.eccentricity.phase": replace(eccentric, eccentricity_phase=phases[0]),
        "profile.waviness.amplitude": replace(wavy, waviness=1.0),
        "profile.waviness.phase": replace(wavy, waviness_phase=phases[1]),
    }
    return moved[path].ordinates(law.breaks, law.degree) if path in moved else None


def _numbers(rig: RigConfig, moved: str = "") -> dict[str, complex]:
    """Return the parameters of the two masses (SI), one with an imaginary step.

    ``moved`` is the key in the rig file of the parameter with the step. If it is empty, all
    parameters are real.
    """
    numbers = {name: complex(getattr(rig.follower, name).si) for name in FOLLOWER}
    if moved:
        numbers[moved] += 1j * IMAGINARY_STEP
    mass, share = numbers.pop("mass"), numbers.pop("roller_share")
    return {**numbers, "roller_mass": mass * share, "end_mass": mass - mass * share}


#: Duration (s) of the run from rest for each kind of jump speed that has derivatives, None for the
#: steady state.
RUNS = {"jump_speed": REST_DURATION_S, "jump_speed_steady": None}


@dataclass(frozen=True)
class FirstOrder:
    """Derivatives of a jump speed by all inputs, and the spread that they predict.

    The derivatives are computed at the medians of the inputs. ``predicted`` and ``observed`` are
    standard deviations in rad/s. ``predicted`` is √Σ(dΩ/dp · σ_p)² for independent inputs. For
    ``correlated`` inputs it includes their covariances. ``observed`` is that of the ``points``
    points with a finite jump speed.
    """

    measure: CampaignMeasure
    inputs: tuple[JumpSensitivity, ...]
    predicted: float
    observed: float
    correlated: bool
    points: int


def first_orders(results: CampaignResult) -> list[FirstOrder]:
    """Return the derivatives and the predicted spread of each measured jump speed.

    The list is empty if the follower is not two masses, or if the medians of the inputs give an
    invalid rig or no jump speed.
    """
    campaign = results.campaign
    middle = campaign.draws.middle()
    try:
        point = make_point(campaign, middle)
        if not isinstance(follower_of(point.rig), TwoMassParameters):
            return []
        numbers = dict(zip((item.path for item in campaign.inputs), middle.tolist(), strict=True))
        orders = []
        for measure in campaign.measures:
            if measure.term.name in RUNS:
                duration = RUNS[measure.term.name]
                inputs = jump_sensitivities(point, numbers, duration)
                values = results.values(measure)
                values = values[np.isfinite(values)]
                spread, correlated = float(np.std(values)) * RPM, bool(campaign.config.correlated)
                predicted, count = _predicted(results, inputs, correlated), values.size
                orders.append(FirstOrder(measure, inputs, predicted, spread, correlated, count))
    except CamRigError:  # the medians of the inputs give an invalid cam or rig, or no jump speed
        return []
    return orders


def _predicted(
    results: CampaignResult, inputs: tuple[JumpSensitivity, ...], correlated: bool
) -> float:
    """Return the standard deviation (rad/s) of the jump speed to first order.

    It follows from the derivatives and the values of the inputs at all points. ``correlated``
    includes the covariances of the inputs.
    """
    derivatives = [(item.path, item.derivative) for item in inputs if item.derivative is not None]
    parts = [derivative * results.input_values(path) for path, derivative in derivatives]
    if correlated and parts:
        return float(np.std(np.sum(parts, axis=0)))
    return math.sqrt(sum(float(np.var(part)) for part in parts))
