"""Write the atlas of docs/electronic.md: each shipped cam in the forms of a controller.

    .venv/bin/python -m tools.docs.electronic

It takes some minutes, so ``make docs`` does not run it. A test compares rows of the page with the
code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import cam_rig
from cam_rig.dynamics import FollowerParameters
from cam_rig.dynamics.jump.any_follower import find_contact_loss_speed
from cam_rig.dynamics.vibration import low_dwell
from cam_rig.laws import Law
from cam_rig.schema.load import config_root
from cam_rig.studies.electronic.building import Target, controller_cam
from cam_rig.studies.electronic.study import BY, dwell_vibration
from cam_rig.studies.electronic.tables import Interpolation, sample_table, table_law
from cam_rig.units import RPM

PAGE = Path(__file__).parents[2] / "docs" / "electronic.md"
#: Line of the page after which the atlas starts.
START = "<!-- atlas: tools/docs/electronic.py -->\n"
#: Rig of the atlas.
RIG = "paper_table2"
#: Speeds (rpm) of which the atlas contains the largest vibration and the largest excess of level.
ATLAS_RPM = (150.0, 200.0, 250.0, 300.0)
#: Tables of the atlas: interpolation and number of points.
TABLES = (
    (Interpolation.LINEAR, 64),
    (Interpolation.CUBIC, 64),
    (Interpolation.SLIDING, 64),
    (Interpolation.SPLINE, 64),
    (Interpolation.CUBIC, 256),
    (Interpolation.SPLINE, 256),
)
#: Name of the shipped cam that is a table of a controller itself.
TABLE_CAM = "poly4567_table"
#: Headings of the forms.
FORMS = ("law", *(f"{kind.value} {count}" for kind, count in TABLES), "codesys")


def atlas_cams() -> list[str]:
    """Return the shipped cams with a closing spring and without velocity jumps."""
    names = {path.stem for path in (config_root() / "cams").glob("*.yaml")} - {TABLE_CAM}
    return [
        name
        for name in sorted(names)
        if cam_rig.load_cam(name).follower.sprung and not cam_rig.build_law(name).velocity_jumps
    ]


def laws_of(name: str) -> list[Law]:
    """Return the law of a cam in each form of `FORMS`."""
    cam, law = cam_rig.load_cam(name), cam_rig.build_law(name)
    tables = [table_law(sample_table(law, count), kind) for kind, count in TABLES]
    return [law, *tables, controller_cam(cam, law, Target.CODESYS).law]


def vibrations(name: str) -> list[str]:
    """Return the largest residual vibration (µm) of each form."""
    follower = FollowerParameters.on_stem(cam_rig.load_rig(RIG), BY)
    laws = laws_of(name)
    window = low_dwell(laws[0])
    largest = (
        max(dwell_vibration(law, follower, rpm, window) for rpm in ATLAS_RPM) for law in laws
    )
    return [f"{1e6 * x:.3g}" if x < 1e-4 else f"{1e6 * x:.0f}" for x in largest]


def jump_speeds(name: str) -> list[str]:
    """Return the jump speed (rpm) of each form."""
    rig = cam_rig.load_rig(RIG)
    return [f"{find_contact_loss_speed(law, rig) / RPM:.1f}" for law in laws_of(name)]


def excess_levels(name: str) -> list[str]:
    """Return the largest excess of the sound level (dB) of each form over that of the law."""

    def level(law: Law, rpm: float) -> float:
        motion = cam_rig.simulate(law, RIG, model="two_mass", rpm=rpm, turns=4)
        return cam_rig.sound_level(motion).level_db

    first, *others = ([level(law, rpm) for rpm in ATLAS_RPM] for law in laws_of(name))
    excess = [max(x - y for x, y in zip(row, first, strict=True)) for row in others]
    return [f"{max(first):.1f}", *(f"{round(value, 1) + 0.0:+.1f}" for value in excess)]


def lines(caption: str, cells: Callable[[str], list[str]]) -> Iterator[str]:
    """Yield the lines of a table with a row per cam."""
    yield from (
        "",
        caption,
        "",
        f"| cam | {' | '.join(FORMS)} |",
        "|---" + "|--:" * len(FORMS) + "|",
    )
    for name in atlas_cams():
        yield f"| {name} | {' | '.join(cells(name))} |"


def atlas() -> str:
    """Return the tables of the atlas."""
    speeds = ", ".join(f"{rpm:g}" for rpm in ATLAS_RPM)
    tables = (
        (f"Residual vibration in µm, peak to peak, the largest at {speeds} rpm:", vibrations),
        ("Jump speed in rpm, 0 if the velocity jumps:", jump_speeds),
        (f"Level in dB, then the largest excess over it at {speeds} rpm:", excess_levels),
    )
    return "\n".join(line for caption, cells in tables for line in lines(caption, cells)) + "\n"


if __name__ == "__main__":
    head, mark, _ = PAGE.read_text(encoding="utf-8").partition(START)
    PAGE.write_text(head + mark + atlas(), encoding="utf-8")
