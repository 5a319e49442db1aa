"""Jump speeds of laws of many pieces: those of the same law in few, and of exhaustive searches."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.jump_speed import TOLERANCE, jump_speed, may_pull, rigid_jump
from cam_rig.dynamics.two_mass.trajectory import lift_off
from cam_rig.laws import Law, bernstein
from cam_rig.laws.bernstein import joined
from cam_rig.laws.spline import smooth
from cam_rig.schema import load_rig
from cam_rig.units import TURN


@pytest.fixture(scope="module")
def two_mass(config_dir):
    """The two-mass follower of the paper's jump speeds."""
    return TwoMassParameters.from_rig(load_rig(config_dir / "rigs" / "paper_table2.yaml"))


def cut_up(law, count, rng):
    """The same law with random breakpoints more, ``count`` pieces in all."""
    more = rng.uniform(0.0, TURN, count - law.spans.size)
    breaks = np.sort(np.concatenate([law.breaks, more]))
    columns = []
    for low, high in itertools.pairwise(breaks):
        piece = law.piece(0.5 * (low + high))
        u = (np.array([low, high]) - law.breaks[piece]) / law.spans[piece]
        columns.append(bernstein.restrict(law.ordinates[:, piece], *np.clip(u, 0.0, 1.0)))
    return Law(law.name, breaks, np.stack(columns, axis=1))


def through(law, count):
    """The spline of degree 5 through so many readings of a law."""
    angles = np.linspace(0.0, TURN, count, endpoint=False)
    breaks, columns = smooth(angles, law(angles), 0.0).pieces
    return Law(law.name, breaks, joined(columns))


@pytest.mark.parametrize("duration", [0.5, None])
@pytest.mark.parametrize("cam", ["poly345", "measured"])
def test_a_law_in_more_pieces_is_the_same_law(laws, two_mass, cam, duration):
    """Cut anywhere into 40 to 160 pieces, of mixed spans: the jump speed stays, to 1e-6."""
    rng = np.random.default_rng(3)
    expected = jump_speed(laws[cam], two_mass, duration).speed
    for more in (20, 60):
        law = cut_up(laws[cam], laws[cam].spans.size + more, rng)
        assert jump_speed(law, two_mass, duration).speed == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("count", [180, 720])
def test_readings_jump_as_their_law(laws, two_mass, count):
    """A spline through every other degree, or half degree, jumps where its law does, to 3e-4."""
    expected = jump_speed(laws["poly345"], two_mass).rpm
    assert jump_speed(through(laws["poly345"], count), two_mass).rpm == pytest.approx(
        expected, rel=3e-4
    )


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_no_slower_speed_leaves_a_long_law(laws, two_mass, seed):
    """The exact model, part after part, stays on at 25 slower speeds and leaves just above."""
    rng = np.random.default_rng(seed)
    law = through(laws[("poly4567", "cycloidal", "bezier15")[seed]], int(rng.integers(60, 160)))
    rig = replace(
        two_mass,
        stem_stiffness=two_mass.stem_stiffness * rng.uniform(0.3, 2.0),
        preload=two_mass.preload * rng.uniform(0.5, 2.0),
    )
    found = jump_speed(law, rig, 0.4).speed
    for part in [*rng.uniform(0.5, 1.0, 24), 1.0 - 2.0 * TOLERANCE]:
        assert lift_off(law, rig, found * part, 0.0, np.zeros(2), 0.4) is None
    assert lift_off(law, rig, found * (1.0 + 2.0 * TOLERANCE), 0.0, np.zeros(2), 0.4)


@pytest.mark.parametrize("seed", range(6))
def test_rigid_jump_is_the_exhaustive_one(laws, follower, seed):
    """A million points of a turn, and a parabola through the lowest three: 1e-10 of the speed."""
    rng = np.random.default_rng(seed)
    law = laws[("poly345", "tm21", "bezier15", "cycloidal", "trigonometric", "measured")[seed]]
    if seed % 2:
        law = cut_up(law, law.spans.size + int(rng.integers(1, 400)), rng)
    mass = replace(follower, damping=rng.uniform(0.0, 60.0), preload=rng.uniform(1.0, 200.0))
    angles = np.linspace(0.0, TURN, 1_000_001)
    speeds = first_zeros(law, mass, angles)
    at = int(np.argmin(speeds))
    low, least, high = (speeds[(at + i) % (angles.size - 1)] for i in (-1, 0, 1))
    bend, slope = low - 2.0 * least + high, 0.5 * (high - low)
    if abs(slope) < bend:  # else the lowest is at a joint where s'' falls
        least -= 0.5 * slope**2 / bend
    speed, angle = rigid_jump(law, mass)
    assert speed == pytest.approx(least, rel=1e-10 if abs(slope) < bend else 1e-5)
    assert first_zeros(law, mass, np.array([angle]))[0] >= speed * (1.0 - 1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_no_piece_is_left_out_that_pulls(laws, follower, seed):
    """Pieces that the bound excludes: no force below zero at 50 points and 40 speeds up to one.

    Damping is strong: the force of a falling cam is least at a speed in between.
    """
    rng = np.random.default_rng(seed)
    law = cut_up(laws[("poly345", "bezier15")[seed % 2]], 60, rng)
    mass = replace(follower, damping=rng.uniform(100.0, 400.0), preload=rng.uniform(1.0, 30.0))
    speeds = np.linspace(0.0, rng.uniform(10.0, 40.0), 40)
    may = may_pull(mass, law.motion.transpose(1, 2, 0), float(speeds[-1]))
    assert 0 < may.sum() < may.size
    for piece in range(law.spans.size):
        u = np.linspace(0.0, 1.0, 50)
        s, slope, bend = bernstein.evaluate(law.motion[:, :, piece].T, u).T[:, :, None]
        force = mass.mass * bend * speeds**2 + mass.damping * slope * speeds
        force += mass.spring_stiffness * s + mass.preload
        assert may[piece] or force.min() >= 0.0


def first_zeros(law, mass, angles):
    """The least Ω > 0 with m s'' Ω² + c s' Ω + k s + F₀ = 0, infinite where there is none."""
    s, slope, bend = law.motion_at(angles)
    a, b, c = mass.mass * bend, mass.damping * slope, mass.spring_stiffness * s + mass.preload
    with np.errstate(all="ignore"):
        roots = 2.0 * c / (-b + np.array([[1.0], [-1.0]]) * np.sqrt(b**2 - 4.0 * a * c))
    return np.where(np.isfinite(roots) & (roots > 0.0), roots, np.inf).min(axis=0)
