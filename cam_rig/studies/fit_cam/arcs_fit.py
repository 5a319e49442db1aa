"""Fit of one contour of tangent arcs to the readings of one or several followers.

An `ArcSearch` fits each possible interpretation of the columns. An interpretation is the kind of
follower and the turning sense of each column. The likeliest is fitted again with straight flanks,
and these are used if the readings do not rule them out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import ClassVar, Literal

import numpy as np

from cam_rig.errors import LawError
from cam_rig.laws.arc_law import ArcFollower
from cam_rig.show.result import Column, Records, Result
from cam_rig.studies.fit_cam.arcs import (
    ANGLE,
    COORDINATES,
    FLANK,
    NONE_NEAR,
    NOSE,
    PRIME,
    ArcColumn,
    Arcs,
    ArcSearch,
    Form,
    Known,
    number_of,
    require_roller,
    with_radii,
)
from cam_rig.studies.fit_cam.arcs_intervals import Profile, Told
from cam_rig.studies.fit_cam.dwells import beside_others, farthest, left_out
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.studies.fit_cam.outliers import OUTLIER, judged_by, with_outliers
from cam_rig.units import rms

#: Shape of the flanks, if it is known.
Flank = Literal["straight", "curved"] | None
#: Ratio of r.m.s. residuals from which the readings rule out the worse of two interpretations.
CLEARLY_NEARER = 1.1
#: Largest r.m.s. residual of readings that arcs describe, as a multiple of the readings' scatter.
DESCRIBED = 4.0
#: Text of the turning sense of a column. The index is True if it is reversed.
SENSES = ("as turned", "reversed")


@dataclass(frozen=True, eq=False, repr=False)
class ArcsFit(Result):
    """Fitted contour of tangent arcs, its columns, and the other interpretations.

    Attributes
    ----------
    best : fit of the selected contour
    curved : best fit with any flank, which can be `best`
    known : radii that are given
    flank : shape of the flanks, if it is given
    others : fits of all other interpretations of the columns, likeliest first
    arcs : the contour, with the given or assumed radii
    roller_radius : roller radius in m, given, fitted or assumed, 0 for a point
    other_radius : usual assumption in m, if it leaves too little radius for nose or base and
        another radius was assumed, else None
    without_radii : best fit without the given radii, if these bound the search, else None
    notes : how the tables were read
    assumed : assumptions in a written file that no reading supports
    """

    schema = "cam_rig.fit_arcs.1"
    plot_function = "cam_rig.studies.fit_cam.figures:arcs_figure"
    columns: ClassVar = {
        "numbers": (
            Column("number", of="name"),
            Column("value", cell=lambda told: told.shown, doc="m, of an angle rad"),
            Column("low_95", hidden=True, doc="empty if the interval contains straight"),
            Column("high_95", hidden=True, doc="empty if the interval contains straight"),
            Column("convex_from_95", hidden=True, doc="else the least convex radius"),
            Column("concave_from_95", hidden=True, doc="else the least concave radius"),
            Column("interval", heading="with 95 %", cell=lambda told: told.interval or "-"),
            Column("standard_error", of="error", hidden=True),
            Column("told", of=lambda one: one.how_well or "well", cell=lambda one: one.how_well),
        ),
        "residuals": (
            Column("readings", of="readings.name"),
            Column("count", "", "d", of="away.size"),
            Column("follower", of="kind"),
            Column("reversed", "", "", "read", "reverse", lambda c: SENSES[c.reverse]),
            Column("rms", "mm", ".4f", "r.m.s."),
            Column("largest", "mm", ".4f", of=lambda c: float(abs(c.away).max())),
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
            Column("known", doc="which radius was given"),
            Column("rms", "m"),
            Column("cannot_tell"),
            Column("notes", doc="how the readings were read"),
            Column("conclusions", of=lambda fit: [*fit.conclusions()]),
        ),
    }

    best: Profile
    curved: Profile
    known: Known
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
        """Readings of each column, with their residuals from the contour."""
        search, rolling = self.best.search, ArcFollower(False, self.roller_radius)
        found = [search.column(self.best.x, i) for i in range(len(search.columns))]
        return tuple(
            column if column.follower.flat else replace(column, follower=rolling)
            for column in found
        )

    @property
    def numbers(self) -> tuple[float, ...]:
        """Parameters of the contour as reported, in m and rad.

        The radius of a straight flank is infinite.
        """
        found = self.best.search.form.coordinates(self.arcs.grown(self.roller_radius))
        return tuple(number_of(i, float(found[i])) for i in COORDINATES)

    @property
    def rms(self) -> float:
        """Residual of all readings, r.m.s. in m."""
        return rms(np.concatenate([column.away for column in self.fitted_columns]))

    @property
    def scatter(self) -> float:
        """Standard deviation (m) of all readings from a smooth law through each column."""
        sizes = [np.full(c.away.size, c.readings.scatter) for c in self.fitted_columns]
        return rms(np.concatenate(sizes))

    @property
    def described(self) -> bool:
        """True if arcs describe the readings: the residual is within `DESCRIBED` scatters."""
        return self.rms <= DESCRIBED * self.scatter

    @property
    def only_flat(self) -> bool:
        """True if all followers are flat, so that the base radius is not identifiable."""
        return all(column.kind == "flat" for column in self.fitted_columns)

    @cached_property
    def told(self) -> tuple[Told, ...]:
        """Interval of each parameter, for any flank unless it is given as straight."""
        profile = self.best if self.flank == "straight" else self.curved
        return tuple(self._told(i, profile) for i in COORDINATES)

    @cached_property
    def prime_if_straight(self) -> Told | None:
        """Interval of the prime radius (base plus roller radius) with straight flanks.

        None if straight flanks were given or not selected, or if the prime radius is fixed.
        """
        straight = self.best is not self.curved and PRIME not in self.best.search.held
        return self._told(PRIME, self.best) if straight else None

    def _told(self, index: int, profile: Profile) -> Told:
        value, name = self.numbers[index], self.best.search.form.names[index]
        unit = "deg" if index == ANGLE else "mm"
        if index in profile.search.held:
            base_given = self.known == "both" or (self.only_flat and self.known == "base")
            given = index == FLANK or base_given
            return Told(name, value, value, value, "given" if given else "assumed", unit)
        return Told(name, value, *profile.interval(index), unit=unit)

    @property
    def unclear_kinds(self) -> Profile | None:
        """Likeliest fit with other kinds of follower that is not ruled out, or None."""
        flats = self.best.search.flats
        others = (one for one in self.others if one.search.flats != flats)
        return next(filter(self.as_near, others), None)

    def as_near(self, other: Profile) -> bool:
        """Return True if the readings do not rule out another interpretation."""
        return other.rms < CLEARLY_NEARER * self.rms

    @property
    def cannot_tell(self) -> tuple[str, ...]:
        """Parameters that these followers cannot identify, one sentence each."""
        if self.only_flat:
            return (
                "A flat follower tells flank and nose radius only less the base radius: that is "
                f"{'given' if self.known in ('base', 'both') else self._assumed}.",
            )
        if not self.roller_radius or self.known == "both":
            return ()
        whose = "base" if self.known == "base" else "roller"
        return (
            f"Base and roller radius are told only as a sum: the {whose} radius is "
            f"{'given' if self.known else self._assumed}, and flank and nose radius go with it.",
        )

    @property
    def _assumed(self) -> str:
        """Text that a radius is assumed, with its value if it is not the usual assumption."""
        if self.other_radius is None:
            return "assumed"
        radius = self.arcs.base_radius if self.only_flat else self.roller_radius
        usual = "three lifts" if self.only_flat else "half the lift"
        return (
            f"assumed as {radius * 1e3:.3g} mm, for with {usual}, {self.other_radius * 1e3:.3g} mm,"
            " nose or base would have no radius"
        )

    def tables(self) -> list[Records]:
        """Return the tables of parameters, residuals and other interpretations."""
        numbers, away = "what the readings tell", "Residuals of the readings from the arcs"
        return [
            self.table("numbers", f"Tangent arcs: {numbers}", self.told),
            self.table("residuals", away, self.fitted_columns),
            self.table("others", "Other readings of the columns", self.others, hidden=True),
            self.table("arcs", "The contour", [self], single=True, hidden=True),
        ]

    def summary(self) -> list[str]:
        """Return the notes on the tables, followed by the conclusions."""
        return [*self.notes, *self.conclusions()]

    def conclusions(self) -> Iterator[str]:
        """Yield the conclusions, one sentence each.

        They report the residual, the flanks, the interpretation of the columns, the outliers, and
        the parameters that are not identifiable.
        """
        free = self.best.x.size
        readings = sum(column.away.size for column in self.fitted_columns)
        left = f"{self.rms * 1e3:.3g} mm r.m.s."
        yield f"{free} numbers of tangent arcs: {left} from {readings} readings."
        yield from self._flanks()
        yield from self._poorly()
        flat = [column.readings.name for column in self.fitted_columns if column.kind == "flat"]
        if flat and len(flat) < len(self.fitted_columns):
            yield f"The flat follower's readings are {' and '.join(flat)}."
        reverse = [column.readings.name for column in self.fitted_columns if column.reverse]
        if reverse:
            apart = abs(math.degrees(2.0 * self.arcs.nose_angle) + 180.0) % 360.0 - 180.0
            yield (
                f"{' and '.join(reverse)} fits as read in the other turning sense, or from a zero "
                f"{abs(apart):.2g} deg apart."
            )
        for column in self.fitted_columns:
            sizes = beside_others(column.readings, column.away)
            if self.described:
                yield from farthest(column.readings, -column.away, sizes)
            if column.readings.outliers:
                yield f"{column.readings.name}: {left_out(column.readings)}"
        for other in self.others[:1]:
            words = f"{other.search.name} ({other.rms * 1e3:.3g} mm r.m.s.)"
            if self.as_near(other):
                yield f"As near, and not told apart: {words}"
            else:
                yield f"The next best reading of the columns is {words}"
        yield from self.cannot_tell

    def _flanks(self) -> Iterator[str]:
        """Yield the sentences on straight flanks, and on the prime radius with them."""
        flank, straight = self.told[FLANK], self.arcs.flank_radius is None
        if self.flank == "straight":
            yield "Flanks are straight as asked: a tangent cam."
        elif straight:
            yield (
                "Flanks are straight within the readings, `flank: straight`, a tangent cam: taken, "
                f"for {self.rms * 1e3:.3g} mm r.m.s. are left and {self.curved.rms * 1e3:.3g} mm "
                f"of the best curved ones. With 95 % {flank.name} is {flank.interval}."
            )
            if self.prime_if_straight is not None:
                yield (
                    "If you know that they are straight, give flank as straight: "
                    f"{self.told[PRIME].name} is then {self.prime_if_straight.interval} with 95 %."
                )
        elif flank.over_straight:
            yield (
                "Flanks are straight within the readings too, and taken so unless curved ones are "
                "asked for."
            )

    def _poorly(self) -> Iterator[str]:
        if not self.described:
            yield (
                f"Warning: tangent arcs do not describe the readings: {self.rms * 1e3:.3g} mm "
                f"r.m.s. are left, the readings scatter by {self.scatter * 1e3:.2g} mm about a "
                "smooth law. The cam's radii are not told: try another follower, or take the shape "
                "spline."
            )
        free = self.without_radii
        if free is not None and free.away(self.best.squares) > free.line(PRIME).limit:
            prime, nose = (
                " to ".join(f"{end * 1e3:.3g}" for end in free.interval(index))
                for index in (PRIME, NOSE)
            )
            yield (
                f"Warning: the readings contradict the radii given: {free.rms * 1e3:.3g} mm r.m.s. "
                f"are left without them, and base and roller radius together are then {prime} mm, "
                f"nose and roller radius {nose} mm, with 95 %."
            )
        hardly = [one for i, one in enumerate(self.told) if i != FLANK and one.hardly]
        if hardly:
            poor = ", ".join(f"{one.name} {one.interval}" for one in hardly)
            yield f"Warning: the readings hardly tell {poor} (95 %)."


#: Largest number of times that outliers are determined from the arcs and the arcs fitted again.
ROUNDS = 4
#: R.m.s. residual, as a fraction of the lift, from which a contour does not belong to the readings.
FAR = 0.05
#: Base radius in lifts that is large enough not to bound the contour under a flat face.
FREE_BASE = 100.0
#: Ratio of the nose radius of the pitch curve to a given roller radius, below which the search is
#: at its bound.
AT_LEAST = 1.01
#: Ratio of r.m.s. residual to the smallest residual, above which an interpretation is not refined.
FAR_OFF = 2.0


def fit_arcs(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller_radius: float,
    base_radius: float,
    known: Known = None,
    flank: Flank = None,
) -> ArcsFit:
    """Fit one contour of tangent arcs to the readings of all columns.

    The lifts are above the zero of their column. The fitted arcs determine the outliers, not the
    neighbouring readings. A flat face can pass from base circle to nose with a kink, and a good
    reading at a kink disagrees with its neighbours.

    Parameters
    ----------
    columns : readings of each column
    kinds : for each column True if its follower is flat, False if not, None to try both
    roller_radius : roller radius in m, 0 for a point
    base_radius : base radius in m, used if all followers are flat, because they do not determine
        it, and if both radii are known
    known : the radii that are known. A radius bounds the search only if it is known. An assumed
        radius that leaves too little radius for the nose is replaced.
    flank : shape of the flanks (default: straight unless the readings rule it out)

    Returns
    -------
    fit : the likeliest contour

    Raises
    ------
    LawError : no contour is close to the readings
    ConfigError : the known base radius leaves no roller or no nose
    """

    def fit(columns: tuple[Readings, ...]) -> ArcsFit:
        searches = _searches(columns, kinds, roller_radius, base_radius, known)
        return _fitted(columns, searches, known, flank, (roller_radius, base_radius))

    found = _settled(fit, columns)
    if any(column.readings.outliers for column in found.fitted_columns):
        with suppress(LawError):  # no contour is close to the readings with a very large slip
            whole = _settled(fit, tuple(with_outliers(one) for one in columns))
            # used if it keeps more readings, and on average the added readings are not outliers
            more = whole.best.search.count - found.best.search.count
            worse = whole.best.squares - found.best.squares
            if more > 0 and worse < more * (OUTLIER * found.rms) ** 2:
                found = whole
    if known == "base":
        pitch = found.best.search.pitch(found.best.x)
        require_roller(base_radius, pitch, found.told[PRIME].interval)
    return found


def _settled(
    fit: Callable[[tuple[Readings, ...]], ArcsFit], columns: tuple[Readings, ...]
) -> ArcsFit:
    """Return the fit that leaves out the same outliers that its arcs determine.

    The last fit is returned if the outliers still change after `ROUNDS` repetitions.
    """
    found = fit(columns)
    for _ in range(ROUNDS):
        judged = tuple(
            judged_by(one.readings, partial(one.lifts, found.arcs)) for one in found.fitted_columns
        )
        left = [one.readings.lines for one in found.fitted_columns]
        if all(np.array_equal(one.lines, two) for one, two in zip(judged, left, strict=True)):
            break
        found = fit(judged)
    return found


def _fitted(
    columns: tuple[Readings, ...],
    searches: Iterable[ArcSearch],
    known: Known,
    flank: Flank,
    radii: tuple[float, float],
) -> ArcsFit:
    """Return the fit of the likeliest search, with straight flanks if not ruled out.

    ``radii`` is the roller radius and the base radius in m.
    """
    if flank == "straight":
        searches = (search.holding(FLANK, 0.0) for search in searches)
    tried = sorted(_profiles(list(searches)), key=_unlikely)
    highest = max(float(column.lifts.max()) for column in columns)
    if tried[0].rms >= FAR * highest:
        raise LawError(f"{columns[0].name}: {NONE_NEAR}")
    best, *rest = tried
    taken = best
    if not flank:
        search = best.search.holding(FLANK, 0.0)
        straight = Profile(search, search.best())
        if best.away(straight.squares) <= best.line(FLANK).limit:
            taken = straight  # the readings do not rule it out
    flat = all(best.search.flats)
    contour = with_radii(taken.search.pitch(taken.x), flat, known, *radii)
    return ArcsFit(taken, best, known, flank, tuple(rest), *contour, _unbound(taken, known))


def _unbound(fit: Profile, known: Known) -> Profile | None:
    """Return the best fit without the given radii.

    Return None if they do not bound the search.
    """
    search = fit.search
    at_end = search.pitch(fit.x).nose_radius < AT_LEAST * search.least
    if all(search.flats) or not (known == "both" or at_end):
        return None
    held = {index: value for index, value in search.held.items() if index != PRIME}
    free = replace(search, held=held, least=0.0)
    return Profile(free, free.best())


def _searches(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller: float,
    base: float,
    known: Known,
) -> Iterator[ArcSearch]:
    """Yield the search of each possible interpretation of the columns.

    A contour and its mirror image differ only in the angle of the nose. The sense of the first
    column is therefore not reversed. The other columns are tried in both senses.
    """
    far = FREE_BASE * max(float(column.lifts.max()) for column in columns)
    flats = product(*((True, False) if kind is None else (kind,) for kind in kinds))
    senses = list(product(*([(False,)] + [(False, True)] * (len(columns) - 1))))
    for flat, sense in product(flats, senses):
        form = Form(roller > 0.0, sums=not all(flat) and known != "base")
        roles, held, least = tuple(zip(flat, sense, strict=True)), {}, 0.0
        if all(flat):
            held = {PRIME: 1.0 / (base if known in ("base", "both") else far)}
        elif known in ("roller", "both"):
            least = roller
            held = {PRIME: 1.0 / (base + roller)} if known == "both" else {}
        yield ArcSearch(columns, roles, form, held, least)


def _profiles(searches: list[ArcSearch]) -> Iterator[Profile]:
    """Yield the best contour of each search.

    A contour with a far larger residual than the smallest is not refined.
    """
    rough = [search.rough() for search in searches]
    least = min(search.rms(ends[0]) for search, ends in zip(searches, rough, strict=True))
    for search, ends in zip(searches, rough, strict=True):
        far = search.rms(ends[0]) > FAR_OFF * least
        yield Profile(search, ends[0] if far else search.refined(ends))


def _unlikely(tried: Profile) -> float:
    """Return Schwarz's criterion (BIC), which is lower for a likelier contour.

    Of two contours that are equally close, that with fewer free parameters is likelier.
    """
    count = tried.search.count
    return 2.0 * count * math.log(max(tried.rms, 1e-12)) + tried.x.size * math.log(count)
