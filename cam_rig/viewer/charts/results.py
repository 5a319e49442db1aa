"""What came out so far, in words: a line for each speed of each cam."""

from __future__ import annotations

from cam_rig.simulation.scene import LoadedScene
from cam_rig.units import to_rpm
from cam_rig.viewer.turns import Turn, lift_offs

HEAD = (
    "| cam | rpm | level [dB] | greatest force [N] | least [N] | flights a turn | gap [mm] |",
    "|---|---:|---:|---:|---:|---:|---:|",
)


class ResultLines:
    """A table that grows; the newest line is first."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._motion: dict[tuple[str, float], str] = {}
        self._levels: dict[tuple[str, float], float] = {}

    def motion(self, turn: Turn) -> None:
        """Take the newest turn of a cam at a speed."""
        _, lift, _, _, force, _ = turn.rows
        flights = int(lift_offs(force, bool(force[-1] == 0.0)).sum())
        gap = (
            float((lift - self._loaded.laws[turn.cam](turn.angle)).max()) * 1e3 if flights else 0.0
        )
        words = f"| {force.max():.4g} | {force.min():.4g} | {flights} | {gap:.3g} |"
        self._motion[turn.cam, turn.speed] = words

    def level(self, cam: str, speed: float, level: float) -> None:
        """Take the level (dB) of a cam at a speed (rad/s), measured so far."""
        self._levels[cam, speed] = level

    def words(self) -> str:
        """Markdown."""
        lines = [self._line(*step) for step in reversed(self._motion)]
        return "\n".join(["# Results", "", *HEAD, *lines]) + "\n"

    def _line(self, cam: str, speed: float) -> str:
        level, rpm = self._levels.get((cam, speed)), to_rpm(speed)
        heard = "settling" if level is None else f"{level:.1f}"
        title = self._loaded.cams[cam].title
        return f"| {title} | {rpm:.0f} | {heard} {self._motion[cam, speed]}"
