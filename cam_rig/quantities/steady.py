"""What a scene's model does at one speed for ever: its forces, level and lift-offs once settled.

While contact is kept the periodic state is one linear solve, and the least and the largest force
are found between the samples too. Where the follower lifts off it is turned from rest until a turn
changes nothing any more; where none does, the turns after `MAX_FORCE_TURNS` are measured, and it is
said.
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
from cam_rig.schema.explain import validated
from cam_rig.schema.quantity import Quantity
from cam_rig.simulation.by_speed import SpeedRow, SpeedRows
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.simulation.simulate import Settling, simulate, step_levels, turned_ticks
from cam_rig.units import NS, RPM, TURN, FloatArray

#: Samples (Hz) where none is asked for; and of a tick at most, little more than a core's memory.
FEWEST, MOST_SAMPLES = 1, 1 << 15
#: The contact force's row in the outputs of a mass on its stem.
FORCE = 3


@dataclass(frozen=True)
class SteadyStart:
    """A follower at θ = 0, None for one put down on the cam; whether its turns repeat from there.

    ``forces`` (N) are the least and the largest of a turn, where they are known exactly.
    """

    state: FollowerState | None = None
    settled: bool = True
    forces: tuple[float, float] | None = None


def scene_at(scene: SceneConfig, speed: float) -> SceneConfig:
    """A scene whose program holds one speed (rad/s)."""
    speeds = Quantity(assumed=[speed / RPM], unit="rpm")
    program = scene.program.model_copy(update={"speeds": speeds})
    data = scene.model_copy(update={"program": program}).model_dump(exclude_none=True)
    return validated(SceneConfig, data)


def steady_row(law: Law, rig: RigConfig, scene: SceneConfig, speed: float) -> tuple[SpeedRow, bool]:
    """The settled turns of a scene's one cam at its one speed (rad/s), and whether they repeat."""
    start = _start(law, rig, scene, speed)
    return _row(law, rig, scene, start), start.settled


def _row(law: Law, rig: RigConfig, scene: SceneConfig, start: SteadyStart) -> SpeedRow:
    laws = {scene.cams[0]: law}
    loaded = LoadedScene(scene, rig, {}, laws)
    settle = scene.program.settle_turns.si
    rows = SpeedRows(laws, int(scene.sample_rate.si), settle)
    if rig.radiation is None:  # no sound, so no level
        for tick in turned_ticks(loaded, start.state, _long_ticks(scene)):
            rows.take(tick)
        row = rows.rows({})[0]
    else:
        ticks = simulate(loaded, rows.take, start.state, _long_ticks(scene))
        row = rows.rows(step_levels(ticks, settle))[0]
    if start.forces is not None:
        row = replace(row, force_least=start.forces[0], force_peak=start.forces[1])
    return row


def settled_turn(
    law: Law, rig: RigConfig, scene: SceneConfig, speed: float, samples: int
) -> tuple[Block, SpeedRow, bool]:
    """As `steady_row`, with one turn of so many samples, within one, before."""
    start, interval = _start(law, rig, scene, speed), _one_turn(speed)
    model, rate = MODELS[scene.model], max(1, round(samples / interval.duration))
    _, block = model.advance(law, model.parameters(rig), start.state, interval, rate)
    return block, _row(law, rig, scene, start), start.settled


def _one_turn(speed: float) -> Interval:
    """A turn at a speed (rad/s), of whole nanoseconds."""
    turn = round(TURN / speed * NS)
    return Interval(0, turn, 0.0, TURN / turn * NS)


def _long_ticks(scene: SceneConfig) -> Iterator[CamState]:
    """The cam's states, few at each speed: where it begins, is settled, and within long times."""
    settling, longest = Settling(scene.program.settle_turns.si), MOST_SAMPLES / scene.sample_rate.si
    last, settled = None, False
    for state in cam_states(scene):
        before, settled = settled, settling.is_over(state, steady=True)
        same = last is not None and (last.speed, before) == (state.speed, settled)
        if last is None or not same or state.time_ns - last.time_ns > longest * NS:
            yield state
            last = state


