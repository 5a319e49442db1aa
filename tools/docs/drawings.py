"""Draw the figures of the theory pages: a cam with forces, models, laws, packages.

    .venv/bin/python tools/docs/drawings.py

Cam and laws are those of cam_rig. The files in docs/ are written again, with the same content every
time.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable, Iterable
from functools import partial
from graphlib import TopologicalSorter
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cam_rig.laws import build_law
from cam_rig.laws.bernstein import derivative, evaluate
from cam_rig.laws.segments import unit_rise
from cam_rig.profile import contours_at
from cam_rig.schema.load import config_root, load_cam
from cam_rig.show.figure import colour, line

DOCS = Path(__file__).parents[2] / "docs"
#: Cam of the drawing.
CAM = "poly345"
#: Angle of the cam (deg), in the rise with a large inclination.
ANGLE_DEG = 75.0
#: Colour of bodies.
STEEL = "#d5dbe1"
#: Colour of outlines.
INK = "#222222"
#: Colour of forces.
FORCE = "#D55E00"
#: Colour of lengths.
SIZE = "#0072B2"
PACKAGE = DOCS.parent / "cam_rig"
MIDDLE: dict[str, Any] = {"ha": "center", "va": "center"}
#: Labels of the sketch by file, in the order of the parameters of `sketch`.
SKETCHES = {
    "cam_sketch.svg": (
        "follower", "lift $s$", "base circle", "cam", "cam angle $θ$", "start of the\nturn, $θ = 0$"
    ),
    "course/es/cam_sketch.svg": (
        "palpador", "desplazamiento $s$", "circunferencia\nbase", "leva", "ángulo $θ$",
        "inicio de la\nvuelta, $θ = 0$",
    ),
}  # fmt: skip
SHOWN = ("constant_velocity", "simple_harmonic", "cycloidal", "poly345", "poly4567", "bezier9")


def cam_and_forces(path: Path) -> None:
    """Draw a turned cam with its follower, lengths in blue and forces in red."""
    config = load_cam(config_root() / "cams" / f"{CAM}.yaml")
    law = build_law(config)
    theta = np.radians(ANGLE_DEG)
    base, roller = config.follower.base_radius.si, config.follower.roller
    (outline,) = contours_at(config.follower, law, np.linspace(0.0, 2 * np.pi, 721))
    (touch,) = contours_at(config.follower, law, np.array([theta]))
    turned = (outline.points[0] + 1j * outline.points[1]) * np.exp(1j * theta)
    contact = complex(*touch.points[:, 0]) * np.exp(1j * theta)
    normal = complex(*touch.normal[:, 0]) * np.exp(1j * theta)
    centre = 1j * (base + roller + float(law(theta)))

    figure, axes = plt.subplots(figsize=(6.4, 7.2), layout="constrained")
    axes.fill(turned.real, turned.imag, fc=STEEL, ec=INK, lw=1.6)
    circle(axes, 0j, base, ls=(0, (5, 3)), ec=SIZE)
    circle(axes, 0j, 0.009, fc="white", ec=INK)
    circle(axes, centre, roller, fc="white", ec=INK, lw=1.6)
    circle(axes, centre, 0.0012, fc=INK)
    top = centre.imag + 0.075
    axes.plot([0, 0], [centre.imag + roller, top], color=INK, lw=5, solid_capstyle="butt")
    for side in (-1, 1):
        x = side * np.array([0.006, 0.016, 0.016, 0.006])
        y = top - np.array([0.045, 0.045, 0.028, 0.028])
        axes.fill(x, y, fc="0.55", ec=INK)
    axes.plot([-0.022, 0.022], [top, top], color=INK, lw=3)
    spring(axes, 0.0, top, top + 0.045)
    axes.plot([-0.03, 0.03], [top + 0.045] * 2, color=INK, lw=3)
    lengths(axes, base, roller, centre, contact, normal)
    forces(axes, contact, normal, centre, top)
    name_parts(axes, base, top)
    axes.set(xlim=(-0.125, 0.145), ylim=(-0.115, top + 0.06), aspect="equal")
    axes.axis("off")
    save(figure, path)


def lengths(
    axes: Axes, base: float, roller: float, centre: complex, contact: complex, normal: complex
) -> None:
    """Draw angle θ, speed ω, base radius, lift s and pressure angle."""
    x = -0.104
    arrow(axes, x + 1j * (base + roller), x + 1j * centre.imag, SIZE, "<->")
    for height in (base + roller, centre.imag):
        axes.plot([x - 0.004, 0.0], [height] * 2, color=SIZE, lw=0.7)
    note(axes, x - 0.009 + 1j * (0.5 * (base + roller + centre.imag)), "$s(θ)$", SIZE)
    along = np.exp(1j * np.radians(215))
    arrow(axes, 0j, base * along, SIZE, "->")
    note(axes, 0.6 * base * along + 0.012j, "$R_b$", SIZE)
    arc = 0.032 * np.exp(1j * np.linspace(np.radians(-70), np.radians(60), 60))
    axes.plot(arc.real, arc.imag, color=SIZE, lw=1.4)
    arrow(axes, complex(arc[-3]), complex(arc[-1]), SIZE, "->")
    note(axes, 0.048 + 0.0j, "$θ,\\ ω$", SIZE)
    reach = contact + 0.085 * normal
    axes.plot([contact.real, reach.real], [contact.imag, reach.imag], color=SIZE, lw=0.8, ls="--")
    bow = centre + 0.05 * np.exp(1j * np.linspace(np.angle(normal), np.pi / 2, 30))
    axes.plot(bow.real, bow.imag, color=SIZE, lw=1.0)
    middle = centre + 0.058 * np.exp(0.5j * (np.angle(normal) + np.pi / 2))
    note(axes, complex(middle), "$α$", SIZE)
    note(axes, centre + 0.019 + 0.006j, "$R_r$", SIZE)


def forces(axes: Axes, contact: complex, normal: complex, centre: complex, top: float) -> None:
    """Draw the forces on the follower."""
    arrow(axes, contact - 0.045 * normal, contact, FORCE, "-|>", 2.2)
    note(axes, contact - 0.05 * normal + 0.012, "$F/\\cos α$", FORCE)
    for x, name in ((0.035, "$k\\,s + F_0$"), (0.075, "$c\\,\\dot s$"), (0.105, "$m\\,\\ddot s$")):
        arrow(axes, x + 1j * (top + 0.012), x + 1j * (top - 0.028), FORCE, "-|>", 1.8)
        note(axes, x + 1j * (top + 0.02), name, FORCE)


def name_parts(axes: Axes, base: float, top: float) -> None:
    """Draw the names of the parts of cam and follower."""
    note(axes, -0.052 + 1j * (top + 0.022), "return spring $k$\npreload $F_0$", INK)
    note(axes, -0.04 + 1j * (top - 0.036), "guide", INK)
    note(axes, 0.03 - 0.02j - 0.02j, "cam", INK)
    note(axes, base * 0.72 - 1j * base * 0.98, "base circle", SIZE)


def sketch(path: Path, names: tuple[str, ...]) -> None:
    """Draw a turned cam with its follower, and the names of parts and lengths."""
    config = load_cam(config_root() / "cams" / f"{CAM}.yaml")
    law = build_law(config)
    theta = np.radians(ANGLE_DEG)
    base, roller = config.follower.base_radius.si, config.follower.roller
    (outline,) = contours_at(config.follower, law, np.linspace(0.0, 2 * np.pi, 721))
    turned = (outline.points[0] + 1j * outline.points[1]) * np.exp(1j * theta)
    low, centre = 1j * (base + roller), 1j * (base + roller + float(law(theta)))
    start = 1j * np.exp(1j * theta)  # direction of the zero mark of the cam

    figure, axes = plt.subplots(figsize=(5.6, 5.6), layout="constrained")
    axes.fill(turned.real, turned.imag, fc=STEEL, ec=INK, lw=1.6)
    circle(axes, 0j, base, ls=(0, (5, 3)), ec=SIZE, lw=1.4)
    circle(axes, 0j, 0.006, fc="white", ec=INK)
    axes.plot([0, 0], [centre.imag + roller, centre.imag + 0.06], color=INK, lw=7)
    circle(axes, centre, roller, fc="white", ec=INK, lw=1.6)
    circle(axes, low, roller, ec="0.6", ls=(0, (2, 2)))
    side = -0.05
    for height in (low.imag, centre.imag):
        axes.plot([side - 0.006, 0.0], [height] * 2, color=SIZE, lw=0.8)
    arrow(axes, side + low, side + centre, SIZE, "<->", 1.6)
    for end in (base * start, 1j * base):
        axes.plot([0, end.real], [0, end.imag], color=SIZE, lw=0.9)
    arc = 0.5 * base * 1j * np.exp(1j * np.linspace(0.0, theta, 60))
    axes.plot(arc.real, arc.imag, color=SIZE, lw=1.4)
    arrow(axes, complex(arc[-4]), complex(arc[-1]), SIZE, "->", 1.4)
    places = (
        centre + 0.036 + 0.045j, 0.5 * (low + centre) + side - 0.046, 0.068 - 0.067j,
        0.03 - 0.025j, 0.68 * base * 1j * np.exp(0.45j * theta), 1.4 * base * start,
    )  # fmt: skip
    for place, name, tint in zip(places, names, (INK, SIZE, SIZE, INK, SIZE, SIZE), strict=True):
        note(axes, complex(place), name, tint)
    axes.set(xlim=(-0.14, 0.14), ylim=(-0.125, centre.imag + 0.07), aspect="equal")
    axes.axis("off")
    save(figure, path)


def models(path: Path) -> None:
    """Draw the models of lumped masses side by side."""
    figure, axes = plt.subplots(1, 4, figsize=(10.0, 3.9), layout="constrained")
    draw = (one_mass, elastic_stem, two_masses, shaft)
    names = ("kinetostatic, one_mass", "elastic_stem (eq. 5)", "two_mass (eq. 14-19)",
             "torsional (eq. 10)")  # fmt: skip
    for part, how, name in zip(axes, draw, names, strict=True):
        how(part)
        part.set_title(name, fontsize=10, family="monospace")
        part.set(xlim=(-1.3, 1.7), ylim=(-0.8, 5.2), aspect="equal")
        part.axis("off")
    save(figure, path)


def one_mass(axes: Axes) -> None:
    """Draw a rigid follower below its spring and damper."""
    cam_below(axes)
    mass(axes, 1.6, "m")
    to_ground(axes, 2.6, "k", "c")


def elastic_stem(axes: Axes) -> None:
    """Draw a mass on an elastic stem that the cam moves."""
    cam_below(axes)
    axes.plot([-0.8, 0.8], [0.57] * 2, color=INK, lw=2)
    spring(axes, 0.0, 0.57, 2.0, 0.22)
    note(axes, 0.75 + 1.4j, "stem", INK)
    mass(axes, 2.0, "m", "x")
    to_ground(axes, 3.0, "k", "c")


def two_masses(axes: Axes) -> None:
    """Draw a roller mass that can leave the cam, the stem and the end mass."""
    cam_below(axes)
    mass(axes, 0.75, "m₁", "z", 0.7)
    spring(axes, -0.4, 1.45, 2.6, 0.2)
    dashpot(axes, 0.4, 1.45, 2.6)
    note(axes, -0.95 + 2.0j, "k₁", INK)
    note(axes, 0.95 + 2.0j, "c₁", INK)
    mass(axes, 2.6, "m₂", "y", 0.8)
    to_ground(axes, 3.4, "k₂", "c₂")


def shaft(axes: Axes) -> None:
    """Draw flywheel, elastic shaft and cam."""
    for y, name in ((0.6, "flywheel, $θ_v = ω t$"), (3.6, "cam, $θ = ω t + φ$")):
        axes.fill([-0.9, 0.9, 0.9, -0.9], [y, y, y + 0.7, y + 0.7], fc=STEEL, ec=INK)
        note(axes, 0.35 + 1j * (y + (1.15 if y > 1 else -0.4)), name, INK)
    spring(axes, -0.4, 1.3, 3.6, 0.2)
    dashpot(axes, 0.4, 1.3, 3.6)
    note(axes, -0.95 + 2.5j, "$k_s$", INK)
    note(axes, 0.95 + 2.5j, "$c_s$", INK)
    arrow(axes, 1.25 + 3.5j, 1.25 + 4.4j, FORCE, "-|>", 1.8)
    note(axes, 1.3 + 3.1j, "$F\\,s'$", FORCE)


def cam_below(axes: Axes) -> None:
    """Draw the surface of the cam, which moves by s."""
    x = np.linspace(-1.0, 1.0, 60)
    y = 0.55 - 0.3 * x**2
    axes.fill([*x, 1.0, -1.0], [*y, -0.5, -0.5], fc=STEEL, ec=INK)
    arrow(axes, 1.35 + 0j, 1.35 + 0.8j, SIZE, "->")
    note(axes, 1.55 + 0.3j, "s", SIZE)


def mass(axes: Axes, y: float, name: str, moves: str = "", height: float = 1.0) -> None:
    """Draw a block at a height. A block that rests on the cam has a foot."""
    if not moves or moves == "z":
        axes.plot([0, 0], [0.55, y], color=INK, lw=4)
    axes.fill([-0.8, 0.8, 0.8, -0.8], [y, y, y + height, y + height], fc="white", ec=INK, lw=1.6)
    note(axes, 0j + 1j * (y + 0.5 * height), name, INK)
    if moves:
        arrow(axes, 1.2 + 1j * y, 1.2 + 1j * (y + 0.8), SIZE, "->")
        note(axes, 1.45 + 1j * (y + 0.4), moves, SIZE)


def to_ground(axes: Axes, y: float, stiffness: str, damping: str) -> None:
    """Draw spring and damper from a block to the fixed ground above."""
    spring(axes, -0.4, y, y + 1.4, 0.2)
    dashpot(axes, 0.4, y, y + 1.4)
    axes.plot([-1.0, 1.0], [y + 1.4] * 2, color=INK, lw=3)
    note(axes, -0.95 + 1j * (y + 0.7), stiffness, INK)
    note(axes, 0.95 + 1j * (y + 0.7), damping, INK)


def laws(path: Path) -> None:
    """Draw rises of unit lift over a unit span, with three derivatives."""
    figure, panels = plt.subplots(1, 4, figsize=(11.0, 3.3), layout="constrained")
    for name in SHOWN:
        style = {"color": colour(name), "ls": line(name)["ls"]}
        breaks, pieces = unit_rise(name)
        for begin, end, ordinates in zip(breaks, breaks[1:], pieces, strict=False):
            u = np.linspace(0.0, 1.0, 200)
            values, span = np.asarray(ordinates, dtype=float), end - begin
            for order, axes in enumerate(panels):
                curve = evaluate(values, u)
                label = name if order == 0 and begin == breaks[0] else None
                axes.plot(begin + span * u, curve, lw=1.4, label=label, **style)
                values = derivative(values) / span
    for axes, name in zip(panels, ("lift s", "velocity s′", "acceleration s″", "jerk s‴"),
                          strict=True):  # fmt: skip
        axes.set_title(name, fontsize=10)
        axes.set_xlabel("u")
        axes.grid(lw=0.3)
    figure.legend(loc="outside lower center", ncols=len(SHOWN), fontsize=9, frameon=False)
    save(figure, path)


def rooms(path: Path) -> None:
    """Draw the subpackages of cam_rig in layers, with purposes and direct imports.

    The layers are those of the import contract in pyproject.toml. An import that follows from other
    imports is not drawn.
    """
    floors = floors_of_rooms()
    figure, axes = plt.subplots(figsize=(9.6, 0.92 * len(floors)), layout="constrained")
    positions: dict[str, complex] = {}
    for row, floor in enumerate(reversed(floors)):
        for column, room in enumerate(floor):
            x = 4.0 * (column - 0.5 * (len(floor) - 1))
            positions[room] = complex(x, row)
            box = mpl.patches.FancyBboxPatch(
                (x - 1.85, row - 0.3), 3.7, 0.6, "round,pad=0,rounding_size=0.08",
                fc=STEEL if room == "studies" else "white", ec=INK, lw=1.0, zorder=2,
            )  # fmt: skip
            axes.add_patch(box)
            axes.text(x, row + 0.17, room, weight="bold", **MIDDLE)
            axes.text(
                positions[room].real, row - 0.1, fill(purpose_of(room), 50), fontsize=7, **MIDDLE
            )
    for room, needed in direct_needs(positions).items():
        for other in sorted(needed):
            start, end = positions[room] - 0.3j, positions[other] + 0.3j
            axes.annotate(
                "", (end.real, end.imag), (start.real, start.imag), zorder=1,
                arrowprops={"arrowstyle": "-|>", "color": "0.6", "lw": 0.8, "shrinkB": 1},
            )  # fmt: skip
    axes.set(xlim=(-6.1, 6.1), ylim=(-0.45, len(floors) - 0.55))
    axes.axis("off")
    save(figure, path)


def floors_of_rooms() -> list[list[str]]:
    """Return the subpackages of each layer from the top, without shared modules."""
    contracts = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    layers = contracts["tool"]["importlinter"]["contracts"][0]["layers"]
    floors = [
        [name for name in layer.split(" | ") if (PACKAGE / name).is_dir()] for layer in layers
    ]
    return [floor for floor in floors if floor]


def purpose_of(room: str) -> str:
    """Return the first line of the docstring of a subpackage."""
    text = ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text("utf-8"))) or ""
    return text.splitlines()[0].rstrip(".").replace("`", "")


def direct_needs(rooms: Iterable[str]) -> dict[str, set[str]]:
    """Return the imports of each subpackage that do not follow from other imports."""
    needs: dict[str, set[str]] = {}
    for room in rooms:
        trees = (ast.parse(file.read_text("utf-8")) for file in (PACKAGE / room).rglob("*.py"))
        froms = (n for tree in trees for n in ast.walk(tree) if isinstance(n, ast.ImportFrom))
        named = {(node.module or "").split(".")[1:2][0] for node in froms if is_own(node)}
        needs[room] = (named & set(rooms)) - {room}
    reached: dict[str, set[str]] = {}
    for room in TopologicalSorter(needs).static_order():
        reached[room] = needs[room].union(*(reached[other] for other in needs[room]))
    return {
        room: {name for name in names if not any(name in reached[other] for other in names)}
        for room, names in needs.items()
    }


def is_own(node: ast.ImportFrom) -> bool:
    """Return True if a module is imported from cam_rig."""
    return (node.module or "").startswith("cam_rig.")


def circle(axes: Axes, centre: complex, radius: float, **style: object) -> None:
    """Draw a circle, unfilled if no face colour is given."""
    look = {"fc": "none", "ec": "none", "lw": 1.0} | style
    axes.add_patch(mpl.patches.Circle((centre.real, centre.imag), radius, **look))


def spring(axes: Axes, x: float, low: float, high: float, width: float = 0.008) -> None:
    """Draw a zigzag line from one height to another."""
    y = np.linspace(low, high, 14)
    axes.plot(x + width * np.array([0, 0, *([1, -1] * 5), 0, 0]), y, color=INK, lw=1.4)


def dashpot(axes: Axes, x: float, low: float, high: float) -> None:
    """Draw a piston in a cup."""
    middle, width = 0.5 * (low + high), 0.2
    axes.plot([x, x], [low, middle - 0.2], color=INK, lw=1.4)
    cup = [middle + 0.2, middle - 0.2, middle - 0.2, middle + 0.2]
    axes.plot([x - width, x - width, x + width, x + width], cup, color=INK, lw=1.4)
    axes.plot([x - 0.7 * width, x + 0.7 * width], [middle] * 2, color=INK, lw=1.4)
    axes.plot([x, x], [middle, high], color=INK, lw=1.4)


def arrow(
    axes: Axes, start: complex, end: complex, colour: str, head: str, width: float = 1.3
) -> None:
    """Draw an arrow between two points."""
    look = {"arrowstyle": head, "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", (end.real, end.imag), (start.real, start.imag), arrowprops=look)


def note(axes: Axes, position: complex, text: str, colour: str) -> None:
    """Draw text at a point."""
    axes.text(
        position.real, position.imag, text, color=colour, ha="center", va="center", fontsize=10
    )


def save(figure: Figure, path: Path) -> None:
    """Write an SVG without a date, so that it is reproducible."""
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


DRAWINGS: dict[str, Callable[[Path], None]] = {
    "cam_and_forces.svg": cam_and_forces,
    **{file: partial(sketch, names=names) for file, names in SKETCHES.items()},
    "models.svg": models,
    "laws.svg": laws,
    "rooms.svg": rooms,
}

if __name__ == "__main__":
    mpl.rcParams["svg.hashsalt"] = "cam_rig"
    for file, draw in DRAWINGS.items():
        draw(DOCS / file)
