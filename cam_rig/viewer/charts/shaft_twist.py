"""The twist of the shaft behind the cam, which no message carries: solved again, as it was."""

from __future__ import annotations

from cam_rig.arrays import FloatArray
from cam_rig.dynamics import MODELS
from cam_rig.dynamics.torsional.parameters import TorsionalState
from cam_rig.dynamics.torsional.solution import solve
from cam_rig.simulation.scene import LoadedScene
from cam_rig.simulation.schedule import CamState
from cam_rig.units import NS

MODEL = "torsional"


class ShaftTwist:
    """Follows a run tick by tick, each from where the one before ended."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._parameters = MODELS[MODEL].parameters(loaded.rig)
        self._end: tuple[str, TorsionalState] | None = None

    def tick(self, start: CamState, end: CamState, time: FloatArray) -> FloatArray:
        """``(n,)`` twist in rad at ``time`` (s of rig time) within the tick."""
        last = self._end[1] if self._end is not None and self._end[0] == start.cam else None
        twist, rate = (0.0, 0.0) if last is None else (last.twist, last.twist_rate)
        begin, duration = start.time_ns / NS, (end.time_ns - start.time_ns) / NS
        state = TorsionalState(twist, rate, start.angle, start.speed)
        law, ramp = self._loaded.laws[start.cam], start.until(end).acceleration
        motion = solve(law, self._parameters, state, begin, duration, ramp)
        self._end = start.cam, motion.end
        return motion.at(time.clip(begin, motion.stop_time))[0]
