"""What the drive does next: which state to send, which cam to request, when it is done."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import TICKS_KEPT, FlowControl, Pacing
from cam_rig.live.queues import MAX_LAWS, require_same
from cam_rig.live.setpoints import ScheduleState, SetpointSchedule
from cam_rig.live.state_validation import speeds
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.units import RPM

#: Wall time (s) after which an unanswered request for a cam is repeated.
REQUEST_RETRY_S = 1.0


@dataclass(frozen=True)
class DriveCheckpoint:
    """What a drive's successor must know: its schedule, and the state that may be in flight."""

    schedule: ScheduleState
    state: CamState
    sent: int
    running: bool


@dataclass(frozen=True)
class OperatorCommands:
    """What operators have commanded, and the schedule then: a successor must know it at once."""

    schedule: ScheduleState
    running: bool
    pacing: str


class DriveProgram:
    """The scene's states in order, each held back until every consumer is ready for it.

    A state goes out when few ticks are in flight, the law of its cam is known, and its time has
    come. A new cam is requested when every tick of the one before is acknowledged. So nothing is
    dropped, and a run repeats message by message.

    Parameters
    ----------
    scene : what to run
    consumers : the nodes that acknowledge, see `FlowControl`
    mount : requests a cam from the law server; False when that cannot be done yet
    checkpoints : of the predecessor, the oldest first, whose states are sent again
    commands : the last that the predecessor got; they hold where no state came after them
    """

    def __init__(
        self,
        scene: SceneConfig,
        consumers: list[str],
        mount: Callable[[str], bool],
        checkpoints: Sequence[DriveCheckpoint] = (),
        commands: OperatorCommands | None = None,
    ) -> None:
        self.laws: dict[str, Law] = {}
        self.flow = FlowControl(consumers)
        self.pacing = Pacing()
        self.ticks = tick_count(scene)
        self.sent, self._speeds = 0, speeds(scene)
        latest = _newest(checkpoints, commands)
        self.running = latest.running if latest else True
        self.schedule = SetpointSchedule(scene, latest.schedule if latest else None)
        self._halting = False
        self._recent: deque[CamState] = deque(maxlen=TICKS_KEPT["cam_drive"])
        self._resending: deque[CamState] = deque()
        self._mount = mount
        self._asked, self._asked_at = "", -REQUEST_RETRY_S
        self._requests: Counter[str] = Counter()
        if checkpoints:
            self._resume(checkpoints)

    def _resume(self, checkpoints: Sequence[DriveCheckpoint]) -> None:
        self.sent = checkpoints[0].sent - 1
        for checkpoint in checkpoints:
            self._resending.append(checkpoint.state)
            self.flow.sent(checkpoint.state.time_ns)

    def add_law(self, law: Law) -> None:
        """Take a law."""
        if self.sent > 0:
            require_same(self.laws.get(law.name), law)
        if len(self.laws) >= MAX_LAWS and law.name not in self.laws:
            raise RefusedError(f"law {law.name!r}: is one more than {MAX_LAWS}; restart the node")
        self.laws[law.name] = law

    @property
    def done(self) -> bool:
        """Whether every state is sent and every tick acknowledged; a halted drive is not done."""
        at_end = self.schedule.next_state is None and not self.halted
        return at_end and not self._resending and self.flow.in_flight == 0

    @property
    def halted(self) -> bool:
        """Whether an emergency stop holds, until a reset."""
        return self._halting or self.schedule.state.halted

    @property
    def checkpoint(self) -> DriveCheckpoint:
        """To be saved before the state that was taken last goes out."""
        return DriveCheckpoint(self.schedule.state, self._recent[-1], self.sent, self.running)

    def take(self, now: float) -> CamState | None:
        """The next state, when it may go out at wall time ``now`` (s)."""
        if self._resending:
            return self._resend()
        if self._halting:
            return self.halt()
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
        """Rig time (ns) of a paced run at wall time ``now`` (s), before the next state's.

        None where no tick turns, or in a free run, whose rig time goes from state to state.
        """
        last, following = self.schedule.state.last, self.schedule.next_state
        reached = self.pacing.reached(now)
        if reached is None or last is None or following is None or self._resending:
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

    def unanswered(self) -> list[CamState]:
        """The states in flight, to be sent again without an answer: one may have been lost."""
        return [state for state in self._recent if self.flow.is_in_flight(state.time_ns)]

    def halt(self) -> CamState | None:
        """Emergency stop: the state that makes the cam stand, to be sent at once."""
        self.run(False)
        self._halting = bool(self._resending)  # a successor first sends its predecessor's
        state = None if self._halting else self.schedule.halt()
        return None if state is None else self._out(state)

    def reset(self) -> None:
        """Back to the scene's beginning, stopped; rig time and θ continue."""
        self.run(False)
        self._halting = False
        self.schedule.rewind()

    def waits_for(self) -> list[str]:
        """The nodes that have not answered yet."""
        return self.flow.behind() or ["law_server"]

    def _resend(self) -> CamState | None:
        if self._resending[0].cam not in self.laws:
            return None
        state = self._resending.popleft()
        self._recent.append(state)
        self.sent += 1
        return state

    def _out(self, state: CamState) -> CamState:
        self.flow.sent(state.time_ns)
        self._recent.append(state)
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


def _newest(
    checkpoints: Sequence[DriveCheckpoint], commands: OperatorCommands | None
) -> DriveCheckpoint | OperatorCommands | None:
    """The last state's checkpoint, or the commands where no state was sent after them."""
    if not checkpoints or commands is None:
        return commands or (checkpoints[-1] if checkpoints else None)
    last = commands.schedule.last
    obeyed = last is None or last.time_ns < checkpoints[-1].state.time_ns
    return checkpoints[-1] if obeyed else commands
