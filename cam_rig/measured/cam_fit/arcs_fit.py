"""One contour of tangent arcs through the readings of one or several followers at once.

The least squares of `ArcSearch` for every way in which the columns may have been read, and of
the likeliest once more with straight flanks: these are taken where the readings do not rule them
out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from cam_rig.errors import LawError
from cam_rig.measured.cam_fit.arcs import FLANK, PRIME, ArcSearch, Form
from cam_rig.measured.cam_fit.arcs_intervals import Profile
from cam_rig.measured.cam_fit.arcs_result import ArcsFit, Flank, Known
from cam_rig.measured.cam_fit.gauge import OUTLIER, Readings, judged_by, with_outliers

#: Outliers are judged by the arcs, and the arcs are fitted again, at most so many times.
ROUNDS = 4
#: A contour whose lifts are off the readings by this part of the lift, r.m.s., is another one.
FAR = 0.05
#: A reading of the columns that leaves so many times the least residual is not refined.
FAR_OFF = 2.0


def fit_arcs(
    columns: tuple[Readings, ...],
    kinds: tuple[bool | None, ...],
    roller_radius: float,
    base_radius: float,
    known: Known = None,
    flank: Flank = None,
) -> ArcsFit:
    """Fit one contour to all columns, above their zero; of unnamed ones the kind is found too.

    ``kinds``: for each column whether its follower is flat, None tries both; ``roller_radius``: m,
    0 for a point; ``base_radius``: m, taken where all followers are flat, for nothing is told of it
    then, and where both radii are known; ``known``: which of them is given; ``flank``: None takes a
    straight one unless the readings rule it out. Which readings are outliers, the arcs say: a good
    one beside a kink, where a flat face passes from base circle to nose, is contradicted by its
    neighbours alone, and hides one that is none.
    """

    def fit(columns: tuple[Readings, ...]) -> ArcsFit:
        searches = _searches(columns, kinds, roller_radius, base_radius, known)
        return _fitted(columns, searches, known, flank)

    found = _settled(fit, columns)
    if any(column.readings.outliers for column in found.fitted_columns):
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
            judged_by(one.readings, partial(one.lifts, found.arcs)) for one in found.fitted_columns
        )
        left = [one.readings.lines for one in found.fitted_columns]
        if all(np.array_equal(one.lines, two) for one, two in zip(judged, left, strict=True)):
            break
        found = fit(judged)
    return found


def _explains(whole: ArcsFit, found: ArcsFit) -> bool:
    """Whether a contour takes readings as good that another leaves out, none off as an outlier."""
    more = whole.best.search.count - found.best.search.count
    return more > 0 and whole.best.squares - found.best.squares < more * (OUTLIER * found.rms) ** 2


def _fitted(
    columns: tuple[Readings, ...], searches: Iterable[ArcSearch], known: Known, flank: Flank
) -> ArcsFit:
    if flank == "straight":
        searches = (search.holding(FLANK, 0.0) for search in searches)
    tried = sorted(_profiles(list(searches)), key=_unlikely)
    highest = max(float(column.lifts.max()) for column in columns)
    if tried[0].rms >= FAR * highest:
        raise LawError(
            f"{columns[0].name}: no base circle, two equal flanks and a nose come near the "
            "readings; allowed: a symmetric cam, else --shape spline"
        )
    best, *rest = tried
    taken = best if flank else _straight_if_as_near(best)
    without = None
    if known == "both" and not all(best.search.flats):
        held = {index: value for index, value in taken.search.held.items() if index != PRIME}
        search = replace(taken.search, held=held)
        without = Profile(search, search.best())
    return ArcsFit(taken, best, known, flank, tuple(rest), without)


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
