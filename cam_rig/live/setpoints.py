"""Which cam state comes next: the scene's, unless an operator commands another speed or cam."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import islice

from cam_rig.dynamics import wrap
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, cam_states
from cam_rig.units import NS

#: Rig time (ns) that a halted cam stands before it turns again.
STANDSTILL_NS = NS


@dataclass(frozen=True)
class ScheduleState:
    """How far a schedule has come, and how far commands have moved it from the scene's plan.

    ``index`` counts the states done; rig time is shifted in ns, the angle by whole turns and a
    remainder (rad). ``speed`` is the commanded one (rad/s), ``cam`` the scene's cam and the one
    that overrides it, ``last`` the state that was sent last.
    """

    index: int = 0
    time_shift: int = 0
    angle_shift: float = 0.0
    turn_shift: int = 0
    speed: float | None = None
    cam: tuple[str, str] | None = None
    halted: bool = False
    last: CamState | None = None


class SetpointSchedule:
    """The states of a scene one after the other, under live commands.

    A commanded speed (rad/s) or cam holds from the next state on: each tick turns by the planned
    angle, at the commanded speed; a cam stays until the scene mounts another. θ is never set, only
    continued. Without a command the states are the scene's own, bit for bit.
    """

    def __init__(self, scene: SceneConfig, state: ScheduleState | None = None) -> None:
        self._scene = scene
        #: A tick (ns) holds a sample at least: a short one of a ramp, sped up, would hold none.
        self._min_tick = math.ceil(NS / scene.sample_rate.si)
        self.state = state or ScheduleState()
        self._begin(self.state.index)

    def _begin(self, index: int) -> None:
        self._plan = islice(cam_states(self._scene), index, None)
        self._at: CamState | None = next(self._plan, None)
        self._next: CamState | None = next(self._plan, None)

    @property
    def next_state(self) -> CamState | None:
        """The next state; None after the last, and after a halt."""
        if self._at is None or self.state.halted:
            return None
        planned = self._moved(self._at)
        speed = planned.speed if self._commanded is None else self._commanded
        return self._as(planned, speed)

    @property
    def overrides_cam(self) -> bool:
        """Whether the next state's cam is not the scene's."""
        cams = self.state.cam
        return self._at is not None and cams is not None and cams[0] == self._at.cam

    def advance(self) -> None:
        """Step to the state after the one that was sent."""
        at, sent, commanded = self._at, self.next_state, self._commanded
        assert at is not None and sent is not None
        planned = self._moved(at)
        self.state = replace(self.state, index=self.state.index + 1, last=sent)
        self._shift(sent.time_ns - planned.time_ns, sent.since(planned))
        self._at, self._next = self._next, next(self._plan, None)
        if self._at is not None and commanded is not None:
            turn = self._at.since(at)
            length = max(self._min_tick, round(turn / commanded * NS))
            self._shift(length - (self._at.time_ns - at.time_ns), commanded * length / NS - turn)

    def command(self, speed: float | None) -> None:
        """Turn at a speed (rad/s) from the next state on; None as the scene says."""
        self.state = replace(self.state, speed=speed)

    def mount(self, cam: str) -> None:
        """Turn another cam from the next state on, until the scene mounts its next one.

        An empty name is the scene's own.
        """
        planned = None if self._at is None else self._at.cam
        cams = None if planned is None or cam in (planned, "") else (planned, cam)
        self.state = replace(self.state, cam=cams)

    def halt(self) -> CamState | None:
        """Emergency stop: the state of speed 0 where the last tick ends; None when it stands.

        It is a state of the cam that turned, which need not be the next.
        """
        last = self.state.last
        if self._at is None or self.state.halted:
            return None
        self.state = replace(self.state, halted=True)
        if last is None or not last.turns_until(self._moved(self._at)):
            return None
        standing = replace(self._as(self._moved(self._at), 0.0), cam=last.cam)
        self.state = replace(self.state, last=standing)
        return standing

    def rewind(self) -> None:
        """Begin the scene again; rig time and θ continue from where they are, commands end."""
        state, at = self.state, self._at
        if at is None:
            return
        begin = next(cam_states(self._scene))
        if state.halted and state.last is not None:
            end = replace(state.last, time_ns=state.last.time_ns + STANDSTILL_NS)
        else:
            end = self._as(self._moved(at), begin.speed)
        self._begin(0)
        self.state = ScheduleState(0, end.time_ns - begin.time_ns, last=state.last)
        self._shift(0, end.angle - begin.angle, end.turns - begin.turns)

    @property
    def _commanded(self) -> float | None:
        """The commanded speed (rad/s) of the tick that begins with the next state."""
        begins = self._at is not None and self._next is not None
        turns = begins and self._at.turns_until(self._next)  # type: ignore[union-attr,arg-type]
        return self.state.speed if turns else None

    def _as(self, planned: CamState, speed: float) -> CamState:
        """The state at another speed than planned, where the tick before then leads.

        A ramp that is interrupted turns by its planned angle all the same: at its first speed, or
        from rest to the new one.
        """
        last = self.state.last
        if last is None or speed == planned.speed or not last.turns_until(planned):
            return replace(planned, speed=speed)
        mean = last.speed or 0.5 * speed
        if last.speed > 0.0 and last.holds_until(planned):
            return replace(planned, speed=speed)
        if mean == 0.0:  # at rest, and commanded to stay so
            return replace(planned, speed=speed, angle=last.angle, turns=last.turns)
        length = max(self._min_tick, round(planned.since(last) / mean * NS))
        time_ns, angle = last.time_ns + length, last.angle + mean * length / NS
        return CamState(time_ns, angle, speed, planned.cam, last.turns)

    def _shift(self, time_ns: int, angle: float, turns: int = 0) -> None:
        state = self.state
        turns, angle = wrap(state.angle_shift + angle, state.turn_shift + turns)
        time_ns += state.time_shift
        self.state = replace(state, time_shift=time_ns, angle_shift=angle, turn_shift=turns)

    def _moved(self, planned: CamState) -> CamState:
        state, cam = self.state, planned.cam
        if state.cam is not None and state.cam[0] == planned.cam:
            cam = state.cam[1]
        time_ns, angle = planned.time_ns + state.time_shift, planned.angle + state.angle_shift
        return CamState(time_ns, angle, planned.speed, cam, planned.turns + state.turn_shift)
