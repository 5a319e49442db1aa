"""Which cam states are possible: the cam turns steadily, so time rises and θ is continuous."""

from __future__ import annotations

import math
from collections import deque
from enum import Enum

from cam_rig.dynamics import ANGLE_TOLERANCE
from cam_rig.errors import RefusedError
from cam_rig.laws.law import MAX_ANGLE
from cam_rig.live.flow_control import REMEMBERED_STATES
from cam_rig.schema import SceneConfig
from cam_rig.schema.scene import MAX_SPEED, MIN_SAMPLES
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS, TURN

#: Samples in one tick at most: a message of 48 MB.
MAX_SAMPLES = 1_000_000


def speeds(scene: SceneConfig) -> tuple[float, float]:
    """Least and greatest speed (rad/s) whose ticks have two samples, and no more than a message."""
    turned = TURN / scene.program.ticks_per_turn * scene.sample_rate.si
    return 2.0 * turned / MAX_SAMPLES, min(MAX_SPEED, turned / MIN_SAMPLES)


class Admission(Enum):
    """How a state relates to those received before."""

    NEXT = "follows the state before"
    NEW_SEQUENCE = "begins a new sequence: the first, or the first after the cam stood"
    SEEN = "was received already"


class StateValidator:
    """Admits the states of one drive, in order, each once.

    A drive that was started again repeats its last states; these are known and passed over. After
    the cam has stood, it may start anywhere, at any rig time. Any other state that is not where
    the state before leads comes from another publisher, and is refused. At ``sample_rate`` (Hz) the
    cam turns ``tick_angle`` (rad) in a tick at most; more, and a state was lost. States up to
    ``last``, or to rig time ``since`` (ns), were received; after ``since`` there may be a gap.
    """

    def __init__(
        self,
        sample_rate: float,
        last: CamState | None = None,
        tick_angle: float = math.inf,
        since: int = -1,
    ) -> None:
        self._longest, self._rate = MAX_SAMPLES / sample_rate, int(sample_rate)
        self._tick_angle = tick_angle
        self._floor = since if last is None else last.time_ns
        self._recent: deque[CamState] = deque(maxlen=REMEMBERED_STATES)
        self.last = last

    @classmethod
    def of(
        cls, scene: SceneConfig, last: CamState | None = None, since: int = -1
    ) -> StateValidator:
        """The validator of the states of a scene."""
        angle = TURN / scene.program.ticks_per_turn
        return cls(scene.sample_rate.si, last, angle, since)

    def admit(self, state: CamState) -> Admission:
        """How a state relates to those before it."""
        require_possible(state)
        if state == self.last or state in self._recent or state.time_ns <= self._floor:
            return Admission.SEEN
        stands = self.last is not None and self.last.speed == 0.0
        starts = self.last is None or (stands and not self.last.turns_until(state))
        if self.last is not None and not starts:
            self._require_next(self.last, state)
        self.last = state
        self._recent.append(state)
        if state.speed == 0.0:
            self._floor = -1
        return Admission.NEW_SEQUENCE if starts else Admission.NEXT

    def _require_next(self, last: CamState, state: CamState) -> None:
        duration = (state.time_ns - last.time_ns) / NS
        if not 0.0 < duration <= self._longest:
            raise RefusedError(
                f"cam state at {state.time_ns} ns after the one at {last.time_ns} ns; allowed: "
                f"stamps that rise, by at most {self._longest:g} s (is a second drive at work?)"
            )
        first, end = (-(-time * self._rate // NS) for time in (last.time_ns, state.time_ns))
        if end <= first:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: no sample at {self._rate} Hz since the one at "
                f"{last.time_ns} ns; allowed: one in every tick"
            )
        turned = state.since(last)
        if turned > 1.5 * self._tick_angle:  # a state that was lost makes it twice
            raise RefusedError(
                f"cam state at {state.time_ns} ns: the cam turned {turned:.6g} rad since the one "
                f"before; allowed: {self._tick_angle:.6g} rad (was one lost, or is a second drive "
                "at work?)"
            )
        held, ramped = last.speed * duration, 0.5 * (last.speed + state.speed) * duration
        away = min(abs(turned - held), abs(turned - ramped))
        if away > ANGLE_TOLERANCE:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: θ is {away:.3g} rad from where the state before "
                f"leads; allowed: {ANGLE_TOLERANCE:g} rad (is a second drive at work?)"
            )


def require_possible(state: CamState) -> None:
    """Refuse numbers that no cam can have, whatever the state before."""
    known = math.isfinite(state.angle) and abs(state.unwrapped) <= MAX_ANGLE
    if not (known and math.isfinite(state.speed) and state.time_ns >= 0):
        raise RefusedError(
            f"cam state: {state.time_ns} ns, θ {state.unwrapped} rad, ω {state.speed} rad/s; "
            f"allowed: finite numbers, θ up to {MAX_ANGLE:g} rad, time from zero"
        )
    if not 0.0 <= state.speed <= MAX_SPEED:
        raise RefusedError(
            f"cam state: ω {state.speed:g} rad/s; allowed: 0 to {MAX_SPEED:.6g} rad/s"
        )