def _start(law: Law, rig: RigConfig, scene: SceneConfig, speed: float) -> SteadyStart:
    model, parameters = scene.model, MODELS[scene.model].parameters(rig)
    if model == "torsional":
        return _twisted(law, rig, speed)
    if isinstance(parameters, TwoMassParameters):
        response, output = contact_response(law, parameters, speed), force_output(parameters)
        return _in_contact(response, output, 0) or _turned(law, rig, scene, speed)
    if model == "elastic_stem":
        response = elastic_stem.response(law, parameters, speed)
        found = _in_contact(response, elastic_stem.outputs(parameters), FORCE, holds=True)
        return found or SteadyStart(vibrating(response.periodic()))
    forces = force_extremes(law, parameters, speed)
    if model == "kinetostatic" or (forces[0] > 0.0 and not law.velocity_jumps):
        return SteadyStart(forces=forces)
    return _turned(law, rig, scene, speed)


def vibrating(inner: FloatArray) -> FollowerState:
    """A follower on the cam at θ = 0 with a model's own numbers there, as its vibration."""
    return FollowerState(0.0, 0.0, 0.0, in_contact=True, inner=tuple(inner.tolist()))


def _in_contact(
    response: LinearResponse, outputs: Outputs, row: int, holds: bool = False
) -> SteadyStart | None:
    """The periodic state; None where contact is lost, or the force cannot be told exactly."""
    pull = Outputs(-outputs.state, -outputs.law, -outputs.constant)
    run, opposite = (ModalRun.of(response, one, None, row) for one in (outputs, pull))
    if response.law.velocity_jumps or not run.is_resolved(response.speed):
        return None
    least = run.min_output(response.speed)
    if least <= 0.0 and not holds:
        return None
    largest = -opposite.min_output(response.speed)
    return SteadyStart(vibrating(response.periodic()), forces=(least, largest))


def _twisted(law: Law, rig: RigConfig, speed: float) -> SteadyStart:
    """A shaft in its steady state; one whose flywheel has an inertia begins there by itself."""
    shaft = shaft_of(rig)
    if shaft.flywheel_inertia is not None:
        return SteadyStart()
    _, start = steady_state(law, shaft, speed)
    return SteadyStart(vibrating(np.array([start.twist, start.twist_rate])))


def _turned(law: Law, rig: RigConfig, scene: SceneConfig, speed: float) -> SteadyStart:
    """A follower turned from rest until no turn to come changes it, or `MAX_FORCE_TURNS`."""
    model = MODELS[scene.model]
    parameters, scale = model.parameters(rig), _scale(law, rig, speed)
    turn = _one_turn(speed)
    # from 1 ns on: what is turned to settle is sampled nowhere
    interval = replace(turn, start_ns=1, stop_ns=turn.stop_ns + 1)
    state: FollowerState | None = None
    before, change = None, math.inf
    for _ in range(MAX_FORCE_TURNS):
        end, _block = model.advance(law, parameters, state, interval, FEWEST)
        state = replace(end, cam_angle=None, cam_speed=None, pending_impulse=0.0)
        here = _numbers(state, scale)
        last, change = change, _away(here, before)
        if change == 0.0 or (change < last < math.inf and change**2 / (last - change) < FORCE_RTOL):
            return SteadyStart(state)  # what is left of a geometric series
        before = here
    return SteadyStart(state, settled=False)


def _scale(law: Law, rig: RigConfig, speed: float) -> tuple[float, float]:
    """A place (m) and a velocity (m/s) that stand for the whole contact force in the stem."""
    p = FollowerParameters.from_rig(rig)
    force = float(force_weights(p, speed) @ np.array(law.bounds)) + p.preload
    stiffness = p.stem_stiffness or p.spring_stiffness  # a rigid mass on the cam has no stem
    place = force / stiffness
    return place, place * math.sqrt(stiffness / p.mass)


def _numbers(state: FollowerState, scale: tuple[float, float]) -> FloatArray:
    """A state as parts of the force: on the cam its vibration alone; places and rates in turn."""
    own = () if state.in_contact else (state.displacement, state.velocity)
    numbers = np.array([*own, *state.inner])
    return np.append(numbers / np.resize(scale, numbers.size), float(state.in_contact))


def _away(here: FloatArray, before: FloatArray | None) -> float:
    """By how much two states differ; infinite where one is on the cam and the other flies."""
    if before is None or before.size != here.size or here[-1] != before[-1]:
        return math.inf
    return float(np.abs(here - before).max())
