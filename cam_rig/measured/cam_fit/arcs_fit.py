"""One contour of tangent arcs through the readings of one or several followers at once.

The least squares of `arcs_search` for every way in which the columns may have been read, and of
the likeliest once more with straight flanks: these are taken where the readings do not rule them
out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product
from typing import Literal

import numpy as np

from cam_rig.errors import LawError
from cam_rig.measured.cam_fit.arcs import (
    COORDINATES,
    FLANK,
    PRIME,
    ArcColumn,
    Arcs,
    Form,
    number_of,
)
from cam_rig.measured.cam_fit.arcs_intervals import Profile, Told
from cam_rig.measured.cam_fit.arcs_search import ArcSearch
from cam_rig.measured.cam_fit.gauge import OUTLIER, Readings, judged_by, with_outliers
from cam_rig.units import rms

#: Outliers are judged by the arcs, and the arcs are fitted again, at most so many times.
ROUNDS = 4

#: Which radius is known beside the readings.
Known = Literal["base", "roller", "both"] | None

#: What is known of the flanks.
Flank = Literal["straight", "curved"] | None

#: A contour whose lifts are off the readings by this part of the lift, r.m.s., is another one.
FAR = 0.05

#: A reading of the columns that leaves so many times the least residual is not refined.
FAR_OFF = 2.0

#: Of two readings of the columns this much nearer (in parts) one is told from the other.
CLEARLY_NEARER = 1.1


@dataclass(frozen=True)
class Other:
    """Another reading of the columns: in words, its r.m.s. residual (m), the followers' kinds."""

    name: str
    rms: float
    flats: tuple[bool, ...]


