"""Ticks of 1 ms, of 200 ms, or one call: the same run to 1e-10, for every model in every mood."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import MODELS, Interval
from cam_rig.schema import load_rig
from cam_rig.units import NS

#: A prime rate: no sample falls on an event, where rounding would choose its side.
TOTAL, RATE = 400_000_000, 12_007
MILLISECOND = 1_000_000
#: Bounces down to 1e-12 of the lift: the last landings of a series are as exact as a gap can be.
LIMITS = {"one mass, bouncing": 1e-9}
#: Here 1e-16 of the preload decides whether there are 49 or 73 events: no two runs can agree.
CHAOTIC = {("tm21", "two_mass, chattering")}


@pytest.fixture(scope="module")
def paper_rig(config_dir):
    return load_rig(config_dir / "rigs" / "paper_table2.yaml")


def ticked(law, model, parameters, rpm, milliseconds):
    """Rows, events and last state of a run in ticks."""
    speed = rpm * np.pi / 30.0
    state, rows, events = None, [], []
    cuts = [*range(0, TOTAL, round(milliseconds * MILLISECOND)), TOTAL]
    for a, b in itertools.pairwise(cuts):
        interval = Interval(a, b, speed * a / NS, speed)
        state, block = MODELS[model].advance(law, parameters, state, interval, RATE)
        rows.append(block.rows)
        events += block.events
    return np.hstack(rows), events, state


CAMS = ("poly345", "tm21")
CASES = {
    "kinetostatic": ("kinetostatic", 400.0, {}),
    "elastic_stem": ("elastic_stem", 400.0, {}),
    "elastic_stem, undamped": ("elastic_stem", 400.0, {"damping": 0.0, "stem_stiffness": 1e10}),
    "torsional": ("torsional", 350.0, {}),
    "one mass, flying": ("one_mass", 600.0, {}),
    "one mass, bouncing": ("one_mass", 600.0, {"restitution": 0.5}),
    "two_mass": ("two_mass", 450.0, {}),
    "two_mass, bouncing": ("two_mass", 450.0, {"restitution": 0.3}),
    "two_mass, chattering": ("two_mass", 450.0, {"stem_stiffness": 3.3e8, "preload": 12.753}),
}


def sensitivity(law, model, parameters, rpm, whole):
    """What the last digit of a number does to each row at most: no tick can be better than that."""
    follower = getattr(parameters, "follower", parameters)
    largest = np.zeros(whole.shape[0])
    for name, last in itertools.product(("preload", "stem_stiffness"), (-1e-15, 1e-15)):
        nudged = replace(follower, **{name: getattr(follower, name) * (1.0 + last)})
        if follower is not parameters:
            nudged = replace(parameters, follower=nudged)
        rows = ticked(law, model, nudged, rpm, TOTAL / MILLISECOND)[0]
        largest = np.maximum(largest, np.abs(rows - whole).max(axis=1))
    return largest


def felt(events):
    """Landings of a thousandth of the heaviest and more: the last of a series are rounding."""
    heaviest = max((event.impulse for event in events), default=0.0)
    return [event for event in events if event.impulse > 1e-3 * heaviest]


PAIRS = [pair for pair in itertools.product(CAMS, CASES) if pair not in CHAOTIC]


@pytest.mark.variants(10)
@pytest.mark.parametrize(("cam", "name"), PAIRS)
def test_the_tick_does_not_enter(laws, paper_rig, cam, name):
    """Rows to 1e-10 of each row's size, the same landings at the same times.

    Bounces on a stiff stem hand on and enlarge what is rounded, by a thousand times and more, and
    the processor chooses how sums are rounded: where the last digit of the preload or of the
    stem weighs more than 1e-10, ten times its weight is the limit.
    """
    model, rpm, changes = CASES[name]
    law, parameters = laws[cam], replace(MODELS[model].parameters(paper_rig), **changes)
    whole, events, last = ticked(law, model, parameters, rpm, TOTAL / MILLISECOND)
    limit = LIMITS.get(name, 1e-10) * np.abs(whole).max(axis=1)
    limit += 10.0 * sensitivity(law, model, parameters, rpm, whole)
    for milliseconds in (1, 200):
        rows, found, state = ticked(law, model, parameters, rpm, milliseconds)
        assert (np.abs(rows - whole).max(axis=1)[:5] <= limit[:5]).all()
        for one, other in zip(felt(found), felt(events), strict=True):
            assert one.time == pytest.approx(other.time, abs=1e-10)
            assert one.impulse == pytest.approx(other.impulse, rel=1e-5)
        assert state.in_contact == last.in_contact
        assert abs(state.displacement - last.displacement) <= limit[1]
