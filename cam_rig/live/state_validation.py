"""Validation of received cam states: rig time must rise and θ must be continuous."""

from __future__ import annotations

import math

from cam_rig.dynamics import ANGLE_TOLERANCE
from cam_rig.errors import RefusedError
from cam_rig.laws.law import MAX_ANGLE
from cam_rig.schema import SceneConfig
from cam_rig.schema.scene import MAX_SPEED, MIN_SAMPLES
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN

#: Largest number of samples in one tick, the time between two cam states. It bounds the size of a
#: message of samples to 48 MB.
MAX_SAMPLES = 1_000_000


def speed_limits(scene: SceneConfig) -> tuple[float, float]:
    """Return the lowest and the highest speed (rad/s) of commands in a scene.

    At the highest speed a tick has `MIN_SAMPLES` samples. At the lowest speed it has half of
    `MAX_SAMPLES`. A tick is the time between two cam states.
    """
    speed_of_one_sample = TURN / scene.schedule.ticks_per_turn * scene.sample_rate.si
    highest = min(MAX_SPEED, speed_of_one_sample / MIN_SAMPLES)
    return 2.0 * speed_of_one_sample / MAX_SAMPLES, highest


class StateValidator:
    """Checks that each state follows from the one before it.

    After the cam has stopped, the next state may have any angle and any rig time. Any other state
    that does not follow from the previous one was sent by another publisher, or a state was lost;
    it is rejected, and the validator keeps its previous state. At `sample_rate` (Hz) the cam turns
    at most `tick_angle` (rad) per tick. A tick is the time between two cam states.
    """

    def __init__(self, sample_rate: float, tick_angle: float = math.inf) -> None:
        self._longest, self._rate = MAX_SAMPLES / sample_rate, int(sample_rate)
        self._tick_angle = tick_angle
        self._last: CamState | None = None

    @classmethod
    def of(cls, scene: SceneConfig) -> StateValidator:
        """Return the validator for the cam states of a scene."""
        return cls(scene.sample_rate.si, TURN / scene.schedule.ticks_per_turn)

    def validate(self, state: CamState) -> None:
        """Accept a received cam state, or raise RefusedError.

        It is refused if it cannot follow the previous accepted state.
        """
        require_possible(state)
        last = self._last
        is_stopped = last is not None and last.speed == 0.0 and not last.turns_until(state)
        if last is not None and not is_stopped:
            self._require_next(last, state)
        self._last = state

    def _require_next(self, last: CamState, state: CamState) -> None:
        duration = (state.time_ns - last.time_ns) / NS
        if not 0.0 < duration <= self._longest:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: must be after the state at {last.time_ns} ns, "
                f"by at most {self._longest:g} s; check for a second drive"
            )
        first, end = (-(-time * self._rate // NS) for time in (last.time_ns, state.time_ns))
        if end <= first:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: a tick must have at least one sample at "
                f"{self._rate} Hz, got none since the state at {last.time_ns} ns"
            )
        turned = state.since(last)
        if turned > 1.5 * self._tick_angle:  # twice the angle of a tick if a state was lost
            raise RefusedError(
                f"cam state at {state.time_ns} ns: the cam must turn {self._tick_angle:.6g} rad "
                f"per tick, got {turned:.6g} rad; a state was lost, or a second drive is running"
            )
        # the speed is constant in a tick, or changes linearly
        constant, ramped = last.speed * duration, 0.5 * (last.speed + state.speed) * duration
        difference = min(abs(turned - constant), abs(turned - ramped))
        if difference > ANGLE_TOLERANCE:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: θ must follow from the previous state to "
                f"{ANGLE_TOLERANCE:g} rad, got a difference of {difference:.3g} rad; check for a "
                "second drive"
            )


def require_possible(state: CamState) -> None:
    """Raise RefusedError if time, angle or speed are outside the limits of a rig."""
    is_angle = math.isfinite(state.angle) and abs(state.unwrapped) <= MAX_ANGLE
    if not (is_angle and math.isfinite(state.speed) and state.time_ns >= 0):
        raise RefusedError(
            f"cam state: the numbers must be finite, θ at most {MAX_ANGLE:g} rad and the time 0 or "
            f"later, got {state.time_ns} ns, θ {state.unwrapped} rad, ω {state.speed} rad/s"
        )
    if not 0.0 <= state.speed <= MAX_SPEED:
        raise RefusedError(
            f"cam state: ω must be between 0 and {MAX_SPEED:.6g} rad/s, got {state.speed:g}"
        )
