"""Input queues of follower and microphone, which combine messages of two topics.

The order of arrival of messages on two topics is arbitrary.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from cam_rig.dynamics import Block, FollowerState, Samples
from cam_rig.errors import DynamicsError, RefusedError
from cam_rig.laws import Law
from cam_rig.live.flow_control import MAX_WAITING
from cam_rig.live.state_validation import StateValidator
from cam_rig.schema import SceneConfig
from cam_rig.simulation.schedule import CamState
from cam_rig.simulation.simulate import FollowerSimulator
from cam_rig.units import NS, FloatArray

#: Absolute tolerance (s) between the time of a sample and the sampling grid. Messages contain rig
#: time as float64 seconds, so rounding is below 1e-9 s in a run of 10 days.
SAMPLE_TIME_ATOL_S = 1e-6


class FollowerQueue:
    """Queue that combines the drive's states and the law server's laws into ticks.

    A tick is the time between two cam states.
    """

    def __init__(self, simulator: FollowerSimulator, scene: SceneConfig) -> None:
        self._simulator = simulator
        self._validator = StateValidator.of(scene)
        self._waiting: deque[CamState] = deque()

    def add_law(self, law: Law) -> None:
        """Add a law, unless the queue has a law of this name."""
        try:
            self._simulator.model.require(law)
        except DynamicsError as error:
            raise RefusedError(str(error)) from None
        self._simulator.laws.setdefault(law.name, law)

    def add_state(self, state: CamState) -> None:
        """Add the next state of the cam."""
        if len(self._waiting) >= MAX_WAITING:
            raise RefusedError(
                f"cam state at {state.time_ns} ns: dropped, because {MAX_WAITING} states already "
                f"wait for the law of cam {self._waiting[0].cam!r}"
            )
        self._validator.validate(state)
        self._waiting.append(state)

    def complete(self) -> Iterator[tuple[CamState, CamState, FollowerState, Block]]:
        """Yield the result of each tick whose law is known, and remove its state.

        The result is the cam state at the start and at the end of the tick, the follower state at
        the end, and the block of samples. A tick is the time between two cam states.
        """
        while self._waiting and self._waiting[0].cam in self._simulator.laws:
            start, end = self._simulator.last, self._waiting.popleft()
            turned = self._simulator.turn_to(end)
            if turned is not None and start is not None:
                yield start, end, *turned


class TickMatcher:
    """Matches blocks of samples with the two cam states at the ends of their ticks.

    A tick is the time between two cam states. With a `sample_rate` (Hz) every block must contain
    exactly the samples of its tick, and no tick is skipped once the first has been matched. With
    None (for display) any block is accepted, and ticks without a block are skipped.
    """

    def __init__(self, sample_rate: int | None = None) -> None:
        self._sample_rate = sample_rate
        self._has_matched = False
        self._states: deque[CamState] = deque(maxlen=MAX_WAITING)
        self._blocks: deque[FloatArray] = deque(maxlen=MAX_WAITING)

    def add_state(self, state: CamState) -> None:
        """Add the next state of the cam."""
        self._states.append(state)

    def add_block(self, rows: FloatArray) -> None:
        """Add the next block of follower samples, shape (6, n).

        Its first row contains the rig times in s.
        """
        self._blocks.append(rows)

    def complete(self) -> Iterator[tuple[CamState, CamState, FloatArray]]:
        """Yield cam state at start and end, and samples, of each complete tick in order.

        A tick is the time between two cam states.

        Raises
        ------
        RefusedError
            After all complete ticks, if a block did not belong to its tick. The first such block is
            reported.
        """
        refusal = None
        while self._blocks and len(self._states) > 1:
            start, end, rows = self._states[0], self._states[1], self._blocks[0]
            times = Samples(rows).time
            middle_ns = 0.5 * (times[0] + times[-1]) * NS
            is_later = middle_ns >= end.time_ns
            # A node that joins late may lack the blocks of the first ticks.
            may_skip = self._sample_rate is None or not self._has_matched
            if not start.turns_until(end) or (is_later and may_skip):
                self._states.popleft()
                continue
            self._blocks.popleft()
            if middle_ns < start.time_ns:
                continue  # the block of a tick before the first received state
            if not is_later and self._fits(start, end, rows):
                self._states.popleft()
                self._has_matched = True
                yield start, end, rows
            elif refusal is None:
                refusal = RefusedError(
                    f"follower samples: {times.size} samples from {times[0]:.6f} s do not belong "
                    f"to the tick that starts at {start.time_ns / NS:.6f} s"
                )
        if refusal is not None:
            raise refusal

    def _fits(self, start: CamState, end: CamState, rows: FloatArray) -> bool:
        if self._sample_rate is None:
            return True
        grid = start.until(end).grid(self._sample_rate)
        times = start.time_ns / NS + grid.sample_times()
        if rows.shape[1] != grid.count:
            return False
        return bool(np.abs(Samples(rows).time - times).max() < SAMPLE_TIME_ATOL_S)
