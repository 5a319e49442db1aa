"""Result of a fit of tangent arcs: contour, intervals of its parameters, and residuals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from cam_rig.laws.arc_law import ArcFollower
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.fit_cam.arcs.contour import ArcColumn, Arcs, Parameter, parameter_value
from cam_rig.studies.fit_cam.arcs.intervals import ParameterInterval
from cam_rig.studies.fit_cam.arcs.profile_likelihood import Profile
from cam_rig.studies.fit_cam.arcs.radii import GivenRadii
from cam_rig.studies.fit_cam.suspects import list_farthest, list_outliers, relative_residuals
from cam_rig.units import rms

#: Shape of the flanks that the user has given, or None.
Flank = Literal["straight", "curved"] | None
#: The readings rule out another interpretation (follower types and turning senses) if its r.m.s.
#: residual is at least this multiple of the best. With a smaller ratio it could be the better
#: interpretation of another set of readings.
MIN_EXCLUDED_RATIO = 1.1
#: Largest r.m.s. residual at which tangent arcs are accepted as a description of the readings, as a
#: multiple of the readings' scatter. It is above 1 because the estimated scatter is too small if
#: neighbouring readings have equal errors.
MAX_DESCRIBED_SCATTERS = 4.0
#: Texts for the turning sense of a column of readings, indexed by False (as turned) and True
#: (reversed).
SENSES = ("as turned", "reversed")
#: Description of the columns with the ends of an interval, in the table of parameters. The interval
#: of a flank radius can include a straight flank.
NOT_STRAIGHT = "empty if the interval contains straight"


@dataclass(frozen=True, eq=False, repr=False)
class ArcsFit(Result):
    """Fitted contour of tangent arcs, its columns, and the other interpretations.

    An interpretation is the follower type and turning sense of each column.

    Attributes
    ----------
    best : Profile
        Fit of the selected contour.
    curved : Profile
        Best fit with any flank, which can be `best`.
    given_radii : {'base', 'roller', 'both'} or None
        Radii that are given.
    flank : {'straight', 'curved'} or None
        Shape of the flanks, if it is given.
    others : tuple of Profile
        Fits of all other interpretations of the columns, likeliest first.
    arcs : Arcs
        The contour, with the given or assumed radii.
    roller_radius : float
        Roller radius in m, given, fitted or assumed, 0 for a point.
    other_radius : float or None
        Radius in m that is usually assumed, if it leaves too little radius for nose or base and
        another radius was assumed, else None.
    without_radii : Profile or None
        Best fit without the given radii, if these limit the search, else None.
    notes : tuple of str
        Messages about how the tables were read.
    assumed : tuple of str
        Assumptions in a written file that no reading supports.
    """

    schema = "cam_rig.fit_arcs.2"
    plot_function = "cam_rig.studies.fit_cam.figures:arcs_figure"
    columns: ClassVar = {
        "numbers": (
            Column("number", of="name"),
            Column("value", cell=lambda p: p.value_text, doc="m, of an angle rad"),
            Column("low_95", of="ends.0", hidden=True, doc=NOT_STRAIGHT),
            Column("high_95", of="ends.1", hidden=True, doc=NOT_STRAIGHT),
            Column("convex_from_95", of="ends.2", hidden=True, doc="else the least convex radius"),
            Column("concave_from_95", of="ends.3", hidden=True, doc="else the least concave one"),
            Column(
                "interval",
                heading="with 95 %",
                of="interval_text",
                cell=lambda p: p.interval_text or "-",
            ),
            Column("standard_error", of="error", hidden=True),
            Column("identifiable", of="identifiability", doc="identifiable, poorly or not"),
        ),
        "residuals": (
            Column("readings", of="readings.name"),
            Column("count", "", "d", of="residuals.size"),
            Column("follower", of="kind"),
            Column("reversed", "", "", "read", "is_reversed", lambda c: SENSES[c.is_reversed]),
            Column("rms", "mm", ".4f", "r.m.s."),
            Column("largest", "mm", ".4f", of=lambda c: float(abs(c.residuals).max())),
            Column("largest_at", "°", ".6g", "at", lambda c: float(c.readings.angles[c.worst])),
            Column("largest_line", "", "d", "in line", lambda c: int(c.readings.lines[c.worst])),
            Column("outliers", "", "d", of=lambda c: len(c.readings.outliers)),
        ),
        "others": (Column("columns", of="search.name"), Column("rms", "mm", ".3g")),
        "arcs": (
            Column("base_radius", "m", of="arcs.base_radius"),
            Column("lift", "m", of="arcs.lift"),
            Column("flank", of="arcs.flank"),
            Column("flank_radius", "m", of="arcs.flank_radius"),
            Column("nose_radius", "m", of="arcs.nose_radius"),
            Column("nose_angle", "rad", of="arcs.nose_angle"),
            Column("roller_radius", "m"),
            Column("given_radii", doc="base, roller, both or none"),
            Column("rms", "m"),
            Column("not_identifiable", doc="parameters that these followers do not identify"),
            Column("notes", doc="how the readings were read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    best: Profile
    curved: Profile
    given_radii: GivenRadii
    flank: Flank
    others: tuple[Profile, ...]
    arcs: Arcs
    roller_radius: float
    other_radius: float | None = None
    without_radii: Profile | None = None
    notes: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()

    @cached_property
    def fitted_columns(self) -> tuple[ArcColumn, ...]:
        """Readings of each column with their residuals from the fitted contour.

        They have the interpretation (follower type and turning sense) of the best fit.
        """
        search, roller = self.best.search, ArcFollower(False, self.roller_radius)
        columns = (search.column(self.best.x, i) for i in range(len(search.columns)))
        return tuple(
            column if column.follower.flat else replace(column, follower=roller)
            for column in columns
        )

    @property
    def numbers(self) -> tuple[float, ...]:
        """Parameters of the pitch curve as reported, in m and rad.

        They are in the order of `Parameter`. The radius of a straight flank is infinite.
        """
        coordinates = self.best.search.coordinates.of(self.arcs.offset(self.roller_radius))
        return tuple(parameter_value(p, float(coordinates[p])) for p in Parameter)

    @property
    def rms(self) -> float:
        """R.m.s. residual of all readings from the fitted contour, m."""
        return rms(np.concatenate([column.residuals for column in self.fitted_columns]))

    @property
    def scatter(self) -> float:
        """R.m.s. scatter (m) of all readings about a smooth law through each column."""
        sizes = [np.full(c.residuals.size, c.readings.scatter) for c in self.fitted_columns]
        return rms(np.concatenate(sizes))

    @property
    def is_described(self) -> bool:
        """True if tangent arcs describe the readings.

        The r.m.s. residual is then at most `MAX_DESCRIBED_SCATTERS` times the scatter.
        """
        return self.rms <= MAX_DESCRIBED_SCATTERS * self.scatter

    @property
    def only_flat(self) -> bool:
        """True if all followers are flat, so that the base radius is not identifiable."""
        return all(column.kind == "flat" for column in self.fitted_columns)

    @cached_property
    def intervals(self) -> tuple[ParameterInterval, ...]:
        """95 % interval of each parameter, in the order of `Parameter`.

        It allows any flank, unless the flanks are given as straight.
        """
        profile = self.best if self.flank == "straight" else self.curved
        return tuple(self._interval(parameter, profile) for parameter in Parameter)

    @cached_property
    def prime_if_straight(self) -> ParameterInterval | None:
        """95 % interval of the prime radius under the assumption of straight flanks.

        The prime radius is base plus roller radius. The interval is None if straight flanks were
        given or not selected, or if the prime radius is fixed.
        """
        is_selected = self.best is not self.curved
        if is_selected and Parameter.PRIME not in self.best.search.fixed:
            return self._interval(Parameter.PRIME, self.best)
        return None

    def _interval(self, parameter: Parameter, profile: Profile) -> ParameterInterval:
        """Return the 95 % interval of a contour parameter, or its fixed value.

        ``profile`` is the fit from which the interval is computed.
        """
        value, name = self.numbers[parameter], self.best.search.coordinates.names[parameter]
        unit = "deg" if parameter == Parameter.ANGLE else "mm"
        if parameter not in profile.search.fixed:
            return ParameterInterval(name, value, *profile.interval(parameter), unit=unit)
        is_given = parameter == Parameter.FLANK or self.given_radii in ("base", "both")
        return ParameterInterval(name, value, value, value, "given" if is_given else "assumed")

    def excludes(self, other: Profile) -> bool:
        """Return True if the readings rule out another interpretation of the columns.

        ``other`` is the fit of that interpretation.
        """
        return other.rms >= MIN_EXCLUDED_RATIO * self.rms

    @property
    def other_kinds(self) -> Profile | None:
        """Likeliest fit with other follower types that the readings do not rule out.

        It is None if they rule out all others.
        """
        flats = self.best.search.flats
        others = (other for other in self.others if other.search.flats != flats)
        return next((other for other in others if not self.excludes(other)), None)

    @property
    def not_identifiable(self) -> tuple[str, ...]:
        """Sentences on the radii that these types of followers cannot identify."""
        if not self.only_flat and (not self.roller_radius or self.given_radii == "both"):
            return ()
        radius, usual = self.roller_radius, "half the lift"
        if self.only_flat:
            radius, usual = self.arcs.base_radius, "three lifts"
        origin = "given"
        if self.given_radii is None or (self.only_flat and self.given_radii == "roller"):
            origin = "assumed"
        if self.other_radius is not None:
            origin += (
                f" as {radius * 1e3:.3g} mm, because with {usual}, "
                f"{self.other_radius * 1e3:.3g} mm, nose or base would have no radius"
            )
        if self.only_flat:
            return (
                "A flat follower identifies flank and nose radius only less the base radius, "
                f"which is {origin}.",
            )
        name = "base" if self.given_radii == "base" else "roller"
        return (
            f"Base and roller radius are identifiable only as a sum: the {name} radius is "
            f"{origin}, and flank and nose radius depend on it.",
        )

    def tables(self) -> list[Records]:
        """Return the tables of parameters, residuals and other interpretations."""
        residuals = "Residuals of the readings from the arcs"
        others = "Other interpretations of the columns"
        return [
            self.table("numbers", "Tangent arcs: parameters and intervals", self.intervals),
            self.table("residuals", residuals, self.fitted_columns),
            self.table("others", others, self.others, hidden=True),
            self.table("arcs", "The contour", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return the sentences under the tables: notes on the readings, then conclusions."""
        return [*self.notes, *self.conclusions()]

    # Sentences of the summary.

    def conclusions(self) -> Iterator[str]:
        """Yield the sentences of the summary.

        They report the residual, the flanks, the interpretation of the columns, the outliers, and
        the parameters that are not identifiable.
        """
        readings = sum(column.residuals.size for column in self.fitted_columns)
        yield (
            f"{self.best.x.size} numbers of tangent arcs: {self.rms * 1e3:.3g} mm r.m.s. from "
            f"{readings} readings."
        )
        yield from self._explain_flanks()
        yield from self._warnings()
        yield from self._explain_columns()
        yield from self.not_identifiable

    def _explain_flanks(self) -> Iterator[str]:
        """Yield sentences on straight flanks and their effect, if these were selected."""
        if self.best is self.curved:
            return
        flank, prime = self.intervals[Parameter.FLANK], self.intervals[Parameter.PRIME]
        yield (
            "Straight flanks are used (`flank: straight`, a tangent cam), because the readings do "
            f"not exclude them: the residual is {self.rms * 1e3:.3g} mm r.m.s., and "
            f"{self.curved.rms * 1e3:.3g} mm with the best curved flanks. With 95 % {flank.name} "
            f"is {flank.interval_text}."
        )
        if self.prime_if_straight is not None:
            yield (
                "If you know that they are straight, give flank as straight: "
                f"{prime.name} is then {self.prime_if_straight.interval_text} with 95 %."
            )

    def _warnings(self) -> Iterator[str]:
        """Yield warnings if arcs do not describe the readings, or contradict given radii."""
        if not self.is_described:
            yield (
                "Warning: tangent arcs do not describe the readings: the residual is "
                f"{self.rms * 1e3:.3g} mm r.m.s., and their scatter about a smooth law "
                f"{self.scatter * 1e3:.2g} mm. The radii of the cam are not identified: try "
                "another follower, or use the shape spline."
            )
        free = self.without_radii
        if free is not None and free.excludes(Parameter.PRIME, self.best.sse):
            prime, nose = (
                " to ".join(f"{end * 1e3:.3g}" for end in free.interval(parameter))
                for parameter in (Parameter.PRIME, Parameter.NOSE)
            )
            yield (
                "Warning: the readings contradict the given radii: without them the residual is "
                f"{free.rms * 1e3:.3g} mm r.m.s., base and roller radius are together {prime} mm, "
                f"and nose and roller radius {nose} mm, with 95 %."
            )

    def _explain_columns(self) -> Iterator[str]:
        """Yield sentences on turning senses, outliers and other interpretations."""
        columns = self.fitted_columns
        reverse = [column.readings.name for column in columns if column.is_reversed]
        if reverse:
            apart = abs(math.degrees(2.0 * self.arcs.nose_angle) + 180.0) % 360.0 - 180.0
            yield (
                f"{' and '.join(reverse)} fits as read in the other turning sense, or from a zero "
                f"{abs(apart):.2g} deg apart."
            )
        for column in columns:
            sizes = relative_residuals(column.readings, column.residuals)
            if self.is_described:
                yield from list_farthest(column.readings, -column.residuals, sizes)
            if column.readings.outliers:
                yield f"{column.readings.name}: {list_outliers(column.readings)}"
        for other in self.others[:1]:
            text = f"{other.search.name} ({other.rms * 1e3:.3g} mm r.m.s.)"
            if self.excludes(other):
                yield f"The next best interpretation of the columns is {text}"
            else:
                yield f"The readings do not exclude {text}"
