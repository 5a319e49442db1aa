"""The follower's input queue: cam states and laws come in any order, ticks go out in theirs."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from cam_rig.dynamics import Block, FollowerState, Samples
from cam_rig.errors import DynamicsError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import HISTORY_DEPTH, MAX_WAITING, TICKS_IN_HISTORY
from cam_rig.live.state_validation import Admission, StateValidator
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerCheckpoint, FollowerSimulator
from cam_rig.units import NS, FloatArray


class FollowerQueue:
    """Turns the drive's states and the law server's laws into ticks, from a ``checkpoint`` on."""

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
        """Take a law of the scene's library; one that is known is not changed."""
        try:
            self._simulator.model.require(law)
        except DynamicsError as error:
            raise RefusedError(str(error)) from None
        self._simulator.laws.setdefault(law.name, law)

    def add_state(self, state: CamState) -> Admission:
        """Take a state of the cam; how it relates to those before."""
        if len(self._waiting) >= MAX_WAITING:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: {MAX_WAITING} others wait for the law of "
                f"{self._waiting[0].cam!r}"
            )
        if (admission := self._validator.admit(state)) is not Admission.SEEN:
            self._waiting.append(state)
        return admission

    def complete(self) -> Iterator[tuple[CamState, CamState, FollowerState, Block]]:
        """Start, end, follower and block of every tick whose cam is known, in order."""
        while self._waiting and self._waiting[0].cam in self._simulator.laws:
            start, end = self._simulator.checkpoint.last, self._waiting.popleft()
            turned = self._simulator.turn_to(end)
            if turned is not None and start is not None:
                yield start, end, *turned


# How often messages may be sent again: what a successor needs stays in the topic's history.


class RepeatBudget:
    """Counts what one latched topic has published, of ticks for the first time and repeated.

    A repeated message takes a place in the topic's history. A node that is started again goes
    back as far as the first messages of the last ticks, in their order; repeats that would push
    one of them out are not allowed. New ticks make room for others.
    """

    def __init__(self) -> None:
        self._first: deque[int] = deque(maxlen=TICKS_IN_HISTORY)
        self._published = 0

    def publish(self) -> None:
        """Note the first message of the next tick."""
        self._first.append(self._published)
        self._published += 1

    def repeat(self) -> bool:
        """Whether a message may be published again; if so, it is noted."""
        oldest = self._first[0] if self._first else self._published
        to_come = TICKS_IN_HISTORY - len(self._first)
        allowed = self._published - oldest + to_come < HISTORY_DEPTH
        self._published += allowed
        return allowed


# Matching blocks of samples with cam states: they come on two topics, in any order.


class TickMatcher:
    """Yields each block with the states that its tick begins and ends with, each tick once.

    A block without its tick's samples at ``sample_rate`` (Hz) is refused, and no tick left out;
    None takes any block, and leaves ticks out that have none. Ticks that begin before rig time
    ``since`` (ns) were done by a predecessor.
    """

    def __init__(self, sample_rate: int | None = None, since: int = 0) -> None:
        self._sample_rate, self._since = sample_rate, since
        self._began = since > 0
        self._states: deque[CamState] = deque(maxlen=MAX_WAITING)
        self._blocks: deque[FloatArray] = deque(maxlen=MAX_WAITING)

    def add_state(self, state: CamState) -> None:
        """Take the next state of the cam."""
        if state.time_ns >= self._since:
            self._states.append(state)
        if state.speed == 0.0:  # the next sequence may begin at any time
            self._since = 0

    def add_block(self, rows: FloatArray) -> None:
        """Take the next block, ``(6, n)`` with rig time in s in its first row."""
        self._blocks.append(rows)

    def complete(self) -> Iterator[tuple[CamState, CamState, FloatArray]]:
        """Start, end and rows of every tick that is complete, in order, each once."""
        refused = None
        # A tick may lack its block on joining late, or where blocks were lost.
        while self._blocks and len(self._states) > 1:
            start, end, rows = self._states[0], self._states[1], self._blocks[0]
            times = Samples(rows).time
            middle = 0.5 * (times[0] + times[-1]) * NS
            later = middle >= end.time_ns
            if not start.turns_until(end) or (later and not (self._sample_rate and self._began)):
                self._states.popleft()  # the cam stood, or this tick has no block
                continue
            if later:
                refused = refused or self._refusal(start, rows)
            self._blocks.popleft()
            if later or middle < start.time_ns:
                continue  # from before the subscription, or sent again
            if self._fits(start, end, rows):
                self._states.popleft()
                self._began = True
                yield start, end, rows
            else:
                refused = refused or self._refusal(start, rows)
        if refused is not None:
            raise refused

    def _fits(self, start: CamState, end: CamState, rows: FloatArray) -> bool:
        if self._sample_rate is None:
            return True
        grid = start.until(end).grid(self._sample_rate)
        times = start.time_ns / NS + grid.since_start()
        return rows.shape[1] == grid.count and bool(np.abs(Samples(rows).time - times).max() < 1e-6)

    def _refusal(self, start: CamState, rows: FloatArray) -> RefusedError:
        times = Samples(rows).time
        return RefusedError(
            f"follower samples: {times.size} from {times[0]:.6f} s on; allowed: the samples "
            f"of the tick that begins at {start.time_ns / NS:.6f} s"
        )
