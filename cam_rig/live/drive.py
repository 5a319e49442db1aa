"""Program of the drive: sequence of cam states, requests for cams, end of the run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

from cam_rig.dynamics import wrap
from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import FlowControl, Pacing
from cam_rig.live.state_validation import speed_limits
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, cam_states, tick_count
from cam_rig.units import NS, RPM

# Sequence of the cam states: that of the scene, unless an operator commands another speed or cam.

#: Rig time (ns) between an emergency stop and the restart of the scene after a reset.
STANDSTILL_NS = NS


@dataclass(frozen=True)
class ScheduleState:
    """Active commands of an operator, and the resulting shift from the scene's plan.

    Parameters
    ----------
    time_shift
        Difference of rig time from the plan, ns.
    angle_shift, turn_shift
        Difference of the cam angle from the plan: a remainder in rad, and whole turns.
    speed
        Commanded speed in rad/s, None for the scene's speeds.
    cam
        Name of the scene's cam and name of the cam that an operator mounted instead, None if no
        cam is replaced.
    halted
        True from an emergency stop to the next reset.
    last
        State that was sent last, None before the first.
    """

    time_shift: int = 0
    angle_shift: float = 0.0
    turn_shift: int = 0
    speed: float | None = None
    cam: tuple[str, str] | None = None
    halted: bool = False
    last: CamState | None = None


class SetpointSchedule:
    """Sequence of the cam states of a scene under live commands.

    A commanded speed (rad/s) or cam applies from the next state on. At a commanded speed the cam
    still turns by the planned angle in each tick, the time between two states. A commanded cam
    stays mounted until the scene mounts another. The angle θ is always continued, it is never set.
    Without a command the states are equal to those of the scene, bit for bit.
    """

    def __init__(self, scene: SceneConfig) -> None:
        self._scene = scene
        #: Shortest permitted tick (time between two cam states), ns: the sampling period. Without
        #: this limit a tick of a speed ramp could contain no sample if a higher speed is commanded.
        self._min_tick = math.ceil(NS / scene.sample_rate.si)
        self.state = ScheduleState()
        self._start_plan()

    def _start_plan(self) -> None:
        self._plan = iter(cam_states(self._scene))
        self._planned: CamState | None = next(self._plan, None)
        self._following: CamState | None = next(self._plan, None)

    @property
    def next_state(self) -> CamState | None:
        """Next cam state to send, None after the last state and after an emergency stop."""
        if self._planned is None or self.state.halted:
            return None
        planned = self._shifted(self._planned)
        speed = planned.speed if self._commanded_speed is None else self._commanded_speed
        return self._with_speed(planned, speed)

    @property
    def overrides_cam(self) -> bool:
        """True if a command replaces the scene's cam in the next state."""
        cams, planned = self.state.cam, self._planned
        return planned is not None and cams is not None and cams[0] == planned.cam

    def advance(self) -> None:
        """Advance to the cam state after `next_state`, which has been sent."""
        previous, sent, speed = self._planned, self.next_state, self._commanded_speed
        assert previous is not None and sent is not None
        planned = self._shifted(previous)
        self.state = replace(self.state, last=sent)
        self._shift(sent.time_ns - planned.time_ns, sent.since(planned))
        self._planned, self._following = self._following, next(self._plan, None)
        if self._planned is not None and speed is not None:
            turn = self._planned.since(previous)
            length = max(self._min_tick, round(turn / speed * NS))
            planned_length = self._planned.time_ns - previous.time_ns
            self._shift(length - planned_length, speed * length / NS - turn)

    def command(self, speed: float | None) -> None:
        """Command a speed (rad/s) from the next state on, or None for the scene's speeds."""
        self.state = replace(self.state, speed=speed)

    def mount(self, cam: str) -> None:
        """Mount a cam until the scene mounts its next cam.

        An empty name ends the override.
        """
        planned = None if self._planned is None else self._planned.cam
        cams = None if planned is None or cam in (planned, "") else (planned, cam)
        self.state = replace(self.state, cam=cams)

    def halt(self) -> CamState | None:
        """Stop the cam at the end of the current tick, until `rewind`.

        A tick is the time between two cam states. Returns the state with speed 0, or None if the
        cam is stopped already.
        """
        last = self.state.last
        if self._planned is None or self.state.halted:
            return None
        self.state = replace(self.state, halted=True)
        planned = self._shifted(self._planned)
        if last is None or not last.turns_until(planned):
            return None
        stopped = replace(self._with_speed(planned, 0.0), cam=last.cam)
        self.state = replace(self.state, last=stopped)
        return stopped

    def rewind(self) -> None:
        """Restart the scene without commands.

        Rig time and θ continue from their present values.
        """
        state, planned = self.state, self._planned
        if planned is None:
            return
        first = next(cam_states(self._scene))
        if state.halted and state.last is not None:
            restart = replace(state.last, time_ns=state.last.time_ns + STANDSTILL_NS)
        else:
            restart = self._with_speed(self._shifted(planned), first.speed)
        self._start_plan()
        self.state = ScheduleState(restart.time_ns - first.time_ns, last=state.last)
        self._shift(0, restart.angle - first.angle, restart.turns - first.turns)

    @property
    def _commanded_speed(self) -> float | None:
        """Commanded speed (rad/s) of the tick that starts with the next cam state.

        A tick is the time between two cam states. The result is None without a command, or if the
        cam does not turn in this tick.
        """
        planned, following = self._planned, self._following
        turns = planned is not None and following is not None and planned.turns_until(following)
        return self.state.speed if turns else None

    def _with_speed(self, planned: CamState, speed: float) -> CamState:
        """Return the planned state with another speed.

        If this interrupts a ramp, the tick before the state changes, and with it the time of the
        state. The tick still turns by its planned angle: at the speed at its start, or, if it
        starts at rest, along a ramp to the new speed. A tick is the time between two cam states.
        """
        last = self.state.last
        if last is None or speed == planned.speed or not last.turns_until(planned):
            return replace(planned, speed=speed)
        mean = last.speed or 0.5 * speed
        if last.speed > 0.0 and last.is_steady_until(planned):
            return replace(planned, speed=speed)
        if mean == 0.0:  # at rest, and commanded to stay at rest
            return replace(planned, speed=speed, angle=last.angle, turns=last.turns)
        length = max(self._min_tick, round(planned.since(last) / mean * NS))
        time_ns, angle = last.time_ns + length, last.angle + mean * length / NS
        return CamState(time_ns, angle, speed, planned.cam, last.turns)

    def _shift(self, time_ns: int, angle: float, turns: int = 0) -> None:
        state = self.state
        turns, angle = wrap(state.angle_shift + angle, state.turn_shift + turns)
        time_ns += state.time_shift
        self.state = replace(state, time_shift=time_ns, angle_shift=angle, turn_shift=turns)

    def _shifted(self, planned: CamState) -> CamState:
        """Return a planned cam state with the shifts of time and angle by live commands.

        A cam that an operator has mounted replaces the planned cam.
        """
        state, cam = self.state, planned.cam
        if state.cam is not None and state.cam[0] == planned.cam:
            cam = state.cam[1]
        time_ns, angle = planned.time_ns + state.time_shift, planned.angle + state.angle_shift
        return CamState(time_ns, angle, planned.speed, cam, planned.turns + state.turn_shift)


