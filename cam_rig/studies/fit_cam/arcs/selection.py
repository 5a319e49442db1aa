"""Selection of one contour of tangent arcs for the readings of one or several followers.

An interpretation of the columns is the type of follower (flat or not) and the turning sense of each
column. An `ArcSearch` fits each possible interpretation. The likeliest is fitted again with
straight flanks, which are used if the readings do not rule them out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from cam_rig.errors import LawError
from cam_rig.studies.fit_cam.arcs.contour import Coordinates, Parameter
from cam_rig.studies.fit_cam.arcs.profile_likelihood import Profile
from cam_rig.studies.fit_cam.arcs.radii import (
    GivenRadii,
    Radii,
    contour_of_pitch_curve,
    require_roller,
)
from cam_rig.studies.fit_cam.arcs.result import ArcsFit, Flank
from cam_rig.studies.fit_cam.arcs.search import FINAL_RTOL, NO_CLOSE_CONTOUR, ArcSearch, Role
from cam_rig.studies.fit_cam.gauge import Readings
from cam_rig.studies.fit_cam.outliers import (
    MIN_OUTLIER_SCATTERS,
    exclude_outliers_from,
    include_outliers,
)

Columns = tuple[Readings, ...]

#: Largest number of repetitions in which outliers are determined from the fitted arcs and the arcs
#: are fitted again.
MAX_OUTLIER_ROUNDS = 4
#: R.m.s. residual, as a fraction of the lift, above which no contour of arcs is accepted. The
#: tables of cams of other shapes have larger residuals.
MAX_RMS_RATIO = 0.05
#: Base radius, as a multiple of the lift, in a search with only flat followers and no given base
#: radius. It has no effect on the lifts, and is so large that it does not limit the contour.
FREE_BASE_LIFTS = 100.0
#: If the ratio of the nose radius of the fitted pitch curve to its lower bound (a given roller
#: radius) is below this value, the search has ended at the bound.
BOUND_RATIO = 1.01
#: An interpretation of the readings is refined by a final search only if its r.m.s. residual is at
#: most this multiple of the smallest. A rough search ends close to its minimum, so refinement does
#: not change the order at larger ratios.
MAX_REFINED_RATIO = 2.0
#: Lower limit of the r.m.s. residual (m) in the likelihood, for exact lifts. It is far below that
#: of any gauge.
MIN_RMS = 1e-12


def fit_arcs(
    columns: Columns,
    kinds: tuple[bool | None, ...],
    roller_radius: float,
    base_radius: float,
    given_radii: GivenRadii = None,
    flank: Flank = None,
) -> ArcsFit:
    """Fit one contour of tangent arcs to the readings of all columns.

    The lifts are above the zero of their column. Outliers are those readings that contradict the
    fitted arcs. Neighbouring readings are not used for this purpose, because a flat follower can
    pass from base circle to nose with a kink, at which a good reading disagrees with its
    neighbours.

    Parameters
    ----------
    columns : tuple of Readings
        Readings of each column.
    kinds : tuple of (bool or None)
        For each column True if its follower is flat, False if not, None to try both.
    roller_radius : float
        Roller radius in m, 0 for a point.
    base_radius : float
        Base radius in m, used if all followers are flat, because they do not determine it, and if
        both radii are given.
    given_radii : {'base', 'roller', 'both'}, optional
        Radii that are given (default: no radius). A radius limits the search only if it is given.
        An assumed radius that leaves too little radius for the nose is replaced.
    flank : {'straight', 'curved'}, optional
        Shape of the flanks (default: straight unless the readings rule it out).

    Returns
    -------
    ArcsFit
        Fit of the likeliest contour.

    Raises
    ------
    LawError
        If no contour is close to the readings.
    ConfigError
        If the given base radius leaves no roller or no nose.
    """
    radii = Radii(roller_radius, base_radius, given_radii)

    def fit(columns: Columns) -> ArcsFit:
        searches = _searches(columns, kinds, radii)
        if flank == "straight":
            searches = (search.fix(Parameter.FLANK, 0.0) for search in searches)
        return _select(list(searches), radii, flank)

    result = _fit_without_outliers(fit, columns)
    if any(column.readings.outliers for column in result.fitted_columns):
        # A flat follower passes from base circle to nose with a kink on each side. Good readings at
        # both kinks can be outliers from the arcs that fit the other readings, but not from the
        # arcs that fit all. The fit is therefore repeated with all readings. A very wrong reading
        # can make this fit impossible.
        with suppress(LawError):
            other = _fit_without_outliers(fit, tuple(map(include_outliers, columns)))
            # This fit is used if it excludes fewer readings, and if on average the added readings
            # are not outliers.
            added = other.best.search.count - result.best.search.count
            added_sse = other.best.sse - result.best.sse
            if added > 0 and added_sse < added * (MIN_OUTLIER_SCATTERS * result.rms) ** 2:
                result = other
    if given_radii == "base" and not result.only_flat:
        pitch = result.best.search.pitch(result.best.x)
        interval = result.intervals[Parameter.PRIME].interval_text
        require_roller(base_radius, pitch, interval)
    return result


def _fit_without_outliers(fit: Callable[[Columns], ArcsFit], columns: Columns) -> ArcsFit:
    """Return a fit of arcs from which outliers are excluded.

    Outliers are readings far from the fitted arcs. ``fit`` fits arcs to ``columns`` of readings. It
    is repeated until the outliers no longer change, at most `MAX_OUTLIER_ROUNDS` times. The last
    fit is returned.
    """
    result = fit(columns)
    for _ in range(MAX_OUTLIER_ROUNDS):
        fitted = result.fitted_columns
        columns = tuple(
            exclude_outliers_from(partial(column.lifts, result.arcs), column.readings)
            for column in fitted
        )
        if all(
            np.array_equal(new.lines, column.readings.lines)
            for new, column in zip(columns, fitted, strict=True)
        ):
            break
        result = fit(columns)
    return result


# Search for the likeliest interpretation of the columns.


def _searches(
    columns: Columns, kinds: tuple[bool | None, ...], radii: Radii
) -> Iterator[ArcSearch]:
    """Yield one search for each possible interpretation of the columns.

    ``kinds`` are True for a flat follower, False for another, None if unknown. A contour and its
    mirror image differ only in the angle of the nose. The sense of the first column is therefore
    not reversed. The other columns are tried in both senses.
    """
    free_base = FREE_BASE_LIFTS * max(float(column.lifts.max()) for column in columns)
    all_flats = product(*((True, False) if kind is None else (kind,) for kind in kinds))
    all_senses = list(product(*([(False,)] + [(False, True)] * (len(columns) - 1))))
    for flats, senses in product(all_flats, all_senses):
        sums = not all(flats) and radii.given != "base"
        coordinates = Coordinates(rolling=radii.roller > 0.0, sums=sums)
        fixed, min_radius = dict[Parameter, float](), 0.0
        if all(flats):
            fixed[Parameter.PRIME] = 1.0 / (radii.base if radii.is_base_given else free_base)
        elif radii.is_roller_given:
            min_radius = radii.roller
            if radii.is_base_given:
                fixed[Parameter.PRIME] = 1.0 / (radii.base + radii.roller)
        yield ArcSearch(columns, tuple(map(Role, flats, senses)), coordinates, fixed, min_radius)


def _select(searches: list[ArcSearch], radii: Radii, flank: Flank) -> ArcsFit:
    """Solve all searches, and return the fit of the likeliest interpretation.

    Straight flanks are used if the readings do not rule them out, unless the shape ``flank`` is
    given. Raises LawError if no contour is close to the readings.
    """
    curved, *others = _solve_all(searches)
    columns = curved.search.columns
    if curved.rms >= MAX_RMS_RATIO * max(float(column.lifts.max()) for column in columns):
        raise LawError(f"{columns[0].name}: {NO_CLOSE_CONTOUR}")
    best = curved
    if not flank:
        search = curved.search.fix(Parameter.FLANK, 0.0)
        straight = Profile(search, search.solve())
        if not curved.excludes(Parameter.FLANK, straight.sse):
            best = straight
    pitch, is_flat = best.search.pitch(best.x), all(best.search.flats)
    arcs, roller_radius, other_radius = contour_of_pitch_curve(pitch, is_flat, radii)
    without_radii = None
    is_at_bound = pitch.nose_radius < BOUND_RATIO * best.search.min_radius
    if not is_flat and (radii.given == "both" or is_at_bound):
        fixed = dict(best.search.fixed)
        fixed.pop(Parameter.PRIME, None)
        search = replace(best.search, fixed=fixed, min_radius=0.0)
        without_radii = Profile(search, search.solve())
    return ArcsFit(
        best=best,
        curved=curved,
        given_radii=radii.given,
        flank=flank,
        others=tuple(others),
        arcs=arcs,
        roller_radius=roller_radius,
        other_radius=other_radius,
        without_radii=without_radii,
    )


def _solve_all(searches: list[ArcSearch]) -> list[Profile]:
    """Return the best contour of each search, the likeliest first.

    The order is that of Schwarz's criterion (BIC): of two contours that are equally close to the
    readings, that with fewer free parameters is likelier. A contour with a far larger residual than
    the smallest is not refined, which saves a quarter of the time for two columns.
    """
    rough = [Profile(search, search.rough_minimum()) for search in searches]
    limit = MAX_REFINED_RATIO * min(profile.rms for profile in rough)
    profiles = [
        replace(profile, x=profile.search.minimize(profile.x, FINAL_RTOL))
        if profile.rms <= limit
        else profile
        for profile in rough
    ]

    def criterion(profile: Profile) -> float:
        count = profile.search.count
        likelihood = 2.0 * count * math.log(max(profile.rms, MIN_RMS))
        return likelihood + profile.x.size * math.log(count)

    return sorted(profiles, key=criterion)
