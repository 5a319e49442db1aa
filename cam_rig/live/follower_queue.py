"""The follower's input queue: cam states and laws come in any order, ticks go out in theirs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from cam_rig.dynamics import Block, FollowerState
from cam_rig.errors import DynamicsError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import MAX_WAITING
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerCheckpoint, FollowerSimulator

#: Laws that a node keeps.
MAX_LAWS = 256


class FollowerQueue:
    """Takes the drive's states and the law server's laws, and turns them into ticks.

    Parameters
    ----------
    simulator : the follower, without laws: those that are published count
    scene : what the drive runs
    checkpoint : of a predecessor, to go on from
    """

    def __init__(
        self,
        simulator: FollowerSimulator,
        scene: SceneConfig,
        checkpoint: FollowerCheckpoint | None = None,
    ) -> None:
        self._simulator = simulator
        if checkpoint is not None:
            simulator.checkpoint = checkpoint
        self._validator = StateValidator.of(scene, simulator.checkpoint.last)
        self._waiting: deque[CamState] = deque()

    @property
    def checkpoint(self) -> FollowerCheckpoint:
        """To be saved after each tick."""
        return self._simulator.checkpoint

    def add_law(self, law: Law) -> None:
        """Take a law.

        Raises
        ------
        RefusedError : the cam turns with another law of that name, there are too many, or the
            model cannot take it
        """
        try:
            self._simulator.model.require(law)
        except DynamicsError as error:
            raise RefusedError(str(error)) from None
        laws, last = self._simulator.laws, self._validator.last
        known = laws.get(law.name)
        if known is None and len(laws) >= MAX_LAWS:
            raise RefusedError(f"law {law.name!r}: is one more than {MAX_LAWS}; restart the node")
        if last is not None and last.speed > 0.0:
            require_same(known, law)
        laws[law.name] = law

    def add_state(self, state: CamState) -> Admission:
        """Take a state of the cam; how it relates to those before.

        Raises
        ------
        RefusedError : it cannot follow the one before
        """
        if len(self._waiting) >= MAX_WAITING:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: {MAX_WAITING} others wait for the law of "
                f"{self._waiting[0].cam!r}"
            )
        if (admission := self._validator.admit(state)) is not Admission.SEEN:
            self._waiting.append(state)
        return admission

    def complete(self) -> Iterator[tuple[CamState, CamState, FollowerState, Block]]:
        """Start, end, follower and block of every tick whose cam is known, in order.

        Raises
        ------
        DynamicsError : the model cannot pass through a tick
        """
        while self._waiting and self._waiting[0].cam in self._simulator.laws:
            start, end = self._simulator.checkpoint.last, self._waiting.popleft()
            turned = self._simulator.turn_to(end)
            if turned is not None and start is not None:
                yield start, end, *turned


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
