"""Of intervals of 95 %, how many hold the truth: the property that a standard error states.

``pytest -m long -s test/studies/fit_rig/test_coverage.py`` prints a table of 200 machines.
"""

import itertools
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest

from benchmark.simulated_instruments import InstrumentErrors, measured_run
from cam_rig.studies.fit_rig.residuals import Likelihood
from cam_rig.studies.fit_rig.search import (
    Candidate,
    log_ratio,
    log_ratio_of_all,
    search,
    uncertainty,
)
from cam_rig.studies.fit_rig.study import fit_run
from cam_rig.studies.fit_rig.turns import measured_segments

from .machines import NOISES, coverage, jump_rpm, numbers_of, scores_of

MACHINES = 200


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.timeout(14_400)
def test_intervals_of_200_machines_hold_the_truth():
    """One mass and two, in contact and with landings, three kinds of noise: 90 to 99 % do."""
    # forked, as a worker of pytest's that is spawned finds the standard library's package test
    with ProcessPoolExecutor(2, get_context("fork")) as pool:
        found = list(itertools.chain.from_iterable(pool.map(scores_of, range(MACHINES))))
    groups, titles = {}, ("model", "speeds", "noise", "number", "all")
    for score in found:
        for group in zip(titles, (*score.kind, score.name, "all"), strict=True):
            groups.setdefault(group, []).append(score)
    for (title, kind), scores in sorted(groups.items(), key=lambda row: titles.index(row[0][0])):
        scatter = math.sqrt(np.mean([score.off**2 for score in scores]))  # of the scores
        machines = len({score.seed for score in scores})
        within = f"{100.0 * coverage(scores):.1f} %"
        print(f"| {title}: {kind} | {machines} | {len(scores)} | {within} | {scatter:.2f} |")
    for group in (*(("noise", noise) for noise in NOISES), ("all", "all")):
        assert 0.90 <= coverage(groups[group]) <= 0.99, group


@pytest.fixture(scope="module")
def solution(law, rig):
    """A fit in contact, of one rigid mass."""
    errors = InstrumentErrors(rate=400, encoder_rate=400)
    run = measured_run(law, rig, "one_mass", (200.0, 300.0, 350.0), errors, 1)
    return fit_run(law, run, rig, "one_mass").solution


def test_errors_of_correlated_noise_are_those_of_many_draws(solution):
    """The covariance of least squares under noise of correlation 0.9ᵏ, by drawing it 2000 times.

    Linear about the solution: x = −(JᵀJ)⁻¹ Jᵀ noise.
    """
    random = np.random.default_rng(0)
    like, slopes = solution.likelihood, solution.slopes
    noise = np.zeros((2000, slopes.shape[0]))
    at = 0
    for segment, kept in zip(like.segments, like.kept, strict=True):
        for size in (segment.lift.value.size, int(kept.sum())):
            noise[:, at] = random.standard_normal(2000)
            for k in range(at + 1, at + size):
                noise[:, k] = 0.9 * noise[:, k - 1] + math.sqrt(0.19) * random.standard_normal(2000)
            at += size
    noise[:, at:] = random.standard_normal((2000, slopes.shape[0] - at))
    drawn = np.linalg.lstsq(slopes, noise.T, rcond=None)[0].std(axis=1)
    errors = [uncertainty(replace(solution, residuals=one)).errors for one in noise[:40]]
    first = slice(0, like.instruments.first)
    assert np.mean(errors, axis=0)[first] == pytest.approx(drawn[first], rel=0.2)


@pytest.mark.parametrize("bounce", [0.2, 0.35, 0.5])
def test_what_no_bounce_reaches_knows_no_restitution(law, rig, bounce):
    """From lift-off to the first landing, and settled on the cam, a motion depends on none."""
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
def test_no_restitution_is_far_off(seed):
    """Samples come into bounces and leave them: a curvature there was 7 standard errors off.

    Of seeds 61 and 151 one speed is just above the jump speed, and few samples are in a bounce: the
    best of many narrow valleys, 17 to 28 of its own errors off, was likelier by chance and by what
    it left out beside its landings. There and of seed 27 none need be identified. A normal error is
    beyond 4 once in 15 000 machines.
    """
    off = {score.name: score.off for score in scores_of(seed)}
    assert abs(off.get("restitution", 0.0)) < (3.0 if seed in (61, 151) else 4.0)
    assert "restitution" in off or seed in (27, 61, 151)
    assert {"mass", "preload"} <= set(off) or seed not in (61, 151)


@pytest.mark.long
@pytest.mark.parametrize("seed", [59, 79, 115, 179, 199])
def test_no_number_of_two_masses_is_far_off(seed):
    """One mass takes up what a soft stem does, and a stem that rings is in step for few cycles.

    A search from any other stem ended in a valley of its own: a spring 8 of its errors off, a share
    of the mass 22. Of seeds 59, 79 and 199 hardly anything shows a stem: the best of all that were
    tried was likelier by chance, 7 to 660 errors off, and none need be identified. One of seven
    normal errors is beyond 4 once in 2000 machines.
    """
    off = {score.name: score.off for score in scores_of(seed)}
    assert {"mass", "spring_stiffness"} <= set(off)
    assert {"stem_stiffness", "roller_share"} <= set(off) or seed not in (115, 179)
    assert max(map(abs, off.values())) < 4.0


@pytest.mark.slow
def test_no_bouncing_hides_what_contradicts_it(law, rig):
    """A follower that bounces all around explains no forces of one that presses.

    What it leaves out beside its landings counts against it, and the same against none of both.
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
    kept = [int(one.likelihood.kept[1].sum()) for one in (few, many)]
    assert kept[1] < 0.9 * kept[0]
    assert log_ratio_of_all(few, many) > log_ratio(few, many) + 100.0
    assert log_ratio_of_all(many, few) == pytest.approx(-log_ratio_of_all(few, many))
    assert log_ratio_of_all(few, few) == 0.0
