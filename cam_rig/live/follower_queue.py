"""The follower's day: cam states and laws in any order, ticks out in theirs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from cam_rig.dynamics import Block, FollowerState
from cam_rig.errors import DynamicsError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.admission import Admission, StateValidator
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerCheckpoint, FollowerSimulator

#: States that wait for the law of their cam, and laws that are kept.
MAX_WAITING, MAX_LAWS = 64, 256


class FollowerTicks:
    """Takes what the drive and the law server say, and turns it into ticks.

    Parameters
    ----------
    bench : the follower, without laws: the law server's word counts
    scene : what the drive runs
    memory : of a predecessor, to go on from
    """

    def __init__(
        self, bench: FollowerSimulator, scene: SceneConfig, memory: FollowerCheckpoint | None = None
    ) -> None:
        self._bench = bench
        if memory is not None:
            bench.memory = memory
        self._gate = StateValidator.of(scene, bench.memory.last)
        self._waiting: deque[CamState] = deque()

    @property
    def memory(self) -> FollowerCheckpoint:
        """To hand over after each tick."""
        return self._bench.memory

    def add_law(self, law: Law) -> None:
        """Take a law.

        Raises
        ------
        RefusedError : the cam turns with another law of that name, there are too many, or the
            model cannot take it
        """
        try:
            self._bench.model.require(law)
        except DynamicsError as error:
            raise RefusedError(str(error)) from None
        laws, last = self._bench.laws, self._gate.last
        known = laws.get(law.name)
        if known is None and len(laws) >= MAX_LAWS:
            raise RefusedError(f"law {law.name!r}: is one more than {MAX_LAWS}; restart the node")
        if last is not None and last.speed > 0.0:
            require_same(known, law)
        laws[law.name] = law

    def add_state(self, state: CamState) -> Admission:
        """Take a state of the cam, and tell what it is to those before.

        Raises
        ------
        RefusedError : it cannot follow the one before
        """
        if len(self._waiting) >= MAX_WAITING:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: {MAX_WAITING} others wait for the law of "
                f"{self._waiting[0].cam!r}"
            )
        if (admission := self._gate.admit(state)) is not Admission.SEEN:
            self._waiting.append(state)
        return admission

    def complete(self) -> Iterator[tuple[CamState, FollowerState, Block]]:
        """End, follower and block of every tick whose cam is known, in order.

        Raises
        ------
        DynamicsError : the model cannot pass through a tick
        """
        while self._waiting and self._waiting[0].cam in self._bench.laws:
            state = self._waiting.popleft()
            turned = self._bench.turn_to(state)
            if turned is not None:
                yield state, *turned


def require_same(known: Law | None, law: Law) -> None:
    """Refuse another law of a name that is known.

    Raises
    ------
    RefusedError : it differs
    """
    if known is None:
        return
    pairs = ((known.breaks, law.breaks), (known.ordinates, law.ordinates))
    if not all(np.array_equal(one, other) for one, other in pairs):
        raise RefusedError(
            f"law {law.name!r}: another one of that name, while the cam turns; allowed: one "
            "(is a second law server at work?)"
        )
