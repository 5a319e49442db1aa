"""Contours of cams from files of other programs: their placement, and tables of points.

A placement converts the coordinates of a file to the frame of the cam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cam_rig.errors import ProfileError
from cam_rig.files import MIB, shorten
from cam_rig.schema.headings import Heading
from cam_rig.schema.instrument_table import CellTable, plain_number, read_lines
from cam_rig.schema.quantity import UNITS
from cam_rig.units import TURN, FloatArray

#: Largest accepted size (bytes) of a contour file. It is sufficient for 80 000 points in the format
#: of `drawing_files.write_contour`.
MAX_BYTES = 8 * MIB
#: Largest accepted coordinate of a contour relative to the cam's axis, m. It is far above that of
#: any cam.
MAX_SIZE = 10.0
#: Smallest accepted value of the largest coordinate of a contour, m. A smaller contour is probably
#: in another unit.
MIN_SIZE = 1e-5
#: Largest accepted range of the angles in a table of polar coordinates, rad: one turn plus its
#: rounding error.
MAX_TURN = TURN * (1.0 + 1e-6)
#: Largest difference of the coordinate z (m) with which a contour counts as plane. It is above the
#: rounding of the files of other programs.
MAX_HEIGHT = 1e-6


@dataclass(frozen=True)
class Placement:
    """Position of the coordinates of a contour file in the frame of the cam.

    In this frame the axis of the cam is the origin, and the follower of cam angle 0 is on +y.

    Parameters
    ----------
    unit
        Unit of a file without a unit: a key of `UNITS["length"]`, None if it is unknown.
    axis
        Position of the cam's axis in the file, in m.
    zero
        Direction of the follower at cam angle 0, in rad from +x counter-clockwise.
    is_mirrored
        True if the file shows the cam from the other side.
    """

    unit: str | None = None
    axis: tuple[float, float] = (0.0, 0.0)
    zero: float = 0.25 * TURN
    is_mirrored: bool = False

    def note(self) -> str:
        """Return a text on the position of the contour in its file: axis and cam angle 0."""
        x, y = (1e3 * coordinate for coordinate in self.axis)
        mirrored = ", seen from the other side" if self.is_mirrored else ""
        return (
            f"axis of the cam at ({x:g}, {y:g}) mm of the file, cam angle 0 at "
            f"{math.degrees(self.zero):g} deg from +x counter-clockwise{mirrored}"
        )

    def place(self, points: FloatArray) -> FloatArray:
        """Convert points `(2, n)` (m) from the frame of a file to the frame of the cam."""
        x, y = points - np.array(self.axis)[:, None]
        turned = (x + 1j * y) * np.exp(1j * (0.25 * TURN - self.zero))
        if self.is_mirrored:
            turned = -turned.conj()
        return np.array([turned.real, turned.imag])

    def in_file(self, points: FloatArray) -> FloatArray:
        """Convert points `(2, n)` (m) from the frame of the cam to the frame of the file."""
        z = points[0] + 1j * points[1]
        turned = -z.conj() if self.is_mirrored else z
        x, y = self.axis
        placed = turned * np.exp(1j * (self.zero - 0.25 * TURN)) + complex(x, y)
        return np.array([placed.real, placed.imag])


#: Placement that leaves the coordinates of a contour file unchanged.
UNPLACED = Placement()


@dataclass(frozen=True)
class ContourFile:
    """Contours that were read from a file, and notes on how it was read."""

    curves: list[FloatArray]  #: contours in the frame of the cam, points `(2, n)` in m each
    #: True if the points are those of a table, between which the contour is unknown. False if they
    #: follow the curves of a drawing.
    are_points: bool
    notes: list[str] = field(default_factory=list)  #: assumptions and corrections, as texts


def encloses_axis(points: FloatArray) -> bool:
    """Return True if a closed contour `(2, n)` turns around the axis of the cam.

    The contour is in the frame of the cam.
    """
    z = points[0] + 1j * points[1]
    turned = np.sum(np.angle(np.roll(z, -1) * z.conj()))
    return bool(abs(turned) > 0.5 * TURN)


def require_size(path: Path, curve: FloatArray) -> None:
    """Raise `ProfileError` if a contour does not have the size of a cam.

    The limits are `MIN_SIZE` and `MAX_SIZE`. `curve` are points in m. A contour with coordinates
    that are not finite is rejected too. `path` is the file in the message.
    """
    size = float(np.abs(curve).max(initial=0.0)) if np.isfinite(curve).all() else math.inf
    if not MIN_SIZE <= size <= MAX_SIZE:
        raise ProfileError(
            f"{path}: has a contour that reaches {size:.4g} m from the cam's axis; allowed: "
            f"{MIN_SIZE:g} to {MAX_SIZE:g} m, so check its unit and numbers"
        )


def read_contour_table(path: Path, placement: Placement = UNPLACED) -> ContourFile:
    """Read the contours of a table with columns x and y, or angle and radius.

    A column `disc` separates several contours. The angle of polar coordinates is clockwise from +y
    of the file, like the cam angle in the frame of the cam. The placement is applied to both kinds
    of coordinates.

    Raises
    ------
    ConfigError
        If the table or one of its headings, units or numbers is invalid.
    ProfileError
        If a contour does not have the size of a cam.
    """
    lines, _ = read_lines(path, "points of a contour", MAX_BYTES)
    table = _ContourTable(str(path), lines)
    headings = table.headings_of_numbers()
    first, second, is_polar = table.coordinates(headings)
    table.require_clear(headings, [first, second])
    used = [first, second]
    numbers = table.points(headings, used)
    notes = [table.describe_format(table.rows[table.first :], used)]
    factor, more = table.length_factor(headings[second], placement.unit)
    notes += more
    discs = table.discs(headings)
    if is_polar:
        table.require_no_minutes(headings, first)
        angle_factor, more = table.angle_factor(headings[first], numbers[0].tolist())
        notes += more
        angle, radius = angle_factor * numbers[0], factor * numbers[1]
        order = table.order(angle, radius, discs)
        if (np.diff(order) != 1).any():
            notes.append("rows sorted by angle")
        angle, radius, discs = angle[order], radius[order], [discs[i] for i in order]
        points = placement.place(radius * np.array([np.sin(angle), np.cos(angle)]))
        notes.append("polar points, the angle clockwise from +y of the file as in the law")
    else:
        points = placement.place(factor * numbers)
    notes.append(placement.note())
    require_size(path, points)
    table.require_plane(headings, factor)
    names = list(dict.fromkeys(discs))
    curves = [points[:, [disc == name for disc in discs]] for name in names]
    return ContourFile(curves, True, notes)


class _ContourTable(CellTable):
    """Reader of a table of contour points: headings, units, order of the rows, discs."""

    def headings_of_numbers(self) -> list[Heading]:
        """Return the headings of the table.

        Raises
        ------
        ConfigError
            If the table has no headings.
        """
        if self.first is None or self.first == 0:
            raise self.error(
                "has no heading above numbers; allowed: a heading such as x_mm, y_mm or "
                "angle_deg, radius_mm"
            )
        return self.headings(len(self.rows[self.first][1]))

    def coordinates(self, headings: list[Heading]) -> tuple[int, int, bool]:
        """Return the indices of the columns of x and y, or of angle and radius.

        The third result is True for angle and radius.
        """
        first = {heading.quantity: i for i, heading in reversed(list(enumerate(headings)))}
        if "x" in first and "y" in first:
            x, y = first["x"], first["y"]
            if headings[x].factor != headings[y].factor:
                raise self.error(
                    f"{shorten(headings[x].text)} and {shorten(headings[y].text)} have different "
                    "units; allowed: the same"
                )
            return x, y, False
        if "radius" in first and "angle" in first:
            return first["angle"], first["radius"], True
        texts = ", ".join(heading.text for heading in headings)
        raise self.error(
            f"its columns are {shorten(texts, False)}; allowed: among them x and y, such as x_mm "
            "and y_mm, or angle and radius, such as angle_deg and radius_mm"
        )

    def points(self, headings: list[Heading], used: list[int]) -> FloatArray:
        """Return the numbers of two columns of the table, `(2, n)`, in the units of the table.

        `used` are the indices of the columns.

        Raises
        ------
        ConfigError
            If a cell is not a finite number.
        """
        rows = []
        for line, cells in self.rows[self.first :]:
            texts = self.numbers(line, cells, headings, used)
            if not all(plain_number(cells[i]) for i in used):
                raise self.error(
                    f"line {line}: has the row {shorten(','.join(cells))}; allowed: finite numbers"
                )
            rows.append([float(texts[i]) for i in used])
        return np.array(rows).reshape(-1, 2).T

    def length_factor(self, heading: Heading, unit: str | None) -> tuple[float, list[str]]:
        """Return the factor from lengths in the table to m, and notes on assumptions.

        `heading` is that of a column of lengths. `unit` is the unit that the user states for a
        table without a unit, or None. If both have none, mm is assumed, with a note.
        """
        if heading.factor is None:
            notes = [f"no unit of length in {heading.text!r}: mm assumed"] if unit is None else []
            return UNITS["length"][unit or "mm"], notes
        if unit is not None and not math.isclose(heading.factor, UNITS["length"][unit]):
            raise self.error(
                f"the heading {shorten(heading.text)} has another unit than {unit}; allowed: "
                "--unit for a table without a unit"
            )
        return heading.factor, []

    def angle_factor(self, heading: Heading, angles: list[float]) -> tuple[float, list[str]]:
        """Return the factor from angles in the table to the cam angle in rad, and notes.

        A heading without a unit has its unit guessed from `angles`, the numbers of the column. An
        angle of the crank is halved. The notes state both.
        """
        factor, notes = heading.factor, []
        if factor is None:
            factor, unit = self.guess_angle_unit(heading, angles)
            notes.append(f"no unit of angle in {heading.text!r}: {unit} assumed")
        if heading.is_crank:
            factor *= 0.5
            notes.append(
                f"{heading.text!r} is the angle of the crank, which turns twice as fast as the "
                "cam: halved"
            )
        return factor, notes

    def order(self, angle: FloatArray, radius: FloatArray, discs: list[str]) -> list[int]:
        """Return the order of the table's rows around the cam, as indices of the rows.

        The rows of each disc are sorted by angle if their angles (rad) rise and fall several times.
        Otherwise their order is kept.

        Raises
        ------
        ConfigError
            If the angles cover more than a turn, or rows to be sorted have several radii (m) at
            an angle.
        """
        rows = list(range(angle.size))
        for disc in dict.fromkeys(discs):
            members = np.flatnonzero([name == disc for name in discs])
            span = float(np.ptp(angle[members]))
            if span > MAX_TURN:
                raise self.error(
                    f"the angles cover {math.degrees(span):.6g} deg; allowed: one turn of the cam, "
                    "or a heading such as crank_deg for the angle of the crank"
                )
            steps = np.diff(angle[members], append=angle[members[:1]])
            if min(np.count_nonzero(steps < 0.0), np.count_nonzero(steps > 0.0)) <= 1:
                continue  # the rows are in order around the cam, from any angle on
            placed = members[np.argsort(angle[members], kind="stable")]
            repeated = (np.diff(angle[placed]) == 0.0) & (np.diff(radius[placed]) != 0.0)
            if repeated.any():
                row = placed[np.argmax(repeated)]
                raise self.error(
                    f"the angle {math.degrees(angle[row]):.6g} deg has several radii, and the rows "
                    "are not in order; allowed: one turn of the cam"
                )
            for index, row in zip(members.tolist(), placed.tolist(), strict=True):
                rows[index] = row
        return rows

    def require_plane(self, headings: list[Heading], factor: float) -> None:
        """Raise `ConfigError` if the coordinate z varies by more than `MAX_HEIGHT` in a disc.

        A table without z is accepted. `factor` is the unit of x and y in m.
        """
        column = next((i for i, heading in enumerate(headings) if heading.quantity == "z"), None)
        if column is None:
            return
        unit, first = headings[column].factor or factor, dict[str, float]()
        for disc, (line, cells) in zip(self.discs(headings), self.rows[self.first :], strict=True):
            if (text := plain_number(cells[column])) is None:
                continue
            height = unit * float(text) - first.setdefault(disc, unit * float(text))
            if abs(height) > MAX_HEIGHT:
                raise self.error(
                    f"line {line}: {shorten(headings[column].text)} differs by {height * 1e3:.4g} "
                    "mm from the first point; allowed: points of a contour in the xy plane"
                )

    def discs(self, headings: list[Heading]) -> list[str]:
        """Return the disc that each row of the table belongs to.

        The result contains names. It is empty if the table has no column of discs.
        """
        column = next((i for i, heading in enumerate(headings) if heading.text == "disc"), None)
        return ["" if column is None else cells[column] for _, cells in self.rows[self.first :]]