# Conditions under which the drive may publish its next state.

#: Time (s, wall clock) after which an unanswered request for a cam is repeated.
REQUEST_RETRY_S = 1.0


class DriveProgram:
    """Program of the drive, which releases the scene's cam states in order.

    A tick is the time between two states, and it is in flight until all consumers have acknowledged
    it. A state is released when fewer than `MAX_TICKS_IN_FLIGHT` ticks are in flight, the law of
    its cam is known and its time has come. A new cam is requested when every tick of the previous
    cam is acknowledged. Therefore no message is dropped, and every run of a scene publishes the
    same messages.

    Parameters
    ----------
    scene : SceneConfig
    consumers : list of str
        Names of the nodes that acknowledge each tick.
    mount : callable
        Requests a cam from the law server, or returns False if that is not possible yet.
    """

    def __init__(
        self,
        scene: SceneConfig,
        consumers: list[str],
        mount: Callable[[str], bool],
    ) -> None:
        self.laws: dict[str, Law] = {}  # published by the law server
        self.flow = FlowControl(consumers)
        self.pacing = Pacing()
        self.ticks = tick_count(scene)
        self.sent, self._speed_limits = 0, speed_limits(scene)
        self.running = True
        self._stop_at: int | None = None  # number of sent states at which the cam stops
        self._sent_before_reset = 0
        self.schedule = SetpointSchedule(scene)
        self._mount = mount
        self._requested_cam, self._requested_at = "", -REQUEST_RETRY_S
        self._requests: Counter[str] = Counter()

    @property
    def done(self) -> bool:
        """True if every cam state is sent and acknowledged, without an emergency stop."""
        at_end = self.schedule.next_state is None and not self.halted
        return at_end and self.flow.in_flight == 0

    @property
    def halted(self) -> bool:
        """True from an emergency stop of the cam to the next reset."""
        return self.schedule.state.halted

    @property
    def at_start(self) -> bool:
        """True if no cam state was sent since the start or the last reset."""
        return self.sent == self._sent_before_reset

    def take(self, now: float) -> CamState | None:
        """Take the next state if it may be sent at wall-clock time `now` (s).

        Returns None if the state must wait, or if no state is left. A returned state counts as
        sent.
        """
        state = self.schedule.next_state
        if state is None or not self.running or not self.flow.may_send():
            return None
        if not self._is_ready(state, now) or self.pacing.wait(state.time_ns, now) > 0.0:
            return None
        self.schedule.advance()
        self.pacing.record_sent(state.time_ns, now)
        self._record_sent(state)
        if self.sent == self._stop_at:
            self.run(False)
        return state

    def expects(self, cam: str) -> bool:
        """Return True if a cam is requested and not yet reported as mounted."""
        return self._requests[cam] > 0

    def on_mounted(self, cam: str) -> None:
        """Handle the law server's report that a cam is mounted.

        Each request has one report. A report without a request is an operator's override. The
        report of a request may arrive after the drive has sent the last state of that cam.
        """
        if self.expects(cam):
            self._requests[cam] -= 1
        else:
            self.schedule.mount(cam)

    def on_refused(self, cam: str) -> None:
        """Handle the law server's refusal of a cam, and end an override with this cam."""
        self._requests[cam] = 0
        if self.schedule.next_state is not None and self.schedule.next_state.cam == cam:
            self.schedule.mount("")

    def wait(self, now: float) -> float:
        """Return the time (s, wall clock) from ``now`` until the next cam state is due.

        It is 0 if the state is due already and waits for a node.
        """
        state = self.schedule.next_state
        return 0.0 if state is None else self.pacing.wait(state.time_ns, now)

    def time_ns(self, now: float) -> int | None:
        """Return the rig time (ns) of a paced run at wall-clock time `now` (s).

        It is always before the next state. Returns None in a free run and while the cam is stopped.
        """
        last, following = self.schedule.state.last, self.schedule.next_state
        rig_ns = self.pacing.rig_time_ns(now)
        if rig_ns is None or last is None or following is None:
            return None
        return min(rig_ns, following.time_ns - 1) if last.turns_until(following) else None

    def command(self, speed: float) -> None:
        """Command a speed (rad/s) from the next state on, or 0 for the scene's speeds.

        Raise RefusedError if the speed is outside the limits.
        """
        self.require_speed(speed)
        self.schedule.command(speed or None)

    def require_speed(self, speed: float) -> None:
        """Raise RefusedError if a speed (rad/s) is outside the limits."""
        low, high = self._speed_limits
        if speed != 0.0 and not low <= speed <= high:
            raise RefusedError(
                f"speed must be 0, or between {low:.3g} and {high:.6g} rad/s ({low / RPM:.3g} and "
                f"{high / RPM:.6g} rpm) at this sample rate, got {speed:g} rad/s ({speed / RPM:g} "
                "rpm)"
            )

    def run(self, running: bool) -> None:
        """Start or resume the motion, or stop it after the current tick.

        A tick is the time between two cam states. Rig time stops with the cam. ``running`` is True
        to start.
        """
        if not running or not self.running:
            self.pacing.pause()
        self.running, self._stop_at = running, None

    def run_ticks(self, count: int) -> None:
        """Turn the cam for ``count`` ticks, then stop it.

        A tick is the time between two successive cam states that the drive publishes. The first
        state of a run starts the first tick and is not counted.
        """
        stop_at = max(self.sent, 1) + count
        self.run(True)
        self._stop_at = stop_at

    def halt(self) -> CamState | None:
        """Make an emergency stop.

        Returns the state at speed 0, which must be sent at once, or None if the cam is stopped.
        """
        self.run(False)
        if (state := self.schedule.halt()) is not None:
            self._record_sent(state)
        return state

    def reset(self) -> None:
        """Stop the cam, and continue with the start of the scene at the next `run`.

        Rig time and the cam angle θ are not reset.
        """
        self.run(False)
        if self.schedule.overrides_cam:
            self._requested_cam = ""  # the operator's cam is still mounted
        self.schedule.rewind()
        self._sent_before_reset = self.sent

    def _record_sent(self, state: CamState) -> None:
        self.flow.record_sent(state.time_ns)
        self.sent += 1

    def _is_ready(self, state: CamState, now: float) -> bool:
        """Return True if the cam of a state is requested and its law is known.

        Otherwise request the cam, as soon as the consumers have acknowledged all ticks (times
        between two states) of the previous cam. ``now`` is the wall-clock time (s).
        """
        has_law, is_overridden = state.cam in self.laws, self.schedule.overrides_cam
        if has_law and (is_overridden or state.cam == self._requested_cam):
            return True
        if is_overridden and state.cam != self._requested_cam:  # wait for its law before a request
            self._requested_cam, self._requested_at = state.cam, now
        if state.cam != self._requested_cam and self.flow.in_flight:
            return False
        if state.cam != self._requested_cam or now - self._requested_at > REQUEST_RETRY_S:
            if not self._mount(state.cam):
                return False
            self._requested_cam, self._requested_at = state.cam, now
            self._requests[state.cam] += 1
        return state.cam in self.laws
