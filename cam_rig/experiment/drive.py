"""What the drive does next: which state to send, which cam to ask for, when it is done."""

from __future__ import annotations

from collections.abc import Callable

from cam_rig.experiment.credit import Credit
from cam_rig.experiment.program import CamState, cam_states, tick_count
from cam_rig.laws import Law
from cam_rig.schema import SceneConfig


class DriveProgram:
    """The scene's states in order, each held back until everyone is ready for it.

    A state needs credit (few ticks in flight) and the law of its cam. A new cam is asked for when
    every tick of the one before is dealt with. So nothing is dropped, and a run repeats message by
    message.

    Parameters
    ----------
    scene : what to run
    consumers, limit : see `Credit`
    mount : asks the law server for a cam; False when it cannot be asked yet
    """

    def __init__(
        self, scene: SceneConfig, consumers: list[str], limit: int, mount: Callable[[str], bool]
    ) -> None:
        self.laws: dict[str, Law] = {}
        self.credit = Credit(consumers, limit)
        self.ticks = tick_count(scene)
        self.sent = 0
        self._states = cam_states(scene)
        self._next: CamState | None = next(self._states)
        self._mount = mount
        self._asked = ""

    @property
    def done(self) -> bool:
        """Whether every state is sent and every tick dealt with."""
        return self._next is None and self.credit.in_flight == 0

    def take(self) -> CamState | None:
        """The next state, when it may go out now."""
        state = self._next
        if state is None or not self.credit.may_send() or not self._ready(state):
            return None
        self.credit.sent(state.time_ns)
        self.sent += 1
        self._next = next(self._states, None)
        return state

    def waits_for(self) -> list[str]:
        """Who has not answered yet."""
        return self.credit.behind() or ["law_server"]

    def _ready(self, state: CamState) -> bool:
        if state.cam != self._asked:
            if self.credit.in_flight or not self._mount(state.cam):
                return False
            self._asked = state.cam
        return state.cam in self.laws
