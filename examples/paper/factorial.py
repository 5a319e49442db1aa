"""Factorial study of a question of the paper: continuity of a law, or its slopes.

In the first design, laws of several continuity classes have the same event angles, so that smoother
laws also have higher accelerations. In the second design their event angles give the same peak
acceleration, so that only the continuity differs. Each result y is split into its mean, the effects
of law and angle, and the remainder: y_ij = μ + α_i + β_j + γ_ij. Finally the cam that the paper
proposes is compared with the others: the part of its advantage that a rigid follower also has, and
the advantage if its event is compressed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import cam_rig
from cam_rig.acoustics import RadiationParameters
from cam_rig.dynamics import FollowerParameters, TwoMassParameters
from cam_rig.dynamics.vibration import residual_vibration, steady_turn
from cam_rig.laws.law import peak
from cam_rig.laws.segments import up_and_down
from cam_rig.show.looks import in_words
from cam_rig.simulation.simulate import Acoustics, simulate_steady_turns
from cam_rig.units import RPM, TURN, FloatArray, rms
from examples.paper.common import CAMS, RIG, STIFF_RIG, Table, load_laws, parser, publish, titles

#: Cam that the paper proposes.
PROPOSED = "bezier15"
#: Spans (°) into which its turn is compressed: 360 as in the paper, 297.5 as the other laws need
#: from the start of the rise to the end of the fall.
SPANS = (360.0, 330.0, 297.5, 270.0, 240.0)
#: Lift in m (table 1 of the paper).
LIFT = 0.05
#: Rises of continuity classes C1, C2, C2, C3 and C4.
RISES = ("simple_harmonic", "poly345", "cycloidal", "poly4567", "bezier9")
#: Event angles (°) around the 117.5° identified from table 2. Dwells share the rest of the turn.
EVENTS = (90.0, 105.0, 120.0, 135.0, 150.0, 165.0)
#: Law whose peak acceleration all laws have in the second design.
REFERENCE = "poly345"
#: Event angles (°) of this law. The law with the highest peak then needs at most 178°.
GENTLE = (90.0, 100.0, 110.0, 120.0, 130.0, 140.0)
#: Duration (s) of each run from rest, as for the jump speeds of table 2.
RUN = 1.7
#: Speeds (rpm) for the peak acceleration.
ACCELERATED = (200.0, 250.0, 300.0)
#: Speeds (rpm) for the residual vibration: the range of the paper, so that no resonance dominates.
RESIDUAL = tuple(np.arange(200.0, 401.0, 10.0).tolist())
#: Speeds (rpm) for the noise.
NOISE = tuple(np.arange(200.0, 401.0, 20.0).tolist())
#: Speed (rpm) for the noise in contact: the lowest of the paper.
NOISE_IN_CONTACT = 200.0
#: Lowest continuity class with a continuous acceleration.
SMOOTH = 2


@cache
def catalogue() -> pd.DataFrame:
    """Return the peaks and the continuity of the named rises."""
    return cam_rig.list_laws().to_pandas().set_index("law")


def as_gentle(rise: str, event: float) -> float:
    """Return the event angle of a rise with the peak acceleration of the reference.

    `event` is the event angle of the reference.
    """
    peaks = catalogue().peak_acceleration
    return event * math.sqrt(peaks[rise] / peaks[REFERENCE])


def squeezed(law: cam_rig.Law, span: float) -> cam_rig.Law:
    """Return the law of a cam compressed into `span` rad, followed by a dwell.

    A span of 360° returns the law itself.
    """
    if span >= TURN:
        return law
    dwell = np.full_like(law.ordinates[:, :1], law.ordinates[0, 0])
    breaks = np.append(law.breaks * (span / TURN), TURN)
    name = f"{law.name} in {math.degrees(span):.4g}°"
    return cam_rig.Law(name, breaks, np.hstack([law.ordinates, dwell]))


class Measures(NamedTuple):
    """Results of a law.

    Jump speeds (rpm) from rest are those of the elastic and of a rigid follower. `acceleration`
    (m/s²) is the geometric mean over the speeds of the largest |ẍ| in steady state, and
    `own_acceleration` that of the law. `residual` (m) is the r.m.s. over the speeds of the
    vibration in the low dwell. `noise` (dB) is the mean over the speeds for the rigid follower,
    including landings, and `noise_in_contact` (dB) the level at one speed for the elastic follower.
    """

    jump: float
    rigid_jump: float
    acceleration: float
    own_acceleration: float
    residual: float
    noise: float
    noise_in_contact: float


def measure(law: cam_rig.Law) -> Measures:
    """Compute all results of a law."""
    rig, stiff = cam_rig.load_rig(RIG), cam_rig.load_rig(STIFF_RIG)
    follower, speeds = FollowerParameters.from_rig(rig), RPM * np.array(ACCELERATED)
    peaks = [np.abs(steady_turn(law, follower, v).acceleration).max() for v in speeds.tolist()]
    own = abs(peak(law, 2).value) * np.square(speeds)
    noise = simulate_steady_turns(
        law, "one_mass", FollowerParameters.from_rig(stiff), RPM * np.array(NOISE)
    )
    contact = simulate_steady_turns(
        law, "two_mass", TwoMassParameters.from_rig(rig), [RPM * NOISE_IN_CONTACT]
    )
    rigid = rig.replace(roller_share=None, stem_damping=None)
    return Measures(
        jump=cam_rig.jump_speed(law, rig, duration=RUN).rpm,
        rigid_jump=cam_rig.jump_speed(law, rigid).rpm,
        acceleration=math.exp(float(np.mean(np.log(peaks)))),
        own_acceleration=math.exp(float(np.mean(np.log(own)))),
        residual=rms(residual_vibration(law, follower, RPM * np.array(RESIDUAL))),
        noise=float(Acoustics(RadiationParameters.from_rig(stiff)).levels(noise).mean()),
        noise_in_contact=float(Acoustics(RadiationParameters.from_rig(rig)).levels(contact)[0]),
    )


class Effect(NamedTuple):
    """Name, unit and factor to that unit of an analysed result.

    `decibels` is True if effects multiply, so that their 20 lg is analysed. `fastest` is the
    highest speed (rpm) at which the result assumes contact, or 0 if it includes loss of contact.
    """

    name: str
    unit: str
    factor: float = 1.0
    decibels: bool = True
    fastest: float = 0.0


EFFECTS = {
    "jump": Effect("jump speed", "rpm"),
    "acceleration": Effect("peak acceleration", "m/s²", fastest=max(ACCELERATED)),
    "residual": Effect("residual vibration", "µm", 1e6, fastest=max(RESIDUAL)),
    "noise": Effect("noise, rigid follower", "dB", decibels=False),
    "noise_in_contact": Effect("noise, elastic", "dB", 1.0, False, NOISE_IN_CONTACT),
}


class Shares(NamedTuple):
    """Shares of the sum of squares of a table, which is `total` (dB²).

    `classes` is the part of `law` between continuity classes. There is no test of significance,
    because a model has no random scatter.
    """

    law: float
    classes: float
    angle: float
    interaction: float
    total: float


def shares_of(values: FloatArray, classes: Sequence[int]) -> Shares:
    """Return the shares of a table `(a, b)` of laws and angles.

    `classes` are those of the laws.
    """
    left = values - values.mean()
    row, column, order = left.mean(axis=1), left.mean(axis=0), np.array(classes)
    between = sum((order == k).sum() * row[order == k].mean() ** 2 for k in set(classes))
    interaction = ((left - row[:, None] - column) ** 2).sum()
    laws, angles = column.size * (row @ row), row.size * (column @ column)
    total = float(laws + angles + interaction)
    parts = np.array([laws, column.size * between, angles, interaction]) / (total or 1.0)
    law, classed, angle, interaction = parts.tolist()
    return Shares(law, classed, angle, interaction, total)


@dataclass(frozen=True, eq=False)
class Design:
    """Table of laws (rows) against event angles in ° (columns)."""

    name: str
    rises: tuple[str, ...]
    angles: tuple[float, ...]
    cells: list[list[Measures]]

    @property
    def classes(self) -> list[int]:
        """Continuity class of each law at the joints with its dwells."""
        return [int(catalogue().continuity[rise]) for rise in self.rises]

    def values(self, key: str) -> FloatArray:
        """Return a result of all cells, `(a, b)`."""
        return np.array([[getattr(cell, key) for cell in row] for row in self.cells])

    def shares(self, key: str) -> Shares:
        """Return the shares of a result, in dB if its effects multiply."""
        values = EFFECTS[key].factor * self.values(key)
        return shares_of(20.0 * np.log10(values) if EFFECTS[key].decibels else values, self.classes)

    def lost(self, key: str) -> NDArray[np.bool_]:
        """Return flags `(a, b)` of the cells with loss of contact at the result's speeds."""
        return np.asarray(self.values("jump") < EFFECTS[key].fastest)

    def part(self, name: str, rows: Sequence[int], columns: Sequence[int]) -> Design | None:
        """Return the design of some laws and angles, or None for fewer than two of either."""
        if min(len(rows), len(columns)) < 2:
            return None
        cells = [[self.cells[i][j] for j in columns] for i in rows]
        rises = tuple(self.rises[i] for i in rows)
        return Design(f"{self.name}, {name}", rises, tuple(self.angles[j] for j in columns), cells)

    @property
    def smooth(self) -> Design | None:
        """Design of the laws of class C2 and above."""
        rows = [i for i, order in enumerate(self.classes) if order >= SMOOTH]
        return self.part(f"C{SMOOTH} and above", rows, range(len(self.angles)))

    def in_contact(self, key: str) -> Design | None:
        """Return the laws and angles whose cells all remain in contact.

        Laws and angles are removed in turn, those with most losses of contact first.
        """
        lost = self.lost(key)
        rows, columns = (list(range(n)) for n in lost.shape)
        while (part := lost[np.ix_(rows, columns)]).any():
            by_row, by_column = part.mean(axis=1), part.mean(axis=0)
            if by_row.max() >= by_column.max():
                del rows[int(np.argmax(by_row))]
            else:
                del columns[int(np.argmax(by_column))]
        return self.part("in contact", rows, columns)


