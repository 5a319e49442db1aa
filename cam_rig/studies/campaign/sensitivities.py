"""Local derivatives of the jump speed, exact, by the implicit function at the touching point.

At the jump speed the least contact force is zero, at one angle of one turn: F(Ω, θ; p) = 0 and
∂F/∂θ = 0. So dΩ/dp = −(∂F/∂p)/(∂F/∂Ω), both at that angle. F is an analytic function of every
number, and its derivatives are taken by a step of 1e-30 along the imaginary axis, which no
cancellation takes digits from (Squire and Trapp 1998).
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
from cam_rig.dynamics.jump.two_masses import FROM_REST, solve_threshold
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

#: The imaginary step.
STEP = 1e-30
#: No derivative is told where contact is lost within so many rad of the end of a run.
NEAR = 1e-6
#: Numbers of a rig's follower that the two masses are made of.
FOLLOWER = (
    *("mass", "roller_share", "spring_stiffness", "stem_stiffness"),
    *("damping", "stem_damping", "preload"),
)


def touch_of(law: Law, follower: TwoMassParameters, duration: float | None) -> Climb:
    """The touch at the jump speed of a run from rest of so many s, or in steady state (None)."""
    found = solve_threshold(law, follower, duration)
    if duration is not None and duration * found.speed - found.angle < NEAR:
        raise DynamicsError(
            "no derivative: contact is lost at the end of the run, not where the force is least"
        )
    return found


def contact_force(
    law: Law,
    ordinates: NDArray[Any],
    numbers: Mapping[str, complex],
    speed: complex,
    angle: float,
    duration: float | None,
) -> complex:
    """The contact force (N) of two masses at an angle from the begin, from rest or steady.

    Any of the numbers, of the law's ordinates ``(p + 1, n)`` (m), and the speed (rad/s) may be
    complex. As in `cam_rig.dynamics.modal.motion`: a polynomial in each piece, and free vibration
    that makes up for its jumps at joints.
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
    here = _free_state(law, free, forced, speed, angle, duration)
    u = np.array([(touched - law.breaks[piece]) / law.spans[piece]])
    basis = bernstein.basis(law.degree, u)[0]
    place = forced[:, :, piece] @ basis + here
    left = p["spring_stiffness"] / stiffness
    force = np.array([p["stem_stiffness"] * left, p["stem_damping"] * left, p["roller_mass"]])
    own = np.array([p["stem_stiffness"], p["stem_damping"]])
    return complex(force @ (s[:3, :, piece] @ basis) - own @ place + share * p["preload"])


def taylor_series(top: NDArray[Any], bottom: NDArray[Any], count: int) -> NDArray[Any]:
    """Taylor coefficients of top(D)/bottom(D), by long division; complex where these are."""
    kind = np.result_type(top, bottom)
    found = np.zeros(count, kind)
    rest = np.zeros(count + bottom.size, kind)
    rest[: top.size] = top
    for k in range(count):
        found[k] = rest[k] / bottom[0]
        rest[k : k + bottom.size] -= found[k] * bottom
    return found


def _derivatives(law: Law, ordinates: NDArray[Any]) -> NDArray[Any]:
    """``(p + 2, p + 1, n)``: ordinates of s and of all its derivatives in θ."""
    rows = [ordinates]
    for _ in range(law.degree + 1):
        rows.append(bernstein.derivative(rows[-1]) / law.spans)
    return np.stack([bernstein.elevate(row, law.degree) for row in rows])


def _free_state(
    law: Law,
    free: _FreeVibration,
    forced: NDArray[Any],
    speed: complex,
    angle: float,
    duration: float | None,
) -> NDArray[Any]:
    """(η, η̇) of the free vibration at the touch: what the joints before it have added, faded."""
    jumps = np.roll(forced[:, -1], 1, axis=1) - forced[:, 0]
    turns, touched = divmod(angle, TURN)
    starts, passed = law.breaks[:-1], slice(1, law.piece(touched) + 1)
    here = free.after((touched - starts[passed]) / speed, jumps[:, passed])
    if duration is None:
        turn = free.after((TURN - starts[1:]) / speed, jumps[:, 1:]) + jumps[:, 0]
        begin = np.linalg.solve(np.eye(2) - free.flow(TURN / speed), turn)
        return np.asarray(here + free.flow(touched / speed) @ begin)
    since = TURN * turns + touched
    here = here - free.flow(since / speed) @ forced[:, 0, 0]  # at rest at θ = 0
    for ahead in (since - TURN * turn for turn in range(int(turns))):
        here = here + free.after((ahead - starts[1:]) / speed, jumps[:, 1:])
        here = here + free.flow((ahead - TURN) / speed) @ jumps[:, 0]
    return np.asarray(here)