@dataclass(frozen=True, eq=False)
class ArcsFit:
    """A contour of tangent arcs, its columns, and what else was tried.

    Parameters
    ----------
    best : the contour that is taken
    curved : the best of any flank, which may be ``best``
    others : every other reading of the columns, likeliest first
    without_radii : the best contour of other radii than those that were both given
    """

    best: Profile
    curved: Profile
    known: Known
    flank: Flank
    others: tuple[Other, ...]
    without_radii: Profile | None = None

    @property
    def arcs(self) -> Arcs:
        """The contour."""
        return self.best.search.arcs(self.best.x)

    @cached_property
    def columns(self) -> tuple[ArcColumn, ...]:
        """The readings beside the contour."""
        search = self.best.search
        return tuple(search.column(self.best.x, i) for i in range(len(search.columns)))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The contour's numbers as they are told, m and rad; a straight flank's is infinite."""
        found = self.best.search.form.coordinates(self.arcs)
        return tuple(number_of(i, float(found[i])) for i in COORDINATES)

    @property
    def roller_radius(self) -> float:
        """Assumed or given (m), 0 for a point."""
        return self.best.search.form.roller

    @property
    def rms(self) -> float:
        """r.m.s. residual of all readings, m."""
        return rms(np.concatenate([column.away for column in self.columns]))

    @property
    def only_flat(self) -> bool:
        """Whether every follower is a flat one, so that no base radius is told."""
        return all(column.kind == "flat" for column in self.columns)

    @property
    def told_of(self) -> Profile:
        """What the intervals are of: of any flank, unless it is known to be straight."""
        return self.best if self.flank == "straight" else self.curved

    @cached_property
    def told(self) -> tuple[Told, ...]:
        """What the readings tell of each number, a straight flank or not."""
        return tuple(self._told(i, self.told_of) for i in COORDINATES)

    @cached_property
    def prime_if_straight(self) -> Told | None:
        """Base and roller radius if the flank that is straight within the readings is so."""
        straight = self.best is not self.curved and PRIME not in self.best.search.held
        return self._told(PRIME, self.best) if straight else None

    def _told(self, index: int, profile: Profile) -> Told:
        value, name = self.numbers[index], self.best.search.form.names[index]
        if index in profile.search.held:
            base_given = self.known == "both" or (self.only_flat and self.known == "base")
            given = index == FLANK or base_given
            return Told(name, value, value, value, "given" if given else "assumed")
        return Told(name, value, *profile.interval(index))

    @property
    def unclear_kinds(self) -> Other | None:
        """Other kinds of follower with which the readings are as near."""
        flats = tuple(flat for flat, _ in self.best.search.roles)
        return next(
            (one for one in self.others if one.flats != flats and self.as_near(one)),
            None,
        )

    def as_near(self, other: Other) -> bool:
        """Whether another reading of the columns is not told from this one."""
        return other.rms < CLEARLY_NEARER * self.rms

    @property
    def cannot_tell(self) -> tuple[str, ...]:
        """What no readings of these followers can tell, a sentence each."""
        if self.only_flat:
            return (
                "A flat follower tells flank and nose radius only less the base radius: that is "
                f"{'given' if self.known in ('base', 'both') else 'assumed'}.",
            )
        if not self.roller_radius or self.known == "both":
            return ()
        whose = "base" if self.known == "base" else "roller"
        return (
            f"Base and roller radius are told only as a sum: the {whose} radius is "
            f"{'given' if self.known else 'assumed'}, and flank and nose radius go with it.",
        )

    @property
    def base_is_told(self) -> bool:
        """Whether the readings bound base and roller radius, or flanks are taken as straight."""
        prime = self.told[PRIME]
        return bool(prime.held) or self.arcs.flank_radius is None or math.isfinite(prime.high)


def fit_arcs(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller_radius: float,
    base_radius: float,
    known: Known = None,
    flank: Flank = None,
) -> ArcsFit:
    """Fit one contour to all columns, above their zero; of unnamed ones the kind is found too.

    Parameters
    ----------
    kinds : for each column whether its follower is flat; None tries both
    roller_radius : m, 0 for a point; only its sum with the base radius is told
    base_radius : m, taken where all followers are flat, for nothing is told of it then, and where
        both radii are known
    known : which of them is given, not assumed
    flank : what is known of it; None takes a straight one unless the readings rule it out

    Which readings are outliers, the arcs say: a good one beside a kink, where a flat face passes
    from base circle to nose, is contradicted by its neighbours alone, and hides one that is none.
    """
    fit = partial(
        _fitted,
        kinds=kinds,
        roller_radius=roller_radius,
        base_radius=base_radius,
        known=known,
        flank=flank,
    )
    found = _settled(fit, columns)
    if any(column.readings.outliers for column in found.columns):
        with suppress(LawError):  # a slip so large that nothing comes near with it
            whole = _settled(fit, tuple(with_outliers(one) for one in columns))
            return whole if _explains(whole, found) else found
    return found


def _settled(
    fit: Callable[[tuple[Readings, ...]], ArcsFit], columns: tuple[Readings, ...]
) -> ArcsFit:
    """The fit whose own arcs tell the outliers that it leaves out."""
    found = fit(columns)
    for _ in range(ROUNDS):
        judged = tuple(
            judged_by(one.readings, partial(one.lifts, found.arcs)) for one in found.columns
        )
        left = [one.readings.lines for one in found.columns]
        if all(np.array_equal(one.lines, two) for one, two in zip(judged, left, strict=True)):
            break
        found = fit(judged)
    return found


def _explains(whole: ArcsFit, found: ArcsFit) -> bool:
    """Whether a contour takes readings as good that another leaves out, none off as an outlier."""
    more = whole.best.search.count - found.best.search.count
    return more > 0 and whole.best.squares - found.best.squares < more * (OUTLIER * found.rms) ** 2


def _fitted(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller_radius: float,
    base_radius: float,
    known: Known,
    flank: Flank,
) -> ArcsFit:
    """One contour through the columns as they are."""
    searches = list(_searches(columns, kinds, roller_radius, base_radius, known))
    if flank == "straight":
        searches = [search.holding(FLANK, 0.0) for search in searches]
    tried = sorted(_profiles(searches), key=_unlikely)
    highest = max(float(column.lifts.max()) for column in columns)
    if tried[0].rms >= FAR * highest:
        raise LawError(
            f"{columns[0].name}: no base circle, two equal flanks and a nose come near the "
            "readings; allowed: a symmetric cam, else --shape spline"
        )
    best, *rest = tried
    others = tuple(
        Other(one.search.named(), one.rms, tuple(flat for flat, _ in one.search.roles))
        for one in rest
    )
    taken = best if flank else _straight_if_as_near(best)
    without = None
    if known == "both" and not all(flat for flat, _ in best.search.roles):
        held = {index: value for index, value in taken.search.held.items() if index != PRIME}
        search = taken.search.of(taken.search.form, held)
        without = Profile(search, search.best())
    return ArcsFit(taken, best, known, flank, others, without)


def _searches(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller: float,
    base: float,
    known: Known,
) -> Iterator[ArcSearch]:
    """The search of each possible reading of the columns.

    A contour and its mirror image differ in the nose's angle alone, so the first column is read
    as it is and the others also backwards.
    """
    flats = product(*((True, False) if kind is None else (kind,) for kind in kinds))
    senses = list(product(*([(False,)] + [(False, True)] * (len(columns) - 1))))
    for flat, sense in product(flats, senses):
        form = Form(roller, sums=not all(flat) and known != "base")
        held = {PRIME: 1.0 / (base + roller)} if all(flat) or known == "both" else {}
        yield ArcSearch(columns, tuple(zip(flat, sense, strict=True)), form, held)


def _straight_if_as_near(best: Profile) -> Profile:
    """The best contour of straight flanks if the readings do not rule it out, else the best."""
    search = best.search.holding(FLANK, 0.0)
    straight = Profile(search, search.best())
    return straight if best.away(straight.squares) <= best.line(FLANK).limit else best


def _profiles(searches: list[ArcSearch]) -> Iterator[Profile]:
    """The best contour of each; of one that is far off already, only roughly."""
    rough = [search.rough() for search in searches]
    least = min(search.rms(ends[0]) for search, ends in zip(searches, rough, strict=True))
    for search, ends in zip(searches, rough, strict=True):
        far = search.rms(ends[0]) > FAR_OFF * least
        yield Profile(search, ends[0] if far else search.refined(ends))


def _unlikely(tried: Profile) -> float:
    """Schwarz's criterion (BIC): of two that are as near the one with fewer numbers is likelier."""
    count = tried.search.count
    return 2.0 * count * math.log(max(tried.rms, 1e-12)) + tried.x.size * math.log(count)
