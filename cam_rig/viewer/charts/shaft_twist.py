"""The twist of the shaft behind the cam, which no message carries."""

from __future__ import annotations

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS, Interval
from cam_rig.dynamics.torsional.model import begin, inner_of
from cam_rig.dynamics.torsional.motion import solve
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.units import NS

#: The model whose shaft's twist is shown.
TORSIONAL = "torsional"


class ShaftTwist:
    """The twist of the shaft, solved again as it was: each tick from where the one before ended."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._parameters = MODELS[TORSIONAL].parameters(loaded.rig)
        self._end: tuple[str, tuple[float, ...], float] | None = None

    def tick(self, cam: str, interval: Interval, time: FloatArray) -> FloatArray:
        """``(n,)`` twist in rad at ``time`` (s of rig time) within the tick of a cam."""
        known = self._end is not None and self._end[0] == cam
        inner, speed = self._end[1:] if self._end is not None and known else ((), None)
        law, at = self._loaded.laws[cam], interval.start_ns / NS
        driven, state = begin(law, self._parameters, inner, speed, interval)
        motion = solve(law, driven, state, at, interval.duration, interval.acceleration)
        self._end = cam, inner_of(motion), interval.speed_at(interval.duration)
        return motion.at(time.clip(at, motion.stop_time))[0]