class Study(NamedTuple):
    """Both designs, the cams of table 2 by name, and the proposed cam by span in °."""

    same_angles: Design
    same_acceleration: Design
    cams: dict[str, Measures]
    squeezed: dict[float, Measures]


def study(run: Callable[..., Iterator[Measures]] = map) -> Study:
    """Compute every cell of both designs, the cams, and the compressed proposed cam.

    `run` is `map`, or the `map` of an executor.
    """
    angles = {rise: np.radians(EVENTS).tolist() for rise in RISES}
    gentle = {rise: [as_gentle(rise, a) for a in np.radians(GENTLE)] for rise in RISES}
    laws = [
        up_and_down(r, a, LIFT) for design in (angles, gentle) for r in RISES for a in design[r]
    ]
    cams = load_laws((PROPOSED, *(cam for cam in CAMS if cam != PROPOSED)))
    compressed = [squeezed(cams[PROPOSED], math.radians(span)) for span in SPANS]
    measured = iter(run(measure, [*laws, *cams.values(), *compressed]))

    def table(name: str, levels: tuple[float, ...]) -> Design:
        return Design(name, RISES, levels, [[next(measured) for _ in levels] for _ in RISES])

    return Study(
        table("same angles", EVENTS),
        table("same acceleration", GENTLE),
        {cam: next(measured) for cam in cams},
        {span: next(measured) for span in SPANS},
    )


