"""Timing of the events of the paper's Bézier curve of degree 15.

An event is the cam angle θ_p at which the lift passes a fraction p of its maximum h. A change of an
ordinate a_j with basis function B_j moves it by ∂θ_p/∂a_j = −h B_j(θ_p)/s'(θ_p), which is exact
(implicit differentiation). The curve is compared with a B-spline of the same lift and events, whose
ordinates have a local effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.interpolate import BSpline

import cam_rig
from cam_rig.show.figure import (
    ACROSS,
    CAM_ANGLE,
    empty,
    series,
    series_marker,
    styled,
    turn_axis,
    wrapped,
)
from cam_rig.units import TURN, FloatArray
from examples.paper.common import CAMS, Table, parser, publish

#: Cam whose timing is studied, and its events with the names of `cam_rig.law_summary`.
CAM = "bezier15"
EVENTS = {
    "up_1": "1 % up",
    "up_50": "50 % up",
    "up_99": "99 % up",
    "down_99": "99 % down",
    "down_50": "50 % down",
    "down_1": "1 % down",
}
#: Relative change of s, per change of an ordinate, above which an angle is in reach of the
#: ordinate.
REACHED = 1e-3
#: Degree of the B-spline.
DEGREE = 5
#: Number of pieces of the B-spline, of 15° each.
PIECES = 24
#: Cam angles (rad) at which reaches are sampled, every 0.005°, and at which curves are compared.
SAMPLES = (np.arange(72_000) + 0.5) * (TURN / 72_000)
COMPARED = np.linspace(0.0, TURN, 720)


def basis(degree: int, knots: FloatArray) -> BSpline:
    """Return all basis functions over the turn, in columns.

    `knots` are in rad, and those at both ends are repeated.
    """
    return BSpline(knots, np.eye(knots.size - degree - 1), degree)


@dataclass(frozen=True, eq=False)
class Curve:
    """Law over the whole turn, s = h Σ a_j B_j.

    `basis` gives B `(n, m)` at cam angles in rad. `ordinates` `(m,)` are relative to the lift.
    """

    cam: cam_rig.Cam
    basis: BSpline
    ordinates: FloatArray

    @cached_property
    def law(self) -> cam_rig.Law:
        """Law of the cam."""
        return cam_rig.build_law(self.cam)

    @cached_property
    def angles(self) -> FloatArray:
        """Cam angles (rad) of `EVENTS`."""
        heights = cam_rig.law_summary(self.cam).to_pandas("heights")
        return np.asarray(heights[list(EVENTS)].iloc[0], dtype=float)

    @cached_property
    def shifts(self) -> FloatArray:
        """Derivatives ∂θ_p/∂a_j, `(6, m)` in rad per change of an ordinate by the lift."""
        slope = self.law(self.angles, 1)[:, None]
        return np.asarray(-self.cam.lift.si * self.basis(self.angles) / slope)

    @property
    def free(self) -> FloatArray:
        """Mask `(m,)` of the free ordinates.

        The equal ordinates at both ends are not free, because the ends are at rest.
        """
        moved = np.flatnonzero(self.ordinates != self.ordinates[0])
        index = np.arange(self.ordinates.size)
        return np.asarray((index >= moved[0]) & (index <= moved[-1]))

    def reach(self, change: FloatArray, above: float) -> FloatArray:
        """Return the part of the turn (°) with |Σ c_j B_j| > `above`.

        Each column c of `change` gives a value.
        """
        return np.asarray(360.0 * (np.abs(self.basis(SAMPLES) @ change) > above).mean(axis=0))

    @cached_property
    def reaches(self) -> FloatArray:
        """Reach (°) of each ordinate, `(m,)`."""
        return self.reach(np.eye(self.ordinates.size), REACHED)

    @cached_property
    def alone(self) -> list[tuple[float, float]]:
        """Smallest changes that move a single event by 1°, to first order, for each event.

        They are the changes of the free ordinates with the smallest sum of squares. Each pair is
        the largest ordinate (relative to the lift), and the part of the turn (°) in which s changes
        by `REACHED` of its largest change.
        """
        changes = np.zeros((self.ordinates.size, len(EVENTS)))
        changes[self.free] = np.radians(1.0) * np.linalg.pinv(self.shifts[:, self.free])
        moved = np.abs(self.basis(np.linspace(0.0, TURN, 360)) @ changes).max(axis=0)
        reach = [
            self.reach(c, REACHED * most).item() for c, most in zip(changes.T, moved, strict=True)
        ]
        return list(zip(np.abs(changes).max(axis=0).tolist(), reach, strict=True))


def bezier() -> Curve:
    """Return the curve of the paper as a B-spline with a single piece."""
    cam = cam_rig.load_cam(CAM)
    values = np.array(cam.segments[0].ordinates.numbers)  # type: ignore[union-attr]
    knots = np.repeat([0.0, TURN], values.size)
    return Curve(cam, basis(values.size - 1, knots), values)


def spline_with_same_events(curve: Curve) -> Curve:
    """Return the closest B-spline with equal lift and events, and ends at rest.

    Its ordinates are those of least squares under these conditions (Lagrange multipliers).
    """
    lift, law = curve.cam.lift.si, curve.law
    inner = np.concatenate(
        [np.zeros(DEGREE - 1), np.arange(PIECES + 1.0), np.full(DEGREE - 1, PIECES)]
    )
    functions = basis(DEGREE, np.concatenate([inner[:1], inner, inner[-1:]]) * (TURN / PIECES))
    size = functions.c.shape[0]
    held = int(np.flatnonzero(curve.free)[0])  # equal ordinates at either end
    at_ends = np.eye(size)[np.r_[:held, size - held : size]]
    extremes = cam_rig.law_summary(curve.cam).to_pandas("extremes").set_index("quantity")
    top = extremes.loc["lift", "largest_at"]
    tops = np.array([top, TURN - top])  # the curve is symmetric
    conditions = [at_ends, functions(curve.angles), functions(tops), functions(tops, 1)]
    matrix = np.concatenate(conditions)
    values = np.concatenate(
        [np.zeros(2 * held), law(curve.angles) / lift, law(tops) / lift, [0, 0]]
    )
    rows, count = functions(COMPARED), matrix.shape[0]
    system = np.block([[rows.T @ rows, matrix.T], [matrix, np.zeros((count, count))]])
    right = np.concatenate([rows.T @ (law(COMPARED) / lift), values])
    ordinates = np.linalg.solve(system, right)[:size]
    ordinates[np.r_[:held, size - held : size]] = 0.0  # rounding is removed
    segment = {"law": "b_spline", "span": "360 deg", "degree": DEGREE}
    segment |= {"knots": inner.tolist(), "ordinates": ordinates.tolist()}
    title = f"B-spline with the events of {curve.cam.title}"
    cam = curve.cam.replace(name=f"{CAM}_b_spline", title=title, segments=[segment])
    return Curve(cam, functions, ordinates)


def study() -> tuple[Curve, Curve]:
    """Return the curve of the paper and the B-spline."""
    curve = bezier()
    return curve, spline_with_same_events(curve)


def events_table(cams: Sequence[str] = CAMS) -> Table:
    """Return a table of the cam angles of the events of shipped cams."""
    heights = cam_rig.law_summary(list(cams)).to_pandas("heights").set_index("cam")
    angles = np.degrees(heights[list(EVENTS)])
    return Table(
        "Cam angles at which the lift is passed",
        "cam | " + " | ".join(f"{name} [°] :.3f" for name in EVENTS.values()),
        [(cam_rig.load_cam(cam).title, *row) for cam, *row in angles.itertuples()],
        "Heights over the lowest place, in parts of the lift of the cam's file.",
    )


def ordinates_table(curve: Curve) -> Table:
    """Return a table of the reach of each ordinate, and of its shifts of the events.

    Cells of events beyond its reach are empty.
    """
    reached = curve.basis(curve.angles) > REACHED
    shifts = np.where(reached, 0.01 * np.degrees(curve.shifts), np.nan).T
    return Table(
        f"{curve.cam.title}: what each ordinate moves",
        "ordinate | value :.4g | free | reach [°] :.1f | "
        + " | ".join(f"{name} [°] :.4f" for name in EVENTS.values()),
        [
            (
                str(j),
                curve.ordinates[j].item(),
                "yes" if curve.free[j] else "held",
                curve.reaches[j].item(),
                *(None if np.isnan(shift) else shift for shift in row),
            )
            for j, row in enumerate(shifts.tolist())
        ],
        "Shift of each event for a change of the ordinate by 1 % of the lift (exact derivative).\n"
        f"Reach: where s changes by more than {REACHED:g} of the ordinate's change. Empty: beyond.",
    )


def control_table(curves: Sequence[Curve]) -> Table:
    """Return a table of the control of events of the rise by the free ordinates."""
    alone = (
        f"{name} alone, ordinate [%/°] :.2f | {name} alone, s changes over [°] :.0f"
        for name in ("1 %", "50 %", "99 %")
    )
    return Table(
        "Control of the events, rising side",
        "law | free ordinates :d | reach of one [°] :.0f | to [°] :.0f | "
        "events in reach of one :.1f | " + " | ".join(alone),
        [
            (
                curve.cam.title,
                int(curve.free.sum()),
                curve.reaches[curve.free].min().item(),
                curve.reaches[curve.free].max().item(),
                events_in_reach(curve),
                *(x for ordinate, reach in curve.alone[:3] for x in (100.0 * ordinate, reach)),
            )
            for curve in curves
        ],
        "Alone: that event moves by 1° (first order), the others stay. Of all such changes the one "
        "of least sum of squares is taken; its largest ordinate is shown, in parts of the lift.",
    )


def events_in_reach(curve: Curve) -> float:
    """Return the mean number of events that a free ordinate moves."""
    return float((curve.basis(curve.angles) > REACHED)[:, curve.free].sum(axis=0).mean())


@styled
def figure(curves: Sequence[Curve]) -> Figure:
    """Draw the basis functions of each curve, and the shifts of events of the rise."""
    free, held = {"color": series(0)["color"], "lw": 1.1}, {"color": "0.75", "lw": 1.1}
    event = {"color": "0.3", "ls": ":", "lw": 1.0}
    out = empty(4.8)
    panels = out.subplots(2, len(curves), sharex=True, sharey="row", squeeze=False)
    for (upper, lower), curve in zip(panels.T, curves, strict=True):
        for j, values in enumerate(curve.basis(COMPARED).T):
            upper.plot(np.degrees(COMPARED), values, **(free if curve.free[j] else held))
        for angle in curve.angles:
            upper.axvline(np.degrees(angle), **event)
        upper.set_title(wrapped(curve.cam.title, ACROSS // len(curves)))
        knots, degree = curve.basis.t, curve.basis.k
        control = [knots[j + 1 : j + degree + 1].mean() for j in np.flatnonzero(curve.free)]
        for i, name in enumerate(("1 %", "50 %", "99 %")):
            shifts = 0.01 * np.degrees(curve.shifts[i, curve.free])
            style = {"lw": 1.0, "ms": 4.0, "ls": "-"} | series_marker(i)
            lower.plot(np.degrees(control), shifts, label=name, **style)
        lower.axhline(0.0, color="0.3", lw=0.8)
        lower.set_xlabel(f"{CAM_ANGLE} of the control point")
        turn_axis(lower)
    panels[0, 0].set_ylabel("change of s /\nchange of the ordinate [1]")
    panels[1, 0].set_ylabel("shift of the event\n[° per 1 % of the lift]")
    panels[1, 0].legend(title="passes, rising")
    names = {"free ordinate": free, "held by a joint": held, "event": event}
    handles = [Line2D([], [], label=name, **style) for name, style in names.items()]
    out.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return out


def summary(curves: Sequence[Curve]) -> list[str]:
    """Return the change that moves the 1 % event alone by one degree, as text."""
    return [
        f"{curve.cam.title}: the 1 % event alone by 1° takes ordinates changed by "
        f"{100.0 * curve.alone[0][0]:.1f} % of the lift, over {curve.alone[0][1]:.0f}° of the turn"
        for curve in curves
    ]


def main(argv: Sequence[str] | None = None) -> None:
    """Run the experiment, print its tables and write its figure."""
    out = parser(__doc__).parse_args(argv).out
    result = study()
    tables = [events_table(), ordinates_table(result[0]), control_table(result)]
    publish(out, tables, {"timing": figure(result)}, summary(result))


if __name__ == "__main__":
    main()
