"""Steady turns of a scene's follower model at one speed: forces, sound level, lift-offs.

A turn of the cam is steady if the turns after it repeat it. If the follower keeps contact, the
periodic state is the solution of one linear system, and the extreme forces are exact, also between
samples. If it lifts off, turns are simulated from rest until a turn no longer changes the state. If
the state does not become steady within `MAX_FORCE_TURNS` turns, the turns after them are evaluated
and reported as not steady.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from cam_rig.dynamics import (
    MODELS,
    Block,
    FollowerParameters,
    FollowerState,
    Interval,
    TwoMassParameters,
    elastic_stem,
)
from cam_rig.dynamics.free_masses import contact_response, force_output
from cam_rig.dynamics.kinetostatic import force_extremes, force_weights
from cam_rig.dynamics.linear.response import LinearResponse, Outputs
from cam_rig.dynamics.modal.run import ModalRun
from cam_rig.dynamics.steady_rules import FORCE_RTOL, MAX_FORCE_TURNS
from cam_rig.dynamics.torsional.model import from_rig as shaft_of
from cam_rig.dynamics.torsional.motion import steady_state
from cam_rig.laws import Law
from cam_rig.schema import RigConfig, SceneConfig
from cam_rig.schema.explain import validate_data
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.by_speed import SpeedRow, SpeedRows
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import TransientFilter, simulate, simulate_ticks, step_levels
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Sample rate (Hz) of simulated turns whose samples are not used. It is the smallest possible rate.
UNMEASURED_RATE_HZ = 1
#: Largest number of samples of a tick (time between two cam states). Their data fit approximately
#: in the cache of a processor core.
MAX_TICK_SAMPLES = 1 << 15
#: Index of the contact force among the outputs of the model `elastic_stem`.
FORCE_ROW = 3


@dataclass(frozen=True)
class SteadyStart:
    """State of a follower at cam angle 0 from which its motion repeats each turn.

    Parameters
    ----------
    state : FollowerState or None
        State of the follower. None is the start of a run, at rest on the cam.
    is_steady : bool
        False if the turns do not repeat.
    forces : (float, float) or None
        Smallest and largest contact force of a turn, N, if they are known exactly.
    """

    state: FollowerState | None = None
    is_steady: bool = True
    forces: tuple[float, float] | None = None


def scene_at(scene: SceneConfig, speed: float) -> SceneConfig:
    """Return a copy of a scene whose schedule has a single cam speed (rad/s)."""
    speeds = Quantity(assumed=[speed / RPM], unit="rpm")
    schedule = scene.schedule.model_copy(update={"speeds": speeds})
    data = scene.model_copy(update={"schedule": schedule}).model_dump(exclude_none=True)
    return validate_data(SceneConfig, data)


def steady_row(law: Law, rig: RigConfig, scene: SceneConfig, speed: float) -> tuple[SpeedRow, bool]:
    """Evaluate the steady turns of a scene's only cam at a speed (rad/s).

    Returns
    -------
    row : SpeedRow
        Results of the evaluated turns, such as the forces and the sound level.
    is_steady : bool
        True if the turns repeat.
    """
    start = _steady_start(law, rig, scene, speed)
    return _row(law, rig, scene, start), start.is_steady


def _row(law: Law, rig: RigConfig, scene: SceneConfig, start: SteadyStart) -> SpeedRow:
    """Return the results of the scene's turns that start in a given state.

    The results are those of the whole schedule after its transient turns. Exact forces of ``start``
    replace those of the samples.
    """
    laws = {scene.cams[0]: law}
    loaded = LoadedScene(scene, rig, {}, laws)
    settle = scene.schedule.transient_turns.si
    rows = SpeedRows(laws, int(scene.sample_rate.si), settle)
    if rig.radiation is None:  # no sound level
        for tick in simulate_ticks(loaded, start.state, _long_ticks(scene)):
            rows.take(tick)
        row = rows.rows({})[0]
    else:
        ticks = simulate(loaded, rows.take, start.state, _long_ticks(scene))
        row = rows.rows(step_levels(ticks, settle))[0]
    if start.forces is not None:
        row = replace(row, min_force=start.forces[0], peak_force=start.forces[1])
    return row


def steady_turn(
    law: Law, rig: RigConfig, scene: SceneConfig, speed: float, samples: int
) -> tuple[Block, SpeedRow, bool]:
    """Return the samples of one steady turn, and the results of `steady_row`.

    Returns
    -------
    turn : Block
        A turn of ``samples`` samples, to within one.
    row : SpeedRow
        Results of the evaluated turns.
    is_steady : bool
        True if the turns repeat.
    """
    start, interval = _steady_start(law, rig, scene, speed), _one_turn(speed)
    model, rate = MODELS[scene.model], max(1, round(samples / interval.duration))
    _, block = model.advance(law, model.parameters(rig), start.state, interval, rate)
    return block, _row(law, rig, scene, start), start.is_steady


def _one_turn(speed: float) -> Interval:
    """Return the interval of one turn at a speed (rad/s), in whole nanoseconds.

    Its speed is changed slightly, so that it is exactly one turn.
    """
    turn = round(TURN / speed * NS)
    return Interval(0, turn, 0.0, TURN / turn * NS)


def _long_ticks(scene: SceneConfig) -> Iterator[CamState]:
    """Yield the cam states of a scene's schedule that divide it into few, long ticks.

    A tick is one time step of a run, from one cam state to the next. A new tick starts when the
    speed changes, when the transient turns of a speed are over, and after `MAX_TICK_SAMPLES`
    samples.
    """
    transient = TransientFilter(scene.schedule.transient_turns.si)
    max_duration = MAX_TICK_SAMPLES / scene.sample_rate.si
    last, is_over = None, False
    for state in cam_states(scene):
        before, is_over = is_over, transient.is_over(state, steady=True)
        same = last is not None and (last.speed, before) == (state.speed, is_over)
        if last is None or not same or state.time_ns - last.time_ns > max_duration * NS:
            yield state
            last = state


def _steady_start(law: Law, rig: RigConfig, scene: SceneConfig, speed: float) -> SteadyStart:
    """Return the state at cam angle 0 from which a scene's model repeats its turns.

    ``speed`` is the cam speed, rad/s. The state is computed exactly if the follower keeps contact,
    otherwise by simulation from rest.
    """
    model, parameters = scene.model, MODELS[scene.model].parameters(rig)
    if model == "torsional":
        shaft = shaft_of(rig)
        if shaft.flywheel_inertia is not None:  # the model itself starts in its steady state
            return SteadyStart()
        _, turn_start = steady_state(law, shaft, speed)
        twist = np.array([turn_start.twist, turn_start.twist_rate])
        return SteadyStart(vibrating_state(twist))
    if isinstance(parameters, TwoMassParameters):
        response, output = contact_response(law, parameters, speed), force_output(parameters)
        return _steady_in_contact(response, output, 0) or _settle_from_rest(law, rig, scene, speed)
    if model == "elastic_stem":
        response = elastic_stem.response(law, parameters, speed)
        outputs = elastic_stem.outputs(parameters)
        start = _steady_in_contact(response, outputs, FORCE_ROW, never_leaves=True)
        return start or SteadyStart(vibrating_state(response.periodic()))
    forces = force_extremes(law, parameters, speed)
    if model == "kinetostatic" or (forces[0] > 0.0 and not law.velocity_jumps):
        return SteadyStart(forces=forces)
    return _settle_from_rest(law, rig, scene, speed)


def vibrating_state(inner: FloatArray) -> FollowerState:
    """Return the state of a follower on the cam at angle 0 with a given vibration.

    ``inner`` contains the state variables of the follower model, for example (η, η̇) of the model
    `two_mass`.
    """
    return FollowerState(0.0, 0.0, 0.0, in_contact=True, inner=tuple(inner.tolist()))


def _steady_in_contact(
    response: LinearResponse, outputs: Outputs, row: int, never_leaves: bool = False
) -> SteadyStart | None:
    """Return the periodic state of a linear model in contact, and its extreme forces.

    ``row`` is the index of the contact force among ``outputs``. The result is None if the extremes
    of the force cannot be computed exactly, or if contact is lost. With ``never_leaves`` True a
    negative force is accepted.
    """
    negated = Outputs(-outputs.state, -outputs.law, -outputs.constant)
    run, negated_run = (ModalRun.of(response, output, None, row) for output in (outputs, negated))
    if response.law.velocity_jumps or not run.is_resolved(response.speed):
        return None
    min_force = run.min_output(response.speed)
    if min_force <= 0.0 and not never_leaves:
        return None
    max_force = -negated_run.min_output(response.speed)
    return SteadyStart(vibrating_state(response.periodic()), forces=(min_force, max_force))


def _settle_from_rest(law: Law, rig: RigConfig, scene: SceneConfig, speed: float) -> SteadyStart:
    """Simulate turns of a follower from rest until its state no longer changes.

    Returns the state at cam angle 0. After `MAX_FORCE_TURNS` turns the last state is returned as
    not steady.
    """
    model = MODELS[scene.model]
    parameters, scale = model.parameters(rig), _scale(law, rig, speed)
    turn = _one_turn(speed)
    # Start at 1 ns, so that these turns contain no sample.
    interval = replace(turn, start_ns=1, stop_ns=turn.stop_ns + 1)
    state: FollowerState | None = None
    before, change = None, math.inf
    for _ in range(MAX_FORCE_TURNS):
        end, _block = model.advance(law, parameters, state, interval, UNMEASURED_RATE_HZ)
        state = replace(end, cam_angle=None, cam_speed=None, pending_impulse=0.0)
        current = _scaled_state(state, scale)
        last, change = change, _difference(current, before)
        if change == 0.0 or (change < last < math.inf and change**2 / (last - change) < FORCE_RTOL):
            return SteadyStart(state)  # the further changes are bounded as a geometric series
        before = current
    return SteadyStart(state, is_steady=False)


def _scale(law: Law, rig: RigConfig, speed: float) -> tuple[float, float]:
    """Return a displacement (m) and a velocity (m/s) as scales for comparing states.

    Differences of states are divided by them. The displacement is the compression of the stem, or
    of the spring if there is no stem, by the largest contact force. The velocity is that of a
    vibration with this amplitude.
    """
    p = FollowerParameters.from_rig(rig)
    force = float(force_weights(p, speed) @ np.array(law.bounds)) + p.preload
    stiffness = p.stem_stiffness or p.spring_stiffness  # a rigid mass on the cam has no stem
    displacement = force / stiffness
    return displacement, displacement * math.sqrt(stiffness / p.mass)


def _scaled_state(state: FollowerState, scale: tuple[float, float]) -> FloatArray:
    """Return a follower state as an array of dimensionless numbers, for comparison.

    Displacements and velocities alternate and are divided by ``scale``, from `_scale`. In contact
    they are those of the vibration only. The last number is 1 in contact and 0 in flight.
    """
    flight = () if state.in_contact else (state.displacement, state.velocity)
    numbers = np.array([*flight, *state.inner])
    return np.append(numbers / np.resize(scale, numbers.size), float(state.in_contact))


def _difference(current: FloatArray, before: FloatArray | None) -> float:
    """Return the largest difference of two states from `_scaled_state`.

    It is infinite if one state is in contact and the other in flight, or if `before` is None.
    """
    if before is None or before.size != current.size or current[-1] != before[-1]:
        return math.inf
    return float(np.abs(current - before).max())