class Advantage(NamedTuple):
    """Advantage of the proposed cam over `cam` as factors, and of the noise in dB.

    Shares are those of logarithms: the part of the advantage that a rigid follower also has,
    because of the slopes of the law. The remainder is due to vibration.
    """

    cam: str
    jump: float
    jump_share: float
    acceleration: float
    acceleration_share: float
    residual: float
    noise: float


def advantages(result: Study) -> list[Advantage]:
    """Compare the proposed cam with each other cam."""
    best, rows = result.cams[PROPOSED], []
    for cam, other in result.cams.items():
        if cam != PROPOSED:
            jump, slopes = best.jump / other.jump, best.rigid_jump / other.rigid_jump
            less = best.acceleration / other.acceleration
            own = best.own_acceleration / other.own_acceleration
            shares = math.log(slopes) / math.log(jump), math.log(own) / math.log(less)
            ratios = other.residual / best.residual, best.noise - other.noise
            rows.append(Advantage(cam, jump, shares[0], less, shares[1], *ratios))
    return rows


def tables(result: Study) -> list[Table]:
    """Return tables of variance, jump speeds by law, advantages and compressed cam."""
    same, alike, names = result.same_angles, result.same_acceleration, titles(result.cams)
    wholes = [same, alike]
    designs = [part for whole in wholes for part in (whole, whole.smooth) if part is not None]
    means = [np.exp(np.log(design.values("jump")).mean(axis=1)).tolist() for design in wholes]
    return [
        *map(variance_table, designs),
        Table(
            "Jump speed by law, geometric mean over the angles",
            "law | continuity | same angles [rpm] :.0f | same acceleration [rpm] :.0f",
            [
                (in_words(rise), f"C{order}", *means_of_law)
                for rise, order, *means_of_law in zip(RISES, same.classes, *means, strict=True)
            ],
        ),
        Table(
            f"Advantage of {names[PROPOSED]}, and the part of it that comes from the slopes",
            "over | jump speed [%] :+.1f | of it from slopes [%] :.0f | "
            "peak acceleration [%] :+.1f | of that from slopes [%] :.0f | "
            "residual vibration, divided by :.1f | noise [dB] :+.1f",
            [
                (
                    names[row.cam],
                    100.0 * (row.jump - 1.0),
                    100.0 * row.jump_share,
                    100.0 * (row.acceleration - 1.0),
                    100.0 * row.acceleration_share,
                    row.residual,
                    row.noise,
                )
                for row in advantages(result)
            ],
            "From slopes: what a rigid follower has too, in logarithms; the rest is vibration. "
            "Above 100 %: at its own, higher jump speed the cam excites more vibration.",
        ),
        Table(
            f"{names[PROPOSED]} compressed, with a low dwell for the rest of the turn",
            "span [°] :.4g | jump speed [rpm] :.1f | rigid follower [rpm] :.1f | "
            "peak acceleration [m/s²] :.1f | residual vibration [µm] :.2f | noise [dB] :.1f",
            [
                (span, m.jump, m.rigid_jump, m.acceleration, 1e6 * m.residual, m.noise)
                for span, m in result.squeezed.items()
            ],
        ),
    ]


