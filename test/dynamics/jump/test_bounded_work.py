"""A search for a jump speed looks at no more values than it may, whatever the rig."""

import math

import numpy as np
import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump import search
from cam_rig.dynamics.jump.search import sought_speed
from cam_rig.dynamics.modal_minimum import LawCells, ModalRun
from cam_rig.errors import DynamicsError
from cam_rig.schema import load_rig
from cam_rig.units import RPM

#: Looks that a test lets a search have, and what one call of the force takes more at most.
MOST = 1e6
#: Least and largest of each number that is drawn: as far as a rig file lets it go.
RANGES = {
    "roller_mass": (1e-9, 1e6),
    "end_mass": (1e-9, 1e6),
    "stem_stiffness": (1e-9, 1e15),
    "spring_stiffness": (1e-9, 1e15),
    "stem_damping": (0.0, 1e9),
    "damping": (0.0, 1e9),
    "preload": (0.0, 1e9),
}


@pytest.fixture(scope="module")
def two_mass(config_dir):
    """The two-mass follower of the paper's jump speeds."""
    return TwoMassParameters.from_rig(load_rig(config_dir / "rigs" / "paper_table2.yaml"))


def with_numbers(follower, **numbers):
    return TwoMassParameters(**(vars(follower) | numbers))


@pytest.fixture
def work(monkeypatch):
    """What searches do: bounds tried over ranges of speeds, and speeds looked at."""
    done = {"bounds": 0, "speeds": 0}
    above, least = ModalRun.above, ModalRun.least

    def counted_above(self, low, high):
        done["bounds"] += 1
        return above(self, low, high)

    def counted_least(self, speeds):
        done["speeds"] += speeds.size
        return least(self, speeds)

    monkeypatch.setattr(ModalRun, "above", counted_above)
    monkeypatch.setattr(ModalRun, "least", counted_least)
    return done


@pytest.mark.parametrize("stiffness", [1e9, 1e12, 1e15])
@pytest.mark.parametrize("duration", [1.7, None])
def test_a_stiffer_stem_takes_no_more_bounds(laws, two_mass, work, stiffness, duration):
    """3-4-5 on a stem of any stiffness comes to the rigid follower's speed in some tens of bounds.

    A step of speed is as fine as the stem's resonances, of which there are 10⁷ below the jump
    speed at 10¹⁵ N/m: where contact is proved over a wide range they are not gone through.
    """
    stiff = with_numbers(two_mass, stem_stiffness=stiffness)
    found = sought_speed(laws["poly345"], stiff, duration) / RPM
    assert found == pytest.approx(458.67, abs=5.0)
    assert work["bounds"] < 200
    assert work["speeds"] < 2000


def drawn(two_mass, seed):
    """A rig whose numbers are at their limits, those of the paper, or anywhere between."""
    rng = np.random.default_rng(seed)
    numbers = {}
    for name, (low, high) in RANGES.items():
        least = max(low, 1e-6 * high if low == 0.0 else low)
        between = 10.0 ** rng.uniform(math.log10(least), math.log10(high))
        numbers[name] = float(rng.choice([low, high, getattr(two_mass, name), between]))
    return with_numbers(two_mass, **numbers)


def require_bounded(laws, two_mass, work, seed):
    """A speed or one line, after no more work than is allowed."""
    rng = np.random.default_rng(seed)
    law = laws[str(rng.choice(["poly345", "cycloidal", "bezier15", "bezier_segments"]))]
    duration = [1.7, None][int(rng.integers(2))]
    work.update(bounds=0, speeds=0)
    try:
        assert sought_speed(law, drawn(two_mass, seed), duration) >= 0.0
    except DynamicsError as error:
        assert "allowed" in str(error)
    per_speed = LawCells.of(law).piece.size
    assert work["speeds"] * per_speed < 2.0 * MOST + 1e5
    assert work["bounds"] < 1000 + work["speeds"]


@pytest.mark.parametrize("seed", range(12))
def test_work_is_bounded_on_any_rig(laws, two_mass, work, monkeypatch, seed):
    """At the limits of what a rig file may say too: the count of looks, not the time."""
    monkeypatch.setattr(search, "MAX_LOOKS", MOST)
    require_bounded(laws, two_mass, work, seed)


@pytest.mark.long
def test_work_is_bounded_on_many_rigs(laws, two_mass, work, monkeypatch):
    """The same on 300."""
    monkeypatch.setattr(search, "MAX_LOOKS", MOST)
    for seed in range(100, 400):
        require_bounded(laws, two_mass, work, seed)


def test_what_takes_too_many_looks_is_refused_in_a_line(laws, two_mass, monkeypatch):
    """With the speed that was come to, the stem's frequency, the limit and what to do."""
    monkeypatch.setattr(search, "MAX_LOOKS", 1e4)
    with pytest.raises(DynamicsError, match=r"contact holds up to .* more than 10000 looks .*stem"):
        sought_speed(laws["cycloidal"], two_mass, 1.7)
