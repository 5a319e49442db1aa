"""What the viewer shows as text: the scene with every number, and a table of results."""

from __future__ import annotations

from cam_rig.drawing.words import four_digits, shortened
from cam_rig.schema.quantity import ORIGINS, Quantity
from cam_rig.simulation.calibrated import RELATIVE_NOTE
from cam_rig.simulation.loaded_scene import LoadedScene
from cam_rig.units import to_rpm
from cam_rig.viewer.charts.quantities import gap_of
from cam_rig.viewer.turns import Turn, lift_offs

#: Letters of a cam's title that tables and charts have room for where a page is 1000 pixels wide.
MAX_TITLE = 24
HEAD = (
    "| cam | rpm | level [dB] | max force [N] | min force [N] | lift-offs | gap [µm] |",
    "|---|---:|---:|---:|---:|---:|---:|",
)


class ResultTable:
    """A table that grows: cams in the scene's order, each with its speeds in theirs."""

    def __init__(self, loaded: LoadedScene) -> None:
        self._loaded = loaded
        self._motion: dict[tuple[str, float], str] = {}
        self._levels: dict[tuple[str, float], float] = {}

    def motion(self, turn: Turn) -> None:
        """Take the newest turn of a cam at a speed."""
        force, law = turn.force, self._loaded.laws[turn.cam]
        count = int(lift_offs(force, bool(force[-1] == 0.0)).sum())
        gap = 1e6 * float(gap_of(law, turn.angle, turn).max()) if count else 0.0
        most, least = four_digits(float(force.max())), four_digits(float(force.min()))
        words = f"| {most} | {least} | {count} | {four_digits(gap)} |"
        self._motion[turn.cam, turn.speed] = words

    def level(self, cam: str, speed: float, level: float) -> None:
        """Take the level (dB) of a cam at a speed (rad/s), measured so far."""
        self._levels[cam, speed] = level

    def words(self, state: str = "") -> str:
        """Markdown; ``state`` of a live run stands in the heading: running, finished."""
        lines, cams = [], [*self._loaded.cams]
        for cam in cams:
            steps = [step for step in self._motion if step[0] == cam]
            lines += [self._line(*step, first=step is steps[0]) for step in steps]
        head = (
            HEAD
            if self._loaded.calibrated
            else (HEAD[0].replace("level", "relative level"), HEAD[1])
        )
        return "\n".join([f"# Results{f', {state}' if state else ''}", "", *head, *lines]) + "\n"

    def _line(self, cam: str, speed: float, first: bool) -> str:
        level, rpm = self._levels.get((cam, speed)), to_rpm(speed)
        shown = "settling" if level is None else f"{level:.4g}"
        title = shortened(self._loaded.cams[cam].title, MAX_TITLE) if first else ""
        return f"| {title} | {rpm:.4g} | {shown} {self._motion[cam, speed]}"


def about(loaded: LoadedScene, bucket: int) -> str:
    """Markdown on the scene, its cams and its rig; of ``bucket`` samples two are shown."""
    scene, rig = loaded.scene, loaded.rig
    lines = [
        f"# {scene.title}",
        f"Model `{scene.model}`, {scene.sample_rate.si:g} samples per second, "
        f"{scene.program.turns.si:g} turns at each speed.",
        "The follower is drawn at its simulated lift; contact is lost where the force is zero.",
    ]
    if not loaded.calibrated:
        lines.append(RELATIVE_NOTE)
    if bucket > 1:
        lines.append(f"Of every {bucket} samples the curves show the minimum and the maximum.")
    for name, cam in loaded.cams.items():
        lines += [f"## {cam.title}", f"`{name}`, {cam.follower.type} follower"]
        lines += by_origin(cam.numbers())
    lines += [f"## {rig.title}", f"`{rig.name}`"]
    parts = [*rig.follower, *(rig.radiation or ())]
    lines += by_origin({key: value for key, value in parts if isinstance(value, Quantity)})
    return "\n\n".join(lines) + "\n"


def by_origin(numbers: dict[str, Quantity]) -> list[str]:
    """A paragraph for the given, the assumed and the identified ones of the numbers."""
    lines = []
    for origin in ORIGINS:
        named = [f"{key} {_value(q)}" for key, q in numbers.items() if q.origin == origin]
        if named:
            lines.append(f"**{origin}:** " + "; ".join(named))
    return lines


def _value(quantity: Quantity) -> str:
    values = ", ".join(f"{value:g}" for value in quantity.numbers)
    return values if quantity.unit == "1" else f"{values} {quantity.unit}"
