"""Tests of the rig fit's standard errors: 95 % intervals contain the truth.

They must do so as often as stated. `pytest -m long -s test/studies/fit_rig/test_coverage.py` prints
a table of 200 machines.
"""

import itertools
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.studies.fit_rig.run.covariance import sandwich_covariance
from cam_rig.studies.fit_rig.run.fit import fit_run
from cam_rig.studies.fit_rig.run.likelihood import Likelihood
from cam_rig.studies.fit_rig.run.likelihood_ratio import log_ratio, log_ratio_of_all
from cam_rig.studies.fit_rig.run.search import Candidate, search
from cam_rig.studies.fit_rig.run.turns import measured_segments

from .machines import NOISES, coverage, jump_rpm, numbers_of, scores_of

MACHINES = 200


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.timeout(14_400)
def test_intervals_of_200_machines_contain_the_truth():
    """Of the 95 % intervals of 200 random machines, 90 to 99 % contain the truth.

    A machine is a simulated rig. The machines have one and two masses, contact and landings, and
    three kinds of noise.
    """
    # Forked, because a spawned worker would import Python's own package `test`.
    with ProcessPoolExecutor(2, get_context("fork")) as pool:
        found = list(itertools.chain.from_iterable(pool.map(scores_of, range(MACHINES))))
    groups, titles = {}, ("model", "speeds", "noise", "number", "all")
    for score in found:
        for group in zip(titles, (*score.kind, score.name, "all"), strict=True):
            groups.setdefault(group, []).append(score)
    for (title, kind), scores in sorted(groups.items(), key=lambda row: titles.index(row[0][0])):
        scatter = math.sqrt(np.mean([score.errors**2 for score in scores]))  # r.m.s. score
        machines = len({score.seed for score in scores})
        within = f"{100.0 * coverage(scores):.1f} %"
        print(f"| {title}: {kind} | {machines} | {len(scores)} | {within} | {scatter:.2f} |")
    for group in (*(("noise", noise) for noise in NOISES), ("all", "all")):
        assert 0.90 <= coverage(groups[group]) <= 0.99, group


@pytest.fixture(scope="module")
def solution(law, rig):
    """Solution of a fit of one rigid mass that stays in contact with the cam."""
    errors = InstrumentErrors(rate=400, encoder_rate=400)
    run = measured_run(law, rig, "one_mass", (200.0, 300.0, 350.0), errors, 1)
    return fit_run(law, run, rig, "one_mass").solution


def test_errors_of_correlated_noise_are_those_of_many_draws(solution):
    """The covariance under correlated noise agrees with that of 2000 random draws.

    The correlation is 0.9ᵏ for samples k apart. The draws use the linear response x = −(JᵀJ)⁻¹ Jᵀ
    noise with the Jacobian J. The standard errors agree within 20 %.
    """
    random = np.random.default_rng(0)
    like, jacobian = solution.likelihood, solution.jacobian
    noise = np.zeros((2000, jacobian.shape[0]))
    at = 0
    for segment, kept in zip(like.segments, like.force_masks, strict=True):
        for size in (segment.lift.value.size, int(kept.sum())):
            noise[:, at] = random.standard_normal(2000)
            for k in range(at + 1, at + size):
                noise[:, k] = 0.9 * noise[:, k - 1] + math.sqrt(0.19) * random.standard_normal(2000)
            at += size
    noise[:, at:] = random.standard_normal((2000, jacobian.shape[0] - at))
    drawn = np.linalg.lstsq(jacobian, noise.T, rcond=None)[0].std(axis=1)
    errors = [sandwich_covariance(replace(solution, residuals=one)).errors for one in noise[:40]]
    first = slice(0, like.instruments.first)
    assert np.mean(errors, axis=0)[first] == pytest.approx(drawn[first], rel=0.2)


