"""What the drive does next: which state to send, which cam to request, when it is done."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

from cam_rig.dynamics import wrap
from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import FlowControl, Pacing
from cam_rig.live.state_validation import speeds
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, cam_states, tick_count
from cam_rig.units import NS, RPM

# Which cam state comes next: the scene's, unless an operator commands another speed or cam.

#: Rig time (ns) that a halted cam stands before it turns again.
STANDSTILL_NS = NS


@dataclass(frozen=True)
class ScheduleState:
    """How far a schedule has come, and how far commands have moved it from the scene's plan.

    Rig time is shifted in ns, the angle by whole turns and a
    remainder (rad). ``speed`` is the commanded one (rad/s), ``cam`` the scene's cam and the one
    that overrides it, ``last`` the state that was sent last.
    """

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

    def __init__(self, scene: SceneConfig) -> None:
        self._scene = scene
        #: A tick (ns) holds a sample at least: a short one of a ramp, sped up, would hold none.
        self._min_tick = math.ceil(NS / scene.sample_rate.si)
        self.state = ScheduleState()
        self._begin()

    def _begin(self) -> None:
        self._plan = iter(cam_states(self._scene))
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
        self.state = replace(self.state, last=sent)
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
        """Turn another cam, empty for the scene's own, until the scene mounts its next one."""
        planned = None if self._at is None else self._at.cam
        cams = None if planned is None or cam in (planned, "") else (planned, cam)
        self.state = replace(self.state, cam=cams)

    def halt(self) -> CamState | None:
        """Emergency stop: the cam that turned, at speed 0; None when it stands."""
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
        self._begin()
        self.state = ScheduleState(end.time_ns - begin.time_ns, last=state.last)
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


# When it goes out.

#: Wall time (s) after which an unanswered request for a cam is repeated.
REQUEST_RETRY_S = 1.0


class DriveProgram:
    """The scene's states in order, each held back until every consumer is ready for it.

    A state goes out when few ticks are in flight, the law of its cam is known, and its time has
    come. A new cam is requested when every tick of the one before is acknowledged. So nothing is
    dropped, and every run of a scene publishes the same messages. ``mount`` requests a cam from the
    law server and returns False if that is not possible yet.
    """

    def __init__(
        self,
        scene: SceneConfig,
        consumers: list[str],
        mount: Callable[[str], bool],
    ) -> None:
        self.laws: dict[str, Law] = {}  # that the law server has published
        self.flow = FlowControl(consumers)
        self.pacing = Pacing()
        self.ticks = tick_count(scene)
        self.sent, self._speeds = 0, speeds(scene)
        self.running = True
        self.schedule = SetpointSchedule(scene)
        self._mount = mount
        self._asked, self._asked_at = "", -REQUEST_RETRY_S
        self._requests: Counter[str] = Counter()

    @property
    def done(self) -> bool:
        """Whether every state is sent and every tick acknowledged; a halted drive is not done."""
        at_end = self.schedule.next_state is None and not self.halted
        return at_end and self.flow.in_flight == 0

    @property
    def halted(self) -> bool:
        """Whether an emergency stop holds, until a reset."""
        return self.schedule.state.halted

    def take(self, now: float) -> CamState | None:
        """The next state, when it may go out at wall time ``now`` (s)."""
        state = self.schedule.next_state
        if state is None or not self.running or not self.flow.may_send():
            return None
        if not self._ready(state, now) or self.pacing.wait(state.time_ns, now) > 0.0:
            return None
        self.schedule.advance()
        self.pacing.sent(state.time_ns, now)
        return self._out(state)

    def expects(self, cam: str) -> bool:
        """Whether a cam was requested and the law server has not yet reported it mounted."""
        return self._requests[cam] > 0

    def mounted(self, cam: str) -> None:
        """Note a cam that the law server reports mounted: as requested, or an operator's override.

        The report may come when the drive has sent that cam's last state and is at the next cam's,
        or later still: each request has one reply.
        """
        if self.expects(cam):
            self._requests[cam] -= 1
        else:
            self.schedule.mount(cam)

    def refused(self, cam: str) -> None:
        """Note that the law server has no such cam: a report that it is mounted was wrong."""
        self._requests[cam] = 0
        if self.schedule.next_state is not None and self.schedule.next_state.cam == cam:
            self.schedule.mount("")

    def wait(self, now: float) -> float:
        """Wall time (s) until the next state is due; zero when it waits for a node instead."""
        state = self.schedule.next_state
        return 0.0 if state is None else self.pacing.wait(state.time_ns, now)

    def time_ns(self, now: float) -> int | None:
        """Rig time (ns) of a paced run at wall time (s) where a tick turns, else None."""
        last, following = self.schedule.state.last, self.schedule.next_state
        reached = self.pacing.reached(now)
        if reached is None or last is None or following is None:
            return None
        return min(reached, following.time_ns - 1) if last.turns_until(following) else None

    def command(self, speed: float) -> None:
        """Turn at a speed (rad/s) from the next state on; zero as the scene says."""
        self.require_speed(speed)
        self.schedule.command(speed or None)

    def require_speed(self, speed: float) -> None:
        """Refuse a speed (rad/s) that no cam, or no tick, can have."""
        low, high = self._speeds
        if speed != 0.0 and not low <= speed <= high:
            raise RefusedError(
                f"speed: is {speed:g} rad/s ({speed / RPM:g} rpm); allowed: 0, or {low:.3g} to "
                f"{high:.6g} rad/s ({low / RPM:.3g} to {high / RPM:.6g} rpm) at this sample rate"
            )

    def run(self, running: bool) -> None:
        """Go on, or stop with the present tick; rig time stands with the cam."""
        if not running or not self.running:
            self.pacing.stand()
        self.running = running

    def halt(self) -> CamState | None:
        """Emergency stop: the state that makes the cam stand, to be sent at once."""
        self.run(False)
        state = self.schedule.halt()
        return None if state is None else self._out(state)

    def reset(self) -> None:
        """Back to the scene's beginning, stopped; rig time and θ continue."""
        self.run(False)
        if self.schedule.overrides_cam:
            self._asked = ""  # the law server still holds the operator's
        self.schedule.rewind()

    def _out(self, state: CamState) -> CamState:
        self.flow.sent(state.time_ns)
        self.sent += 1
        return state

    def _ready(self, state: CamState, now: float) -> bool:
        known, overridden = state.cam in self.laws, self.schedule.overrides_cam
        if known and (overridden or state.cam == self._asked):
            return True
        if overridden and state.cam != self._asked:  # its law is on its way, if there is one
            self._asked, self._asked_at = state.cam, now
        if state.cam != self._asked and self.flow.in_flight:
            return False
        if state.cam != self._asked or now - self._asked_at > REQUEST_RETRY_S:
            if not self._mount(state.cam):
                return False
            self._asked, self._asked_at = state.cam, now
            self._requests[state.cam] += 1
        return state.cam in self.laws
