"""What the drive does next: which state to send, which cam to ask for, when it is done."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cam_rig.errors import RefusedError
from cam_rig.laws import Law
from cam_rig.live.admission import speeds
from cam_rig.live.checkpoint import TICKS_KEPT
from cam_rig.live.flow_control import FlowControl
from cam_rig.live.follower_queue import MAX_LAWS, require_same
from cam_rig.live.pacing import Pacing
from cam_rig.live.setpoints import ScheduleState, SetpointSchedule
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState, tick_count
from cam_rig.units import RPM

#: Wall time (s) after which an unanswered request for a cam is made again.
ASK_AGAIN = 1.0


@dataclass(frozen=True)
class DriveMemory:
    """What a drive's successor must know: where it is, and the state that may be on its way."""

    place: ScheduleState
    state: CamState
    sent: int
    running: bool


@dataclass(frozen=True)
class OperatorCommands:
    """What hands have asked of a drive, and where it was then: its successor must know at once."""

    place: ScheduleState
    running: bool
    rpm: float
    pacing: str


class DriveProgram:
    """The scene's states in order, each held back until everyone is ready for it.

    A state needs credit (few ticks in flight), the law of its cam, and its time. A new cam is asked
    for when every tick of the one before is dealt with. So nothing is dropped, and a run repeats
    message by message.

    Parameters
    ----------
    scene : what to run
    consumers, limit : see `FlowControl`
    mount : asks the law server for a cam; False when it cannot be asked yet
    memories : of the predecessor, the oldest first, whose states are sent again
    orders : the last that the predecessor was given; they hold where no state came after them
    """

    def __init__(
        self,
        scene: SceneConfig,
        consumers: list[str],
        limit: int,
        mount: Callable[[str], bool],
        memories: Sequence[DriveMemory] = (),
        orders: OperatorCommands | None = None,
    ) -> None:
        self.laws: dict[str, Law] = {}
        self.credit = FlowControl(consumers, limit)
        self.pacing = Pacing()
        self.ticks = tick_count(scene)
        self.sent, self._speeds = 0, speeds(scene)
        left = _newest(memories, orders)
        self.running = left.running if left else True
        self.table = SetpointSchedule(scene, left.place if left else None)
        self._halting = False
        self._recent: deque[CamState] = deque(maxlen=max(TICKS_KEPT["cam_drive"], limit + 1))
        self._again: deque[CamState] = deque()
        self._mount = mount
        self._asked, self._asked_at = "", -ASK_AGAIN
        self._requests: Counter[str] = Counter()
        if memories:
            self._follow(memories)

    def _follow(self, memories: Sequence[DriveMemory]) -> None:
        self.sent = memories[0].sent - 1
        for memory in memories:
            self._again.append(memory.state)
            self.credit.sent(memory.state.time_ns)

    def add_law(self, law: Law) -> None:
        """Take a law.

        Raises
        ------
        RefusedError : the cam turns with another law of that name, or there are too many
        """
        if self.sent > 0:
            require_same(self.laws.get(law.name), law)
        if len(self.laws) >= MAX_LAWS and law.name not in self.laws:
            raise RefusedError(f"law {law.name!r}: is one more than {MAX_LAWS}; restart the node")
        self.laws[law.name] = law

    @property
    def done(self) -> bool:
        """Whether every state is sent and every tick dealt with; a halted drive is not done."""
        at_end = self.table.state is None and not self.halted
        return at_end and not self._again and self.credit.in_flight == 0

    @property
    def halted(self) -> bool:
        """Whether an emergency stop holds, until a reset."""
        return self._halting or self.table.place.halted

    @property
    def memory(self) -> DriveMemory:
        """To hand over before the state that was taken last goes out."""
        return DriveMemory(self.table.place, self._recent[-1], self.sent, self.running)

    def take(self, now: float) -> CamState | None:
        """The next state, when it may go out at wall time ``now`` (s)."""
        if self._again:
            return self._repeat()
        if self._halting:
            return self.halt()
        state = self.table.state
        if state is None or not self.running or not self.credit.may_send():
            return None
        if not self._ready(state, now) or self.pacing.wait(state.time_ns, now) > 0.0:
            return None
        self.table.advance()
        self.pacing.sent(state.time_ns, now)
        return self._out(state)

    def expects(self, cam: str) -> bool:
        """Whether the law server was asked for a cam and has not said yet that it is mounted."""
        return self._requests[cam] > 0

    def mounted(self, cam: str) -> None:
        """Note what the law server says is mounted: what it was asked for, or another by hand.

        Its word may come when the drive has sent that cam's last state and looks at the next cam's,
        or later still: each request has one answer.
        """
        if self.expects(cam):
            self._requests[cam] -= 1
        else:
            self.table.mount(cam)

    def refused(self, cam: str) -> None:
        """Note that the law server has no such cam: whoever said that it is mounted was wrong."""
        self._requests[cam] = 0
        if self.table.state is not None and self.table.state.cam == cam:
            self.table.mount("")

    def wait(self, now: float) -> float:
        """Wall time (s) until the next state is due; zero when it waits for somebody instead."""
        state = self.table.state
        return 0.0 if state is None else self.pacing.wait(state.time_ns, now)

    def command(self, speed: float) -> None:
        """Turn at a speed (rad/s) from the next state on; zero as the scene says.

        Raises
        ------
        RefusedError : no cam can turn so fast
        """
        self.require_speed(speed)
        self.table.command(speed or None)

    def require_speed(self, speed: float) -> None:
        """Refuse a speed (rad/s) that no cam, or no tick, can have.

        Raises
        ------
        RefusedError : with the limits
        """
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
        """The states in flight, to be said again when nobody answers: one may have been lost."""
        return [state for state in self._recent if self.credit.is_in_flight(state.time_ns)]

    def halt(self) -> CamState | None:
        """Emergency stop: the state that makes the cam stand, to be sent at once."""
        self.run(False)
        self._halting = bool(self._again)  # a successor says its predecessor's states first
        state = None if self._halting else self.table.halt()
        return None if state is None else self._out(state)

    def reset(self) -> None:
        """Back to the scene's beginning, stopped; rig time and θ go on."""
        self.run(False)
        self._halting = False
        self.table.rewind()

    def waits_for(self) -> list[str]:
        """Who has not answered yet."""
        return self.credit.behind() or ["law_server"]

    def _repeat(self) -> CamState | None:
        if self._again[0].cam not in self.laws:
            return None
        state = self._again.popleft()
        self._recent.append(state)
        self.sent += 1
        return state

    def _out(self, state: CamState) -> CamState:
        self.credit.sent(state.time_ns)
        self._recent.append(state)
        self.sent += 1
        return state

    def _ready(self, state: CamState, now: float) -> bool:
        known, by_hand = state.cam in self.laws, self.table.by_hand
        if known and (by_hand or state.cam == self._asked):
            return True
        if by_hand and state.cam != self._asked:  # its law is on its way, if there is one
            self._asked, self._asked_at = state.cam, now
        if state.cam != self._asked and self.credit.in_flight:
            return False
        if state.cam != self._asked or now - self._asked_at > ASK_AGAIN:
            if not self._mount(state.cam):
                return False
            self._asked, self._asked_at = state.cam, now
            self._requests[state.cam] += 1
        return state.cam in self.laws


def _newest(
    memories: Sequence[DriveMemory], orders: OperatorCommands | None
) -> DriveMemory | OperatorCommands | None:
    """The last state's memory, or the orders where no state was sent after them."""
    if not memories or orders is None:
        return orders or (memories[-1] if memories else None)
    last = orders.place.last
    obeyed = last is None or last.time_ns < memories[-1].state.time_ns
    return memories[-1] if obeyed else orders