@pytest.mark.parametrize("bounce", [0.2, 0.35, 0.5])
def test_samples_without_bounces_do_not_depend_on_restitution(law, rig, bounce):
    """Samples that no bounce affects do not depend on the restitution, to 1e-6.

    These are the samples from the lift-off to the first landing, and those after the bounces.
    """
    values = numbers_of(rig)
    errors = InstrumentErrors(rate=800, encoder_rate=800)
    other = rig.with_follower(restitution=bounce)
    run = measured_run(law, other, "one_mass", (440.0, 460.0, 480.0), errors, 1)
    likelihoods = [
        Likelihood(law, measured_segments(run)[1], (), values | {"restitution": e}, None)
        for e in (bounce, 1.05 * bounce)
    ]
    x = likelihoods[0].start({}, 0.0, 0.0)
    settled = likelihoods[0].without_landings(x, 0.05)
    bouncing = [likelihood.residuals(x) for likelihood in likelihoods]
    assert np.abs(bouncing[1] - bouncing[0]).max() > 0.5
    assert 0.3 * bouncing[0].size < settled.residuals(x).size < bouncing[0].size
    beside = Likelihood(law, settled.segments, (), likelihoods[1].fixed, None)
    assert settled.residuals(x) == pytest.approx(beside.residuals(x), abs=1e-6)


@pytest.mark.long
@pytest.mark.parametrize("seed", [3, 7, 17, 23, 27, 33, 37, 61, 151])
def test_error_of_restitution(seed):
    """In hard cases the fitted restitution is within 4 standard errors of the truth.

    In these seeds an error estimate from the curvature of the likelihood was off by 7 standard
    errors, because samples enter and leave bounces. In seeds 61 and 151 a speed is just above the
    jump speed, so that few samples are in a bounce. There the best of many narrow maxima was off by
    17 to 28 standard errors, and no restitution need be identified. The same applies to seed 27. A
    normal error exceeds 4 standard errors once in 15 000 machines.
    """
    off = {score.name: score.errors for score in scores_of(seed)}
    assert abs(off.get("restitution", 0.0)) < (3.0 if seed in (61, 151) else 4.0)
    assert "restitution" in off or seed in (27, 61, 151)
    assert {"mass", "preload"} <= set(off) or seed not in (61, 151)


@pytest.mark.long
@pytest.mark.parametrize("seed", [59, 79, 115, 179, 199])
def test_errors_of_two_masses(seed):
    """In hard cases the fitted two-mass parameters are within 4 standard errors.

    In these seeds a search from another stem stopped in a local maximum: the spring was off by 8
    and the mass share by 22 standard errors. In seeds 59, 79 and 199 hardly any sample depends on
    the stem, so that no parameter of the stem need be identified. One of seven normal errors
    exceeds 4 standard errors once in 2000 machines.
    """
    off = {score.name: score.errors for score in scores_of(seed)}
    assert {"mass", "spring_stiffness"} <= set(off)
    assert {"stem_stiffness", "roller_share"} <= set(off) or seed not in (115, 179)
    assert max(map(abs, off.values())) < 4.0


@pytest.mark.slow
def test_bouncing_does_not_hide_contradicting_forces(law, rig):
    """A follower that bounces all the time is less likely than one in contact.

    In the likelihood samples near landings are excluded. Samples that a bouncing follower excludes
    from the likelihood count against it, so a follower in contact is more likely. The log ratio of
    two solutions is antisymmetric.
    """
    jump = jump_rpm(law, rig)
    errors = InstrumentErrors(rate=400, encoder_rate=400)
    other = rig.with_follower(restitution=0.3)
    run = measured_run(law, other, "one_mass", (0.6 * jump, 1.01 * jump), errors, 1)
    values = numbers_of(rig)
    segments, found = measured_segments(run)[1], []
    for bounce in (0.3, 0.95):
        like = Likelihood(law, segments, ("preload",), values | {"restitution": bounce}, None)
        found.append(search(Candidate(like, like.start(values, 0.0, 0.0))))
    few, many = found
    kept = [int(one.likelihood.force_masks[1].sum()) for one in (few, many)]
    assert kept[1] < 0.9 * kept[0]
    assert log_ratio_of_all(few, many) > log_ratio(few, many) + 100.0
    assert log_ratio_of_all(many, few) == pytest.approx(-log_ratio_of_all(few, many))
    assert log_ratio_of_all(few, few) == 0.0
