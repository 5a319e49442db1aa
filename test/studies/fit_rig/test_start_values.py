"""Tests of the start values of the rig fit, one for each heuristic.

Each test has a case that needs the heuristic.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.studies.fit_rig.run.fit import fit_run
from cam_rig.studies.fit_rig.run.force_zero import add_zero_offset
from cam_rig.studies.fit_rig.run.instruments import FORCE_ZERO
from cam_rig.studies.fit_rig.run.likelihood import Likelihood
from cam_rig.studies.fit_rig.run.likelihood_ratio import contradicts
from cam_rig.studies.fit_rig.run.models import MIN_ELASTIC_LOG_RATIO, extend_solution
from cam_rig.studies.fit_rig.run.restitution_start import free_restitution, search_restitution
from cam_rig.studies.fit_rig.run.search import Candidate, FitSolution, continue_from, search
from cam_rig.studies.fit_rig.run.start import rough_start
from cam_rig.studies.fit_rig.run.stem_start import find_stem, has_residual_pattern
from cam_rig.studies.fit_rig.run.turns import measured_segments
from cam_rig.units import TURN

from .machines import numbers_of

ERRORS = InstrumentErrors(rate=800, encoder_rate=800)
FREE = ("mass", "spring_stiffness", "preload", "damping")
IN_CONTACT, WITH_FLIGHTS = (200.0, 280.0, 340.0), (200.0, 350.0, 460.0)


def align(law, run, values):
    """Return the solution of a run in which only instrument errors are fitted.

    The follower has the parameters `values`.
    """
    segments = measured_segments(run)[1]
    _, phase, zero = rough_start(law, segments, values)
    likelihood = Likelihood(law, segments, (), values, None)
    likelihood.force_noise = 0.01 * max(segment.force.value.max() for segment in segments)
    return search(Candidate(likelihood, likelihood.start(values, phase, zero)))


@pytest.fixture(scope="module")
def flying(law, rig):
    """Solution of three speeds in which only instrument errors are fitted.

    One speed has flights. The true restitution is 0.6.
    """
    run = measured_run(law, rig.with_follower(restitution=0.6), "one_mass", WITH_FLIGHTS, ERRORS, 1)
    return align(law, run, numbers_of(rig) | {"restitution": 0.6})


def test_a_partial_solution_is_extended_to_all_speeds(flying):
    """The encoder's phases at all speeds follow from a fit of some of the speeds.

    The phase is the cam angle minus the encoder angle. With several fitted speeds the phases are on
    a line. A single fitted speed shifts all by its change.
    """
    for indices in ([0, 1], [1]):
        partial = search(continue_from(flying, FREE, flying.values, indices))
        extended = extend_solution(flying, partial)
        phases = [fit.x[fit.likelihood.instruments.phases] for fit in (extended, flying)]
        assert phases[0] == pytest.approx(phases[1], abs=0.01)
        assert extended.values == partial.values


def test_a_sensor_shows_its_zero_in_flight(law, rig):
    """A force sensor's reading in flight corrects the start value of the preload.

    In flight the force is zero, so the reading is the zero error. An error of −12 N raises the
    start value by 12 N. Without flights the start is unchanged.
    """
    run = measured_run(law, rig, "one_mass", WITH_FLIGHTS, ERRORS, 1)
    run = replace(run, force=replace(run.force, value=run.force.value - 12.0))
    aligned = align(law, run, numbers_of(rig) | {"restitution": 0.0})
    start = continue_from(aligned, ("preload",), aligned.values)
    offset = add_zero_offset(start)
    assert offset.likelihood.single(offset.x, FORCE_ZERO) == pytest.approx(-12.0, abs=0.5)
    assert offset.values["preload"] - start.values["preload"] == pytest.approx(12.0, abs=0.5)
    in_contact = continue_from(aligned, FREE, aligned.values, [0, 1])
    assert add_zero_offset(in_contact) is in_contact


@pytest.mark.slow
def test_all_restitutions_are_tried_before_a_search(flying):
    """The search for a restitution starts from the best of many values.

    Started from 0 it would stop in a local maximum, more than 0.1 off.
    """
    start = continue_from(flying, FREE, flying.values | {"restitution": 0.0})
    found = search_restitution(start, {})
    assert found.values["restitution"] == pytest.approx(0.6, abs=0.02)
    low = continue_from(flying, (*FREE, "restitution"), flying.values | {"restitution": 0.0})
    assert abs(search(low).values["restitution"] - 0.6) > 0.1


def test_a_restitution_without_information_stays_at_its_value(law, rig):
    """Without landings a free restitution and the other parameters stay unchanged."""
    run = measured_run(law, rig, "one_mass", IN_CONTACT, ERRORS, 1)
    aligned = align(law, run, numbers_of(rig) | {"restitution": 0.25})
    fixed = search(continue_from(aligned, FREE, aligned.values))
    free = free_restitution(fixed, (*FREE, "restitution"))
    assert free.likelihood.free == (*FREE, "restitution")
    assert free.values["restitution"] == pytest.approx(0.25, abs=1e-6)
    assert free.values["mass"] == pytest.approx(fixed.values["mass"], rel=1e-4)


def test_noise_gives_no_stem(law, rig, paper_rig):
    """An elastic stem is suggested only if the one-mass residuals have a pattern.

    For data of one rigid mass the residual is noise. For data of two masses the suggested stem has
    the true natural frequency within 3 %.
    """
    for model, other in (("one_mass", rig), ("two_mass", paper_rig)):
        run = measured_run(law, other, model, IN_CONTACT, ERRORS, 2)
        aligned = align(law, run, numbers_of(other) | {"restitution": 0.0})
        one_mass = search(continue_from(aligned, FREE, aligned.values))
        stem, gain = find_stem(one_mass)
        assert has_residual_pattern(one_mass) == (model == "two_mass")
        assert (gain > MIN_ELASTIC_LOG_RATIO) == (model == "two_mass")
    follower = paper_rig.follower
    end_mass = follower.mass.si * (1.0 - follower.roller_share.si)
    true = np.sqrt((follower.stem_stiffness.si + follower.spring_stiffness.si) / end_mass)
    end_mass = one_mass.values["mass"] * (1.0 - stem["roller_share"])
    rate = np.sqrt((stem["stem_stiffness"] + one_mass.values["spring_stiffness"]) / end_mass)
    assert rate / TURN == pytest.approx(true / TURN, rel=0.03)


def test_parameters_of_all_speeds_may_contradict_some(flying):
    """A mass that is 5 % off is reported to contradict a fit of some of the speeds.

    The unchanged parameters do not contradict it.
    """
    partial = search(continue_from(flying, FREE, flying.values, [0, 1]))
    for factor, contradictory in ((1.0, False), (1.05, True)):
        values = partial.values | {"mass": factor * partial.values["mass"]}
        start = continue_from(flying, FREE, values)
        likelihood = start.likelihood
        whole = FitSolution(
            likelihood, start.x, likelihood.jacobian(start.x), likelihood.residuals(start.x)
        )
        assert contradicts(partial, whole) == contradictory


@pytest.mark.long
def test_a_ringing_sensor_is_no_stem(law, rig):
    """A force sensor that rings after landings is fitted with a resonance.

    The ringing, in which the reading is negative at times, is not taken for an elastic stem.
    """
    errors = InstrumentErrors(sensor_frequency=300.0, sensor_damping=0.01)
    other = rig.with_follower(restitution=0.2)
    run = measured_run(law, other, "one_mass", (200.0, 330.0, 470.0), errors, 1)
    assert any(segment.rings for segment in measured_segments(run)[1])
    fit = fit_run(law, run, rig)
    assert fit.model == "one_mass"
    values = {number.key: number.value for number in fit.instruments}
    assert values["force_sensor_resonance"] == pytest.approx(300.0, rel=0.01)