def variance_table(design: Design) -> Table:
    """Return the shares of each result, and of its part in contact if contact is lost."""
    rows: list[tuple[object, ...]] = []
    for key, effect in EFFECTS.items():
        lost = int(design.lost(key).sum())
        parts = [(effect.name, design, lost if effect.fastest else None)]
        if lost and (staying := design.in_contact(key)) is not None:
            parts.append(("… in contact", staying, 0))
        for name, part, count in parts:
            shares = part.shares(key)
            percent = (100.0 * share for share in shares[:4])
            rows.append((name, len(part.rises), len(part.angles), *percent, shares.total, count))
    return Table(
        f"Analysis of variance, {design.name}",
        "effect | laws :d | angles :d | law [%] :.1f | classes [%] :.1f | angle [%] :.1f | "
        "interaction [%] :.1f | sum of squares [dB²] :.1f | cells without contact :.0f",
        rows,
        "Shares of the sum of squares; classes: the part of the law between classes of "
        "continuity. Degrees of freedom: laws − 1, angles − 1, and their product.\n"
        "Cells without contact: contact is lost below the effect's fastest speed, where the model "
        "holds the follower on. The row below has the laws and angles that all keep contact.",
    )


def summary(result: Study) -> list[str]:
    """Return the shares of the slopes and of the continuity as text."""
    shares = sorted(row.jump_share for row in advantages(result) if row.jump > 1.0)
    residual = result.same_acceleration.shares("residual")
    lost = result.same_acceleration.lost("residual")
    return [
        f"{PROPOSED} jumps later than {len(shares)} of {len(result.cams) - 1} cams, "
        f"{shares[0]:.0%} to {shares[-1]:.0%} of that from the slopes",
        f"residual vibration at the same acceleration: classes of continuity {residual.classes:.0%}"
        f", law {residual.law:.0%}, angle {residual.angle:.0%} of the sum of squares; "
        f"{lost.sum()} of {lost.size} cells lose contact below its fastest speed",
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, which needs about 20 s on two cores."""
    from examples.paper import factorial_figure

    out = parser(__doc__).parse_args(argv).out
    with ProcessPoolExecutor() as pool:
        result = study(pool.map)
    publish(out, tables(result), {"factorial": factorial_figure.figure(result)}, summary(result))


if __name__ == "__main__":
    main()
