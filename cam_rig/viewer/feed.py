"""The messages of a run, in any order of topics, put together into ticks and passed on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Protocol

from cam_rig.arrays import FloatArray
from cam_rig.errors import BagError
from cam_rig.live.flow_control import REMEMBERED_STATES
from cam_rig.live.tick_matching import TickMatcher
from cam_rig.simulation.schedule import CamState

Tick = tuple[CamState, CamState, FloatArray]


class RunReceiver(Protocol):
    """What takes a run tick by tick, in order: a recording for Rerun, or an archive of turns."""

    profiles: dict[str, FloatArray]

    def tick(self, start: CamState, end: CamState, rows: FloatArray) -> None:
        """Take one tick; ``rows`` are the ``(6, n)`` samples of its block."""

    def sound(self, end_ns: int, level: float, pressure: float) -> None:
        """Take level (dB) and pressure (Pa) of the tick that ended at a rig time."""

    def close(self) -> None:
        """Nothing more comes."""


class RunFeed:
    """Takes messages as they come, from a bag or from a live run; passes on what is complete.

    A tick is passed on when both its states, its block and its cam's profile are there. Levels
    carry no stamp: each is published with a pressure, which does.
    """

    def __init__(self, receiver: RunReceiver) -> None:
        self._receiver, self._pairing = receiver, TickMatcher()
        self._ticks: deque[Tick] = deque()
        self._levels: deque[float] = deque()
        self._pressures: deque[tuple[int, float]] = deque()
        self._sounds: deque[tuple[int, float, float]] = deque()
        self._received: dict[CamState | tuple[int, float], None] = {}
        self._drawn = self._sound_until = -1

    @property
    def is_behind(self) -> bool:
        """Whether a tick is drawn whose level has not come yet."""
        return self._sound_until < self._drawn

    def profile(self, cam: str, points: FloatArray) -> None:
        """Take the contour of a cam, ``(n, 2)`` in its own frame, m."""
        self._receiver.profiles[cam] = points

    def state(self, state: CamState) -> None:
        """Take the next state of the cam."""
        if self._is_new(state):
            self._pairing.add_state(state)

    def block(self, rows: FloatArray) -> None:
        """Take the next block of samples, ``(6, n)``."""
        self._pairing.add_block(rows)

    def level(self, level: float) -> None:
        """Take the next level, dB."""
        self._levels.append(level)

    def pressure(self, end_ns: int, pressure: float) -> None:
        """Take the r.m.s. pressure (Pa) of the tick that ended at a rig time."""
        self._pressures.append((end_ns, pressure))

    def draw(self) -> Iterator[Tick]:
        """Draw all that is complete; gives each tick that was."""
        self._ticks.extend(self._pairing.complete())
        while self._levels and self._pressures:
            reading, level = self._pressures.popleft(), self._levels.popleft()
            if self._is_new(reading):
                self._sounds.append((reading[0], level, reading[1]))
        while self._ticks and self._ticks[0][0].cam in self._receiver.profiles:
            tick = self._ticks.popleft()
            self._receiver.tick(*tick)
            self._drawn = tick[1].time_ns
            self._pass_sound()
            yield tick
        self._pass_sound()

    def close(self) -> None:
        """Draw what is left.

        Raises
        ------
        BagError : a cam turned of which no profile came
        """
        for _ in self.draw():
            pass
        self._receiver.close()
        if self._ticks:
            cam = self._ticks[0][0].cam
            raise BagError(f"cam {cam!r} turns, but its /cam/profile is not in the bag")

    def _is_new(self, message: CamState | tuple[int, float]) -> bool:
        """Nodes republish what a subscriber may have missed."""
        if message in self._received:
            return False
        self._received[message] = None
        if len(self._received) > 2 * REMEMBERED_STATES:
            del self._received[next(iter(self._received))]
        return True

    def _pass_sound(self) -> None:
        while self._sounds and self._sounds[0][0] <= self._drawn:
            sound = self._sounds.popleft()
            self._receiver.sound(*sound)
            self._sound_until = sound[0]
