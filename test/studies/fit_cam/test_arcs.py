"""Tests of the fit of tangent arcs to gauge readings: radii and their intervals.

A contour has a base circle, two equal flanks and a nose, all arcs that are tangent to each other.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.errors import ConfigError
from cam_rig.laws.arc_law import ArcFollower
from cam_rig.studies.fit_cam.arcs.cam_file import arcs_cam, require_identifiable
from cam_rig.studies.fit_cam.arcs.contour import Arcs, Coordinates, Parameter
from cam_rig.studies.fit_cam.arcs.search import START_FLANKS, ArcSearch, Role
from cam_rig.studies.fit_cam.arcs.selection import fit_arcs
from cam_rig.studies.fit_cam.dwells import subtract_zero
from cam_rig.studies.fit_cam.gauge import Readings, order_readings
from cam_rig.studies.fit_cam.gauge_table import read_gauge_table
from cam_rig.studies.fit_cam.outliers import exclude_outliers
from cam_rig.units import TURN

from .conftest import FLAT, ROLLER, all_around, in_order, readings_of

FINE = all_around(1000)
SMALL = ArcFollower(False, 0.002)
FOLLOWERS = {"roller": (ROLLER,), "flat": (FLAT,), "both": (ROLLER, FLAT), "small": (SMALL,)}
FLANKS = {"straight": None, "convex": 0.09, "concave": -0.15}
SHAPES = {name: Arcs(0.03, 0.01, flank, 0.012, 0.5) for name, flank in FLANKS.items()}
CASES = [(shape, followers) for shape in SHAPES for followers in ("roller", "flat", "both")]
#: Contours whose nose radius would be negative with the usual assumptions: roller 10 mm, base 30
#: mm.
SHAPES |= {"sharp": Arcs(0.02, 0.012, None, 0.002, 0.5), "big": Arcs(0.06, 0.012, 0.15, 0.008, 0.5)}
NO_NOSE = [("sharp", "small"), ("big", "flat")]


def curvature(radius):
    """Return 1/radius, which is 0 for a straight flank.

    An interval of radii that includes a straight flank is contiguous in the curvature.
    """
    with np.errstate(divide="ignore"):
        return float(1.0 / np.float64(radius))


def contains(fit, pitch, parameter):
    """Return True if the 95 % interval of a fitted parameter contains the truth.

    None is returned for a parameter that is given or assumed. `pitch` is the true pitch curve.
    """
    interval, truth = fit.intervals[parameter], fit.best.search.coordinates.of(pitch)[parameter]
    if interval.is_fixed:
        return None
    if parameter not in (Parameter.PRIME, Parameter.FLANK):
        return interval.low <= truth <= interval.high
    if interval.high == np.inf and truth <= 0.0:  # flat follower: straight or concave
        return True
    return curvature(interval.high) <= truth <= curvature(interval.low)


def coverage(shape, followers, copies):
    """Return for each parameter the fraction of copies whose interval has the truth.

    It is NaN for a parameter that is given or assumed. A copy is a set of readings with other
    noise.
    """
    arcs, kinds = SHAPES[shape], FOLLOWERS[followers]
    flats, fits = tuple(kind.flat for kind in kinds), []
    for seed in range(copies):  # every 5°, noise 20 µm, as in the commands
        read = map(subtract_zero, readings_of(arcs, *kinds, noise=2e-5, seed=seed))
        fits.append(fit_arcs(tuple(read), flats, 0.01, 0.03))
    pitch = arcs.offset(kinds[0].roller_radius)
    inside = [[contains(fit, pitch, parameter) for parameter in Parameter] for fit in fits]
    return np.array(inside, dtype=float).mean(axis=0)


@pytest.mark.long
@pytest.mark.parametrize(("shape", "followers"), CASES)
def test_200_copies(shape, followers):
    """90 to 99 % of an arc fit's 95 % intervals contain the truth.

    This is checked for each parameter. The fractions of 200 noisy copies of the readings are
    printed for docs/accuracy.md.
    """
    parts = coverage(shape, followers, 200)
    cells = ("" if np.isnan(part) else f"{100.0 * part:.1f}" for part in parts)
    print(f"| {shape} | {followers} | {' | '.join(cells)} |")
    assert (np.isnan(parts) | (parts >= 0.90) & (parts <= 0.99)).all(), parts


@pytest.mark.parametrize(("shape", "followers"), NO_NOSE)
def test_an_assumed_radius_bounds_nothing(shape, followers):
    """An assumed radius that would leave no nose arc is replaced and reported.

    The intervals of all parameters contain the truth.
    """
    arcs, (kind,) = SHAPES[shape], FOLLOWERS[followers]
    fit = fit_arcs(readings_of(arcs, kind, noise=1e-5, seed=1), (kind.flat,), 0.01, 0.03)
    assert fit.rms < 1.5e-5
    pitch = arcs.offset(kind.roller_radius)
    assert all(contains(fit, pitch, parameter) is not False for parameter in Parameter)
    assert fit.arcs.nose_radius > 0.2 * fit.arcs.base_radius * kind.flat
    assert "assumed as" in fit.not_identifiable[0]
    law = arcs_cam("mine", fit, "flat" if kind.flat else "roller").law
    assert law(FINE) == pytest.approx(arcs.lifts(kind, FINE + 0.5 - np.pi), abs=5e-5)


def test_a_given_base_radius_is_judged_when_the_fit_is_done():
    """A given base radius is checked against the final fit, not against trial fits.

    Trials that still include an outlier have another prime radius (base plus roller radius).
    """
    angles = all_around(120)
    lifts = Arcs(0.03, 0.008, 0.12, 0.010, 0.3).lifts(ROLLER, angles)
    lifts += 2e-5 * np.random.default_rng(0).standard_normal(angles.size)
    lifts[6] -= 0.6e-3
    read = Readings("a", angles, lifts, np.arange(angles.size), 1e-7, (0.0, 2 * np.pi / 120), ())
    fit = fit_arcs((exclude_outliers(read),), (False,), 0.004, 0.03, "base")
    assert fit.intervals[Parameter.PRIME].low < 0.04 < fit.intervals[Parameter.PRIME].high
    assert fit.roller_radius == pytest.approx(
        fit.intervals[Parameter.PRIME].value - 0.03, abs=1e-12
    )


def test_a_base_radius_that_leaves_no_roller_or_no_nose_is_refused():
    """A given base radius that leaves no roller or no nose arc is refused.

    The error has the limit. From the readings, base and roller radius add up to 22 mm, nose and
    roller radius to 4 mm.
    """
    columns, nose = readings_of(SHAPES["sharp"], SMALL), r"above 18(\.0\d*)? mm, because nose"
    for base, words in ((0.025, "below base and roller"), (0.015, nose)):
        with pytest.raises(ConfigError, match=words):
            fit_arcs(columns, (False,), 0.006, base, "base")


def test_readings_of_another_shape_are_not_blamed():
    """If arcs do not describe the readings, the report names the shape as the cause.

    The readings of a roller are fitted as those of a flat follower.
    """
    columns = readings_of(Arcs(0.02, 0.012, None, 0.008, 0.5), ROLLER, noise=2e-6)
    wrong, right = (fit_arcs(columns, (flat,), 0.01, 0.03) for flat in (True, False))
    words = " ".join(wrong.conclusions())
    assert "arcs do not describe the readings" in words
    assert "check them" not in words
    assert "do not describe" not in " ".join(right.conclusions())


def test_a_roller_larger_than_the_nose_of_its_path_is_contradicted():
    """A given roller radius that contradicts the readings is used and reported.

    Nose and roller radius add up to 4 mm, and a roller of 6 mm was given. The report has the
    interval of the sum.
    """
    columns = readings_of(SHAPES["sharp"], SMALL, noise=1e-5)
    wrong = fit_arcs(columns, (False,), 0.006, 0.03, "roller")
    assert wrong.roller_radius == 0.006
    (words,) = (one for one in wrong.conclusions() if "contradict the given radii" in one)
    low, high = map(float, words.split("nose and roller radius ")[1].split(" mm")[0].split(" to "))
    assert low < 4.0 < high < 4.5


def test_a_given_base_radius_of_a_flat_follower_is_used():
    """With a flat follower any given base radius that leaves a nose arc is used.

    The lifts of a flat follower do not determine the base radius.
    """
    columns = readings_of(SHAPES["convex"], FLAT, noise=1e-5)
    fit = fit_arcs(columns, (True,), 0.005, 0.03, "base")
    assert fit.arcs.base_radius == pytest.approx(0.03)
    assert fit.arcs.nose_radius == pytest.approx(0.012, abs=2e-4)
    assert fit.intervals[Parameter.PRIME].origin == "given"


#: Cases that the search solves only with one of its start values. The key is the relative curvature
#: of the flank at this start. The value is the contour, the follower and the number of readings.
CASES_OF_STARTS = {
    0.3: (Arcs(0.04, 0.012, -0.1, 0.012, 0.5), ArcFollower(False, 0.04), 72),  # large roller
    0.7: (Arcs(0.04, 0.02, 0.15, 0.005, 1.0), FLAT, 24),  # sharp nose under a flat face
    -0.3: (Arcs(0.02, 0.012, None, 0.02, 3.0), ROLLER, 24),  # nose as large as the base circle
}


@pytest.mark.parametrize("curvature", START_FLANKS)
def test_each_start_of_the_search_has_a_case(curvature, monkeypatch):
    """Each start value of the search for arcs is necessary for one of the cases.

    With all start values the residual is below the noise of 1 µm. Without this start it is above 2
    µm.
    """
    arcs, follower, count = CASES_OF_STARTS[curvature]
    noise = np.random.default_rng(0).normal(scale=1e-6, size=count)
    column = in_order(all_around(count), arcs.lifts(follower, all_around(count)) + noise)
    search = ArcSearch(
        columns=(subtract_zero(column),),
        roles=(Role(follower.flat, is_reversed=False),),
        coordinates=Coordinates(rolling=not follower.flat, sums=not follower.flat),
        fixed={Parameter.PRIME: 0.5} if follower.flat else {},
    )
    assert search.rms(search.solve()) < 1e-6
    others = tuple(other for other in START_FLANKS if other != curvature)
    monkeypatch.setattr("cam_rig.studies.fit_cam.arcs.search.START_FLANKS", others)
    assert search.rms(search.solve()) > 2e-6


# -- fits to the measured table of the GUNT GL 110, and to random contours


@pytest.fixture(scope="module")
def gl110(config_dir):
    """Readings of both lift columns of the shipped table of the GUNT GL 110."""
    table = read_gauge_table(config_dir / "cams" / "gunt_gl110_convex.csv")
    return tuple(subtract_zero(order_readings(table, column)) for column in table.columns)


@pytest.fixture(scope="module")
def gl110_fit(gl110):
    """Fit of tangent arcs to the readings of the GUNT GL 110 cam."""
    return fit_arcs(gl110, (None, None), 0.010, 0.03)


def random_arcs(seed):
    """Return a random convex contour of arcs for a flat follower, with any nose angle."""
    rng = np.random.default_rng(seed)
    base, lift = rng.uniform(0.02, 0.05), rng.uniform(0.006, 0.014)
    nose = rng.uniform(0.3, 0.7) * base
    least = base + 0.5 * lift
    return Arcs(base, lift, least * rng.uniform(1.6, 4.0), nose, rng.uniform(-3.0, 3.0))


def test_the_shipped_cam_is_the_fit(cams, laws, gl110, gl110_fit):
    """The numbers in the shipped GL 110 cam file are those of the fit, rounded.

    The GL 110 is a teaching apparatus of GUNT. Five numbers describe 66 readings within 0.07 mm
    r.m.s. Exchanged followers are ten times worse. The law is 0.063 mm r.m.s. from the roller's
    readings, as stated in docs/own_cam.md.
    """
    assert sum(column.residuals.size for column in gl110_fit.fitted_columns) == 66
    assert sum(math.isfinite(interval.error) for interval in gl110_fit.intervals) == 5
    assert all(column.rms <= 0.07e-3 for column in gl110_fit.fitted_columns)
    swapped = [one.rms for one in gl110_fit.others if "lift_a_mm flat" in one.search.name]
    assert min(swapped) > 10.0 * gl110_fit.rms
    cam, arcs = cams["gunt_gl110"], gl110_fit.arcs
    segment = cam.segments[0]
    written = [cam.lift, cam.follower.base_radius, segment.flank_radius, segment.nose_radius]
    found = [arcs.lift, arcs.base_radius, arcs.flank_radius, arcs.nose_radius]
    assert [number.si for number in written] == pytest.approx(found, abs=6e-7)
    angles = gl110[0].angles - arcs.nose_angle + math.pi
    away = laws["gunt_gl110"](angles) - gl110[0].lifts
    assert np.sqrt(np.mean(away**2)) * 1e3 == pytest.approx(0.063, abs=0.0005)


def test_base_and_roller_radius_are_identifiable_as_a_sum(gl110, gl110_fit):
    """The fit identifies base and roller radius only as a sum, and reports this.

    Another assumed roller radius gives the same lifts.
    """
    roller = 0.016
    other = fit_arcs(gl110, (False, True), roller, 0.03)
    assert other.rms == pytest.approx(gl110_fit.rms, rel=1e-6)
    assert other.numbers == pytest.approx(gl110_fit.numbers, rel=1e-4)
    assert other.arcs.base_radius == pytest.approx(gl110_fit.arcs.base_radius + 0.01 - roller, 1e-4)
    assert "only as a sum" in gl110_fit.not_identifiable[0]


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("seed", "kinds"), [(1, (False, True)), (0, (None, None)), (3, (False, True))]
)
def test_a_random_contour_comes_back(seed, kinds):
    """Readings of two followers determine a random contour of arcs.

    They also determine the types of the followers and the turning sense. One column is read with
    the cam turned backwards. The types of the followers are given or not. The radii are found
    within 1e-4, relative.
    """
    arcs = random_arcs(seed)
    columns = readings_of(arcs, ROLLER, FLAT, reverse=(1,))
    fit = fit_arcs(columns, kinds, 0.01, 0.03)
    assert [column.kind for column in fit.fitted_columns] == ["roller", "flat"]
    assert [column.is_reversed for column in fit.fitted_columns] == [False, True]
    assert fit.rms < 1e-8
    for key in ("base_radius", "lift", "flank_radius", "nose_radius"):
        assert getattr(fit.arcs, key) == pytest.approx(getattr(arcs, key), rel=1e-4)
    assert abs(math.remainder(fit.arcs.nose_angle - arcs.nose_angle, TURN)) < 1e-5


def test_a_flat_follower_alone_identifies_differences():
    """With a flat follower alone, radii are known only minus the base radius.

    The base radius is assumed and has no interval.
    """
    arcs = random_arcs(2)
    columns = readings_of(arcs, FLAT)
    one, other = (fit_arcs(columns, (True,), 0.01, base) for base in (0.03, 0.06))
    assert one.rms < 1e-8
    assert other.rms < 1e-8
    assert one.intervals[Parameter.PRIME].origin == "assumed"
    assert one.numbers[2:4] == pytest.approx(other.numbers[2:4], rel=1e-5)
    assert one.numbers[3] == pytest.approx(arcs.nose_radius - arcs.base_radius, rel=1e-4)
    assert "less the base radius" in one.not_identifiable[0]


def test_a_flat_follower_alone_identifies_the_flank():
    """The search finds the flank of a contour from readings of a flat follower alone.

    Only the start value with a large, fixed base circle leads to it. The residual must be the
    noise.
    """
    fit = fit_arcs(readings_of(random_arcs(4), FLAT, noise=1e-5), (True,), 0.01, 0.03)
    assert fit.rms < 1.2e-5


def test_a_tangent_cam_under_both_followers():
    """Readings of a roller and a flat follower identify a tangent cam and its radii.

    A tangent cam has straight flanks, which a flat follower bridges.
    """
    arcs = Arcs(0.03, 0.01, None, 0.012, 0.5)
    fit = fit_arcs(readings_of(arcs, ROLLER, FLAT, noise=1e-4), (False, True), 0.01, 0.03)
    assert fit.arcs.flank == "straight"
    assert fit.arcs.base_radius == pytest.approx(0.03, abs=1e-3)
    assert any("a tangent cam" in words for words in fit.conclusions())


def test_straight_flanks_are_used_unless_excluded_or_curved_is_given():
    """A flank that may be straight is fitted as straight, unless curved is requested.

    With noise of 0.1 mm a roller does not distinguish the two. The interval of the flank radius
    then includes a straight flank.
    """
    arcs = Arcs(0.03, 0.01, 1.0, 0.012, 0.5)
    columns = readings_of(arcs, ROLLER, noise=1e-4)
    fit = fit_arcs(columns, (False,), 0.01, 0.03)
    assert fit.arcs.flank == "straight"
    assert fit.intervals[Parameter.FLANK].over_straight
    assert fit.intervals[Parameter.FLANK].low < 1.01
    curved = fit_arcs(columns, (False,), 0.01, 0.03, None, "curved")
    assert curved.arcs.flank != "straight"
    straight = fit_arcs(columns, (False,), 0.01, 0.03, None, "straight")
    primes = [result.intervals[Parameter.PRIME] for result in (straight, fit)]
    widths = [interval.high - interval.low for interval in primes]
    assert widths[0] < 0.2 * widths[1]


def test_lifts_under_a_roller_alone_do_not_identify_the_base_radius():
    """No cam file is written if the readings do not determine the base radius.

    With noise of 0.1 mm its interval has no upper limit. A given base radius is accepted.
    """
    columns = readings_of(Arcs(0.03, 0.01, 0.09, 0.012, 0.5), ROLLER, noise=1e-4)
    fit = fit_arcs(columns, (False,), 0.01, 0.03, None, "curved")
    assert fit.intervals[Parameter.PRIME].high == math.inf
    bridged = readings_of(Arcs(0.03, 0.01, None, 0.012, 0.5), FLAT, noise=1e-4)
    straight = fit_arcs(bridged, (False,), 0.01, 0.03)
    assert straight.arcs.flank == "straight"
    for one in (fit, straight):
        with pytest.raises(ConfigError, match=r"do not identify the base radius: .* is above"):
            require_identifiable(one, is_kind_given=True)
    given = fit_arcs(columns, (False,), 0.01, 0.03, "both", "curved")
    require_identifiable(given, is_kind_given=True)
    assert given.intervals[Parameter.PRIME].origin == "given"


def test_a_column_that_any_follower_may_have_made():
    """Lift readings that fit any type of follower are refused without --follower.

    Lifts of a flat follower, for example, could be those of a roller on a huge cam.
    """
    columns = readings_of(Arcs(0.03, 0.01, 0.2, 0.012, 0.5), FLAT, noise=1e-4)
    fit = fit_arcs(columns, (None,), 0.01, 0.03)
    assert fit.other_kinds is not None
    with pytest.raises(ConfigError, match=r"do not identify the follower: .* allowed: --follower"):
        require_identifiable(fit, is_kind_given=False)


def test_the_farthest_reading_is_named_with_its_line():
    """The reading farthest from the fitted law is reported with its line, but used.

    It is off by 0.1 mm, five times the scatter.
    """
    arcs = Arcs(0.03, 0.01, 0.09, 0.012, 0.5)
    (column,) = readings_of(arcs, ROLLER, noise=2e-5)
    lifts = column.lifts.copy()
    lifts[10] += 1e-4
    fit = fit_arcs((replace(column, lifts=lifts),), (False,), 0.01, 0.03)
    (named,) = [words for words in fit.conclusions() if "farthest from the law" in words]
    assert f"line {column.lines[10]} (" in named


def readings_of_a_bridge(seed, slips=()):
    """Return readings of a flat follower on flanks that it bridges, and slip lines.

    From the base circle to the nose the velocity has a step. There are 36 to 360 readings with
    noise of 1 to 50 µm. `slips` are errors of single readings in standard deviations. The two
    readings on either side of a slip are on the same circle as the slip. The lines are those of a
    file with a heading.
    """
    rng = np.random.default_rng(seed)
    base, nose = rng.uniform(0.02, 0.05), rng.uniform(0.2, 0.7)
    flank = rng.choice([None, -rng.uniform(0.05, 0.3)])
    arcs = Arcs(base, rng.uniform(0.006, 0.014), flank, nose * base, rng.uniform(-3.0, 3.0))
    count, noise = int(rng.choice([36, 72, 120, 360])), 10.0 ** rng.uniform(-6.0, -4.3)
    angles = all_around(count)
    exact = arcs.lifts(FLAT, angles)
    lifts, on_nose = exact + rng.normal(scale=noise, size=count), (exact > 0.0).astype(int)
    one_circle = np.isin(sum(np.roll(on_nose, step) for step in range(-2, 3)), [0, 5])
    places = sorted(rng.choice(np.flatnonzero(one_circle), len(slips), replace=False))
    for place, slip in zip(places, slips, strict=True):
        lifts[place] += slip * noise
    return subtract_zero(in_order(angles, lifts)), [place + 2 for place in places]


def test_readings_at_a_kink_that_neighbours_and_arcs_contradict_are_kept():
    """Two good readings at a step of the velocity are kept in the fit.

    Their neighbours contradict them. Arcs through all other readings contradict them too, but arcs
    through all readings do not.
    """
    readings, _ = readings_of_a_bridge(19)
    assert readings.outliers
    fit = fit_arcs((readings,), (True,), 0.01, 0.05)
    assert fit.fitted_columns[0].readings.outliers == ()


@pytest.mark.variants(1)
@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.long)])
@pytest.mark.parametrize("slips", [(), (10.0,), (-10.0,), (-40.0,)])
def test_readings_beside_a_step_of_velocity_are_no_outliers_and_slips_are(count, slips):
    """Next to a step of velocity no good reading is excluded, and slips are reported.

    Outliers are judged by the arcs, because neighbours contradict good readings at such a step. A
    slip is reported as an outlier or as the reading farthest from the law. One slip in fifty may be
    missed, because the lowest reading can be taken for the zero.
    """
    missed = wrong = 0
    for seed in range(count):
        readings, lines = readings_of_a_bridge(seed, slips)
        wrong += len(readings.outliers)
        fit = fit_arcs((readings,), (True,), 0.01, 0.05)
        left = [one.line for one in fit.fitted_columns[0].readings.outliers]
        assert set(left) <= set(lines), seed
        assert fit.best.search.count + len(left) == readings.angles.size + len(readings.outliers)
        words = " ".join(fit.conclusions())
        missed += not all(f"line {line} " in words for line in lines)
    assert missed <= count // 50
    assert slips or wrong  # neighbours contradict some good readings
