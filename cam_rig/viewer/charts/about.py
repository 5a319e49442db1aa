"""What the picture shows, in words: the scene, and every number by its origin."""

from __future__ import annotations

from cam_rig.schema.quantity import ORIGINS, Quantity
from cam_rig.simulation.scene import LoadedScene


def about(loaded: LoadedScene, bucket: int) -> str:
    """Markdown on the scene, its cams and its rig; of ``bucket`` samples two are shown."""
    scene, rig = loaded.scene, loaded.rig
    lines = [
        f"# {scene.title}",
        f"Model `{scene.model}`, {scene.sample_rate.si:g} samples a second, "
        f"{scene.program.turns.si:g} turns at each speed.",
        "The follower is drawn at its simulated lift. Where the contact force is zero it flies.",
    ]
    if bucket > 1:
        lines.append(f"Of every {bucket} samples the curves show the least and the greatest.")
    for name, cam in loaded.cams.items():
        lines += [f"## {cam.title}", f"`{name}`, {cam.follower.type} follower"]
        lines += by_origin(cam.numbers())
    lines += [f"## {rig.title}", f"`{rig.name}`"]
    parts = [*rig.follower, *rig.radiation]
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