@dataclass(frozen=True)
class _FreeVibration:
    """η̈ + damping η̇ + stiffness η = 0, any of it complex."""

    stiffness: complex
    damping: complex

    def flow(self, time: complex) -> NDArray[Any]:
        """e^{At}, ``(2, 2)``."""
        return np.stack([self.after(np.array([time]), x[:, None]) for x in np.eye(2)], axis=1)

    def after(self, times: NDArray[Any], states: NDArray[Any]) -> NDArray[Any]:
        """What states ``(2, n)`` come to, each after its time, in all, ``(2,)``."""
        half = 0.5 * self.damping
        pulse = np.sqrt(self.stiffness - half**2 + 0j)
        fading, (y, v) = np.exp(-half * times), states
        sine, cosine = np.sin(pulse * times) / pulse, np.cos(pulse * times)
        place = fading * (cosine * y + sine * (v + half * y))
        rate = fading * (cosine * v - sine * (self.stiffness * y + half * v))
        return np.array([place.sum(), rate.sum()])


@dataclass(frozen=True)
class JumpSensitivity:
    """dΩ/dp (SI) of an input; None where it moves joints, or is not the follower's."""

    path: str
    value: float
    derivative: float | None


def jump_sensitivities(
    point: Subject, inputs: Mapping[str, float], duration: float | None
) -> tuple[JumpSensitivity, ...]:
    """The derivative of the jump speed of two masses in each input, at one point.

    There is one in the numbers of the rig's follower, and in the size, amplitudes and phases of
    profile errors; the others say why not.
    """
    law, follower = point.law, TwoMassParameters.from_rig(point.rig)
    touch, numbers = touch_of(law, follower, duration), _numbers(point.rig)

    def slope(changed: Mapping[str, complex], rows: NDArray[Any], speed: complex) -> float:
        return contact_force(law, rows, changed, speed, touch.angle, duration).imag / STEP

    profile = "profile."
    errors = ProfileErrors.of(
        {path.removeprefix(profile): x for path, x in inputs.items() if path.startswith(profile)}
    )
    by_speed = slope(numbers, law.ordinates, complex(touch.speed, STEP))
    found = []
    for path, value in inputs.items():
        root, _, name = path.rpartition(".")
        derivative = None
        if root == "rig.follower" and name in FOLLOWER:
            moved = _numbers(point.rig, name)
            derivative = -slope(moved, law.ordinates, touch.speed) / by_speed
        elif (ordinates := _error_slope(path, errors, law)) is not None:
            rows = law.ordinates + 1j * STEP * ordinates
            derivative = -slope(numbers, rows, touch.speed) / by_speed
        found.append(JumpSensitivity(path, value, derivative))
    return tuple(found)


def _error_slope(path: str, errors: ProfileErrors, law: Law) -> FloatArray | None:
    """How a law's ordinates ``(p + 1, n)`` move with an error of its profile; None with others."""
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
    """The two masses' numbers, with one of the rig's moved along the imaginary axis."""
    own = {name: complex(getattr(rig.follower, name).si) for name in FOLLOWER}
    if moved:
        own[moved] += 1j * STEP
    mass, share = own.pop("mass"), own.pop("roller_share")
    return {**own, "roller_mass": mass * share, "end_mass": mass - mass * share}


#: Measures that have derivatives, and how the follower runs.
RUNS = {"jump_speed": FROM_REST, "jump_speed_steady": None}


@dataclass(frozen=True)
class FirstOrder:
    """Derivatives of a jump speed in the middle of every input, and the spread they predict.

    Standard deviations in rad/s: ``predicted`` is √Σ(dΩ/dp · σ_p)² of independent inputs, with the
    covariances of ``correlated`` ones; ``found`` that of the points with a finite jump speed.
    """

    measure: CampaignMeasure
    inputs: tuple[JumpSensitivity, ...]
    predicted: float
    found: float
    correlated: bool
    points: int


def first_orders(results: CampaignResult) -> list[FirstOrder]:
    """One for each jump speed of two masses that the middle of the inputs has."""
    campaign = results.campaign
    middle = campaign.draws.middle()
    try:
        point = make_point(campaign, middle)
        if not isinstance(follower_of(point.rig), TwoMassParameters):
            return []
        numbers = dict(zip((one.path for one in campaign.inputs), middle.tolist(), strict=True))
        found = []
        for measure in campaign.measures:
            if measure.term.name in RUNS:
                duration = RUNS[measure.term.name]
                inputs = jump_sensitivities(point, numbers, duration)
                values = results.values(measure)
                values = values[np.isfinite(values)]
                spread, correlated = float(np.std(values)) * RPM, bool(campaign.config.correlated)
                predicted, count = _predicted(results, inputs, correlated), values.size
                found.append(FirstOrder(measure, inputs, predicted, spread, correlated, count))
    except CamRigError:  # no such cam or rig, or no jump speed: no derivative either
        return []
    return found


def _predicted(
    results: CampaignResult, inputs: tuple[JumpSensitivity, ...], correlated: bool
) -> float:
    """The standard deviation (rad/s) that the derivatives and the drawn inputs predict."""
    known = [(one.path, one.derivative) for one in inputs if one.derivative is not None]
    parts = [derivative * results.input_values(path) for path, derivative in known]
    if correlated and parts:
        return float(np.std(np.sum(parts, axis=0)))
    return math.sqrt(sum(float(np.var(part)) for part in parts))
