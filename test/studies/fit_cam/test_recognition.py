"""Recognition of named laws in readings: frequency, standard errors, and what is not recognised."""

import math

import numpy as np
import pytest

import cam_rig
from cam_rig.errors import ConfigError
from cam_rig.laws import Law
from cam_rig.laws.bernstein import join_pieces
from cam_rig.studies.fit_cam.recognition import SIGNIFICANT, candidates, describe, recognise
from cam_rig.studies.fit_cam.spline_fit import fit_spline
from cam_rig.units import TURN

from .conftest import all_around, in_order

NAMES = list(candidates())


def random_cam(rng):
    """Return names, spans (rad) and law of a random rise and fall, with a dwell at the top."""
    names, spans = rng.choice(NAMES, 2), np.radians(rng.uniform(60.0, 130.0, 2))
    lift, dwell = np.exp(rng.uniform(np.log(2e-3), np.log(0.05))), math.radians(rng.uniform(25, 60))
    breaks, columns = [0.0, 0.3], [np.zeros(1)]
    for name, span, base, height in zip(names, spans, (0.0, lift), (lift, -lift), strict=True):
        start = breaks[-1]
        breaks += [start + span * u for u in candidates()[name][0][1:]]
        columns += [base + height * column for column in candidates()[name][1]]
        if base == 0.0:
            breaks.append(breaks[-1] + dwell)
            columns.append(np.array([lift]))
    law = Law("random", np.array([*breaks, TURN]), join_pieces([*columns, np.zeros(1)]))
    return names, spans, law


def laws_of(law, count, noise, rng):
    """Return the laws that are recognised in readings of a law with normal errors (m)."""
    lifts = law(all_around(count)) + rng.normal(scale=noise, size=count)
    fit = fit_spline(in_order(all_around(count), lifts))
    return recognise(fit.readings, fit.dwells, fit.scatter)


@pytest.mark.parametrize("cases", [15, pytest.param(200, marks=pytest.mark.long)])
def test_laws_at_1_um_noise_are_recognised(cases):
    """At least 95 % of random cams are recognised at 1 µm noise, and none silently wrong.

    The errors of the spans agree with their standard errors.
    """
    rng, recognised, pulls = np.random.default_rng(68), 0, []
    for _ in range(cases):
        names, spans, law = random_cam(rng)
        rows = laws_of(law, 360, 1e-6, rng)
        correct = []
        for name, span, sign in zip(names, spans, (1, -1), strict=True):
            event = [row for row in rows if row.rise * sign > 0.0]
            best, likely = event[0], [row.law for row in event if row.worse < SIGNIFICANT]
            assert best.worse == 0.0 and len(event) >= 2
            correct.append(best.law == name and best.explains)
            assert name in likely or not best.explains
            if correct[-1]:
                pulls.append((best.span - span) / best.span_error)
        recognised += all(correct)
    assert recognised >= 0.95 * cases
    assert np.mean(np.square(pulls)) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / len(pulls)))


def test_coarse_readings_name_the_laws_that_they_do_not_distinguish():
    """A law that is not significantly worse than the best is named, in the text too."""
    rng = np.random.default_rng(3)
    law = cam_rig.build_law(cam_rig.load_cam(cam_rig.schema.load.cam_path("modified_trapezoid")))
    rows = laws_of(law, 72, 0.2e-3, rng)
    for event in (1, 2):
        likely = [row.law for row in rows if row.event == event and row.worse < SIGNIFICANT]
        assert "modified_trapezoid" in likely and len(likely) > 1
    texts = list(describe(rows))
    assert len(texts) == 2 and all("do not distinguish" in text for text in texts)


@pytest.mark.parametrize("name", ["quiet", "measured", "bezier15"])
def test_other_laws_are_not_recognised(laws, name):
    """No listed law explains the readings of another law."""
    rows = laws_of(laws[name], 360, 1e-6, np.random.default_rng(1))
    assert not any(row.explains for row in rows)
    assert all("no listed law explains" in text for text in describe(rows))


def test_a_rise_and_fall_without_dwell_are_two_events(make_cam):
    """Between two dwells of one level the rise and the fall are recognised separately."""
    names = ("cycloidal", "modified_sine")
    law = cam_rig.build_law(
        make_cam(
            {"law": names[0], "span": 120.0, "to": 1.0},
            {"law": names[1], "span": 100.0, "to": 0.0},
            {"law": "dwell", "span": 140.0},
        )
    )
    rows = laws_of(law, 360, 1e-6, np.random.default_rng(1))
    best = sorted((row for row in rows if row.worse == 0.0), key=lambda row: -row.rise)
    assert [row.law for row in best] == list(names)
    assert np.degrees([row.span for row in best]) == pytest.approx([120.0, 100.0], abs=0.02)


def test_each_candidate_is_a_different_curve():
    """Equal rises of different names are one candidate, with the name of the first."""
    assert "poly345" in NAMES and not {"bezier5", "poly5", "scca", "bezier4_start"} & set(NAMES)
    assert "poly8, mirrored" in NAMES and "modified_constant_velocity 0.33" in NAMES


def test_the_command_lists_the_laws_and_arcs_refuse_it(tmp_path, laws):
    """`fit_cam` lists the laws on request only, and refuses to list them with arcs."""
    lifts = 1e3 * laws["modified_sine"](all_around(360))
    text = "".join(f"{i},{lift:.4f}\n" for i, lift in enumerate(lifts))
    path = tmp_path / "lifts.csv"
    path.write_text("angle [deg],lift [mm]\n" + text, encoding="utf-8")
    fit = cam_rig.fit_cam(path, recognise=True)
    table = fit.to_pandas("recognised")
    assert table[table.worse == 0.0].law.tolist() == ["modified_sine"] * 2
    assert any("modified_sine. Every other listed law" in text for text in fit.summary())
    assert cam_rig.fit_cam(path).recognised == ()
    with pytest.raises(ConfigError, match="recognise cannot be combined with shape arcs"):
        cam_rig.fit_cam(path, shape="arcs", recognise=True)
