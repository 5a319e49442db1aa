"""A constant-velocity cam: struck where its velocity jumps up, thrown off where it jumps down."""

import dataclasses
import itertools

import mpmath as mp
import numpy as np
import pytest

from cam_rig.dynamics import MODELS, FollowerParameters, Interval, TwoMassParameters
from cam_rig.dynamics.elastic_stem import motion, response
from cam_rig.dynamics.one_mass import OneMassTrajectory
from cam_rig.dynamics.two_mass.model import states
from cam_rig.dynamics.two_mass.trajectory import Separation
from cam_rig.laws import Law
from cam_rig.units import NS, TURN

LIFT, RISE = 0.05, np.radians(90.0)
STEP = LIFT / RISE
#: 60° in 0.1 s: joints at 0.1, 0.25, 0.35 and 0.5 s of each turn of 0.6 s.
SPEED = 100.0 * np.pi / 30.0
MS = NS // 1000
ONE = FollowerParameters(1.3, 4030.0, 8.642, 12.753, 3.3e8)
TWO = TwoMassParameters(0.4, 0.9, 1.26e6, 4030.0, 300.0, 8.642, 30.6)


@pytest.fixture(scope="module")
def edge():
    """Dwell, constant velocity up, dwell, constant velocity down, dwell."""
    breaks = np.radians([0.0, 60.0, 150.0, 210.0, 300.0, 360.0])
    breaks[-1] = TURN
    return Law("edge", breaks, LIFT * np.array([[0.0, 0, 1, 1, 0], [0, 1, 1, 0, 0]]))


def run(model, law, p, cuts, speed=SPEED, rate=8000, nudge=0.0):
    """Samples, events and last state; ``nudge`` (rad) is added to every second angle."""
    state, rows, events = None, [], []
    for i, (a, b) in enumerate(itertools.pairwise(cuts)):
        interval = Interval(a, b, speed * a / NS + nudge * (i % 2), speed)
        state, block = MODELS[model].advance(law, p, state, interval, rate)
        rows.append(block.rows)
        events += block.events
    return np.hstack(rows), events, state


@pytest.mark.parametrize("restitution", [0.0, 0.4])
@pytest.mark.parametrize(("model", "p"), [("one_mass", ONE), ("two_mass", TWO)])
def test_struck_from_rest(edge, model, p, restitution):
    """At the start of the rise: J = m (1 + e) ω Δs', ΔE = m (1 − e²) (ω Δs')²/2, at 60°."""
    p = dataclasses.replace(p, restitution=restitution)
    first = run(model, edge, p, [0, 101 * MS])[1][0]
    mass = p.mass if model == "one_mass" else p.roller_mass
    assert first.kind == "landing"
    assert first.time == pytest.approx(0.1, abs=1e-15)
    assert first.angle == pytest.approx(np.pi / 3.0, abs=1e-15)
    assert first.impulse == pytest.approx(mass * (1.0 + restitution) * SPEED * STEP, rel=1e-14)
    lost = 0.5 * mass * (1.0 - restitution**2) * (SPEED * STEP) ** 2
    assert first.energy_lost == pytest.approx(lost, rel=1e-14)


def test_struck_where_the_run_begins(edge):
    """A follower at rest on the dwell feels the rise that begins with the run."""
    breaks = np.radians([0.0, 90.0, 150.0, 240.0, 300.0, 360.0])
    breaks[-1] = TURN
    turned = Law("turned", breaks, np.roll(edge.ordinates, -1, axis=1))
    for model, p, mass in (("one_mass", ONE, ONE.mass), ("two_mass", TWO, TWO.roller_mass)):
        rows, events, _ = run(model, turned, p, [0, MS])
        assert [event.time for event in events[:1]] == [0.0]
        assert events[0].impulse == pytest.approx(mass * SPEED * STEP, rel=1e-14)
        assert rows[5, 0] == events[0].impulse
    start = run("elastic_stem", turned, ONE, [0, MS])[0][:, 0]
    np.testing.assert_allclose(start[1:4], [0.0, 0.0, 0.0], atol=1e-12)


def test_thrown_off_and_back(edge):
    """At the top it flies with ω Δs', m ÿ + c ẏ + k y + F₀ = 0, and lands as 40 digits say."""
    events = run("one_mass", edge, ONE, [0, 300 * MS])[1]
    lifted_off, back = events[1:3]
    assert (lifted_off.kind, back.kind) == ("lift-off", "landing")
    assert lifted_off.angle == pytest.approx(np.radians(150.0), abs=1e-15)
    assert lifted_off.impulse == lifted_off.energy_lost == 0.0
    with mp.workdps(40):
        m, c, k, load = (mp.mpf(x) for x in (1.3, 8.642, 4030.0, 12.753))
        decay = c / m / 2
        w, v = mp.sqrt(k / m - decay**2), mp.mpf(SPEED) * mp.mpf(LIFT) / mp.mpf(RISE)
        above = mp.mpf(LIFT) + load / k

        def height(t):
            swing = above * mp.cos(w * t) + (v + decay * above) / w * mp.sin(w * t)
            return mp.exp(-decay * t) * swing - above

        time = mp.findroot(height, 2 * v * m / (k * above))
        speed = mp.diff(height, time)
    assert back.time == pytest.approx(0.25 + float(time), abs=1e-15)
    assert back.impulse == pytest.approx(-1.3 * float(speed), rel=1e-12)


@pytest.mark.variants(6)
@pytest.mark.parametrize("rpm", [100.0, 97.3, 300.0])
@pytest.mark.parametrize(
    ("model", "p", "tolerance"),
    [
        ("elastic_stem", ONE, 1e-10),
        ("one_mass", ONE, 1e-10),
        ("two_mass", TWO, 1e-10),
        # Bounces to accumulation: the time of a landing is its gap's rounding over its speed.
        ("one_mass", dataclasses.replace(ONE, restitution=0.2), 1e-7),
    ],
)
def test_the_length_of_a_tick_does_not_enter(edge, model, p, tolerance, rpm):
    """Ticks of 1 ms and 200 ms; at 100 rpm ticks and samples end on the joints.

    A sample that falls on a jump may show either side of it, so these are not compared.
    """
    speed = rpm * np.pi / 30.0
    rows, events, state = run(model, edge, p, range(0, 600 * MS + 1, MS), speed)
    coarse, expected, end = run(model, edge, p, range(0, 600 * MS + 1, 200 * MS), speed)
    assert [event.kind for event in events] == [event.kind for event in expected]
    for one, other in zip(events, expected, strict=True):
        assert one.time == pytest.approx(other.time, abs=tolerance)
        assert one.impulse == pytest.approx(other.impulse, abs=tolerance)
    turned = rows[0] * speed
    apart = np.abs(turned[:, None] % TURN - edge.breaks).min(axis=1) > 1e-9
    size = np.abs(coarse[1:5]).max(axis=1)
    difference = np.abs(rows - coarse)[1:5, apart].max(axis=1)
    assert (difference < tolerance * size).all()
    assert state.velocity == pytest.approx(end.velocity, abs=tolerance * size[1])


@pytest.mark.parametrize("nudge", [-1e-13, -1e-15, 0.0, 1e-15, 1e-13])
@pytest.mark.parametrize(("model", "p"), [("one_mass", ONE), ("two_mass", TWO)])
def test_rounding_neither_loses_nor_doubles_a_blow(edge, model, p, nudge):
    """Ticks that end on the joints, with angles that disagree by rounding: the same events."""
    expected = run(model, edge, p, [0, 550 * MS])[1]
    cuts = [0, 100 * MS, 250 * MS, 350 * MS, 500 * MS, 550 * MS]
    events = run(model, edge, p, cuts, nudge=nudge)[1]
    assert [event.kind for event in events] == [event.kind for event in expected]
    for one, other in zip(events, expected, strict=True):
        assert one.time == pytest.approx(other.time, abs=1e-12)
        assert one.impulse == pytest.approx(other.impulse, abs=1e-10)


@pytest.mark.parametrize("nudge", [-1e-13, 0.0, 1e-13])
def test_rounding_neither_loses_nor_doubles_a_kick(edge, nudge):
    """The same for the stem of the residual model, which only bends."""
    expected = run("elastic_stem", edge, ONE, [0, 550 * MS])[0]
    cuts = [0, 100 * MS, 250 * MS, 350 * MS, 500 * MS, 550 * MS]
    rows = run("elastic_stem", edge, ONE, cuts, nudge=nudge)[0]
    size = np.abs(expected[1:5]).max(axis=1, keepdims=True)
    # an angle that is off by 1e-13 rad is a time that is off by 1e-14 s, at 16 000 rad/s
    assert (np.abs(rows - expected)[1:5] < 1e-9 * size).all()


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_energy_of_one_mass(edge, restitution):
    """Work of the cam, blows at its new velocity among it, less damping and losses, is stored."""
    p = dataclasses.replace(ONE, restitution=restitution)
    course = OneMassTrajectory(edge, p, Interval(0, 1150 * MS, 0.0, SPEED))
    course.run(None)
    work = burnt = 0.0
    for phase in course.phases:
        for a, b in pieces(edge, phase.begin, phase.end):
            t, weights = gauss(a, b)
            if phase.flight is None:
                v = SPEED * edge(SPEED * t, 1)
                y = edge(SPEED * t)
                force = p.damping * v + p.spring_stiffness * y + p.preload
                work += weights @ (force * v)  # s'' is zero on every piece
            else:
                v = phase.flight.state(t - phase.begin)[1]
            burnt += weights @ (p.damping * v**2)
    landings = [event for event in course.events if event.kind == "landing"]
    work += sum(e.impulse * course.on_cam(e.time).velocity for e in landings)
    lost = sum(e.energy_lost for e in landings)
    y, v = course.end.displacement, course.end.velocity
    stored = 0.5 * p.mass * v**2 + 0.5 * p.spring_stiffness * y**2 + p.preload * y
    assert lost > 0.3
    assert work - burnt - lost == pytest.approx(stored, abs=1e-10 * (work + lost + burnt))


def test_energy_of_two_masses(edge):
    """The same with a stem between the masses."""
    p, duration = TWO, 0.58
    course = Separation(edge, p, SPEED)
    course.run(duration)
    work = burnt = 0.0
    for phase in course.phases:
        for a, b in pieces(edge, phase.begin, phase.end):
            for c, d in itertools.pairwise(np.linspace(a, b, 2 + int((b - a) / 1e-3))):
                t, weights = gauss(c, d)
                z, v, y, w, force = states(course, t)
                work += weights @ (force * SPEED * edge(SPEED * t, 1))
                burnt += weights @ (p.stem_damping * (w - v) ** 2 + p.damping * w**2)
    landings = [event for event in course.events if event.kind == "landing"]
    work += sum(e.impulse * SPEED * edge.at(e.angle)[1] for e in landings)
    lost = sum(e.energy_lost for e in landings)
    z, v, y, w, _ = states(course, np.array([duration]))[:, 0]
    z0, _, y0, _, _ = states(course, np.array([0.0]))[:, 0]

    def potential(z, y):
        spring = 0.5 * p.spring_stiffness * y**2 + p.preload * y
        return 0.5 * p.stem_stiffness * (y - z) ** 2 + spring

    stored = 0.5 * p.roller_mass * v**2 + 0.5 * p.end_mass * w**2
    stored += potential(z, y) - potential(z0, y0)
    assert len(landings) >= 4
    assert work - burnt - lost == pytest.approx(stored, abs=1e-10 * (work + lost + burnt))


def pieces(law, begin, end):
    """[begin, end] (s) cut at the joints of the law."""
    joints = ((law.breaks[:-1] + TURN * np.arange(4)[:, None]) / SPEED).ravel()
    inner = joints[(joints > begin + 1e-13) & (joints < end - 1e-13)]
    return itertools.pairwise([begin, *inner, end])


def gauss(begin, end):
    """Nodes inside and weights of Gauss and Legendre."""
    x, weights = np.polynomial.legendre.leggauss(24)
    return begin + 0.5 * (end - begin) * (1.0 + x), 0.5 * (end - begin) * weights


@pytest.mark.parametrize("stem", [1e5, 3.3e8])
def test_stem_against_fifty_digits(edge, stem):
    """Residual vibration: x and ẋ go on over a joint, piece by piece with 50 digits."""
    p = dataclasses.replace(ONE, stem_stiffness=stem)
    times = np.sort(np.random.default_rng(8).uniform(0.0, 1.2, 40))
    expected = stem_by_mpmath(edge, p, times)
    got = motion(edge, p, SPEED, 0.0, np.zeros(2), times)
    assert np.abs(got[0] - expected[0]).max() < 1e-13 * LIFT
    assert np.abs(got[1] - expected[1]).max() < 1e-11 * np.abs(expected[1]).max()
    ticked = run("elastic_stem", edge, p, range(0, 1200 * MS + 1, 50 * MS), rate=1000)[0]
    expected = stem_by_mpmath(edge, p, ticked[0, ::60])
    assert np.abs(ticked[1, ::60] - expected[0]).max() < 1e-13 * LIFT
    assert np.abs(ticked[2, ::60] - expected[1]).max() < 1e-11 * np.abs(expected[1]).max()


def stem_by_mpmath(law, p, times):
    """Position and velocity from rest, at ascending times."""
    with mp.workdps(50):
        m, c, stem, w = (mp.mpf(x) for x in (p.mass, p.damping, p.stem_stiffness, SPEED))
        total = stem + mp.mpf(p.spring_stiffness)
        root = mp.sqrt(total / m - (c / m / 2) ** 2)
        rates = (mp.mpc(-c / m / 2, root), mp.mpc(-c / m / 2, -root))
        x, v, todo, out, turn = mp.mpf(0), mp.mpf(0), [mp.mpf(float(t)) for t in times], [], 0
        while todo:
            for i, (a, b) in enumerate(law.ordinates.T.tolist()):
                begin = (mp.mpf(law.breaks[i]) + turn * mp.mpf(TURN)) / w
                span = (mp.mpf(law.breaks[i + 1]) - mp.mpf(law.breaks[i])) / w
                slope = (mp.mpf(b) - mp.mpf(a)) / span
                rest = stem / total * (mp.mpf(a) - c * slope / total)
                climb = stem / total * slope
                one = (v - climb - rates[1] * (x - rest)) / (rates[0] - rates[1])
                both = (one, x - rest - one)

                def at(t, rest=rest, climb=climb, both=both):
                    grown = [g * mp.exp(r * t) for g, r in zip(both, rates, strict=True)]
                    rate = sum(r * g for r, g in zip(rates, grown, strict=True))
                    return mp.re(rest + climb * t + sum(grown)), mp.re(climb + rate)

                while todo and todo[0] <= begin + span:
                    out.append([float(y) for y in at(todo.pop(0) - begin)])
                x, v = at(span)
            turn += 1
        return np.array(out).T


def test_stem_comes_back_after_a_turn(edge):
    """The periodic state, kicks among it, is its own image; a stiff damper makes a run forget."""
    p = dataclasses.replace(ONE, stem_stiffness=1e5, damping=200.0)
    model = response(edge, p, SPEED)
    start = model.periodic()
    np.testing.assert_allclose(
        model.end(start, 0.0, TURN / SPEED), start, atol=1e-13 * SPEED * STEP
    )
    settled = model.end(np.zeros(2), 0.0, 3.0 * TURN / SPEED)
    np.testing.assert_allclose(settled, start, atol=1e-12 * SPEED * STEP)


def test_flight_over_the_joints(edge):
    """At 700 rpm it flies over the corners: never under the cam, and back on it exactly."""
    speed = 700.0 * np.pi / 30.0
    course = OneMassTrajectory(edge, ONE, Interval(0, 300 * MS, 0.0, speed))
    course.run(None)
    flights = [phase for phase in course.phases if phase.flight is not None]
    joints = (edge.breaks[:-1] + TURN * np.arange(4)[:, None]).ravel() / speed
    assert any(np.any(np.abs(joints - phase.end) < 1e-15) for phase in flights[:-1])
    for phase in flights:
        times = np.linspace(phase.begin, phase.end, 500)
        gap = phase.flight.state(times - phase.begin)[0] - edge(speed * times)
        assert gap.min() > -1e-14
    landed = [event for event in course.events if event.kind == "landing"]
    assert len(landed) >= 3
    ends = {phase.end: phase.flight for phase in flights}
    begins = {phase.end: phase.begin for phase in flights}
    for event in landed[1:]:
        if event.time in ends:
            y = ends[event.time].state(np.array([event.time - begins[event.time]]))[0][0]
            assert y == pytest.approx(edge.at(event.angle)[0], abs=1e-13)


def test_end_mass_goes_on(edge):
    """Two masses: a blow on the roller does not touch the end mass, η̇ jumps by −α ω Δs'."""
    course = Separation(edge, TWO, SPEED)
    course.run(0.102)
    before, after = (
        states(course, np.array([t]))[:, 0] for t in (0.1 - 1e-12, course.phases[1].begin)
    )
    assert after[3] == pytest.approx(before[3], abs=1e-9)
    assert after[1] - before[1] == pytest.approx(SPEED * STEP, rel=1e-9)
    impact = course.phases[1].vibration
    assert impact[1] == pytest.approx(-TWO.share * SPEED * STEP, rel=1e-9)


@pytest.mark.parametrize("stop", [0.6 * 7, 0.6 * 7 + 0.23])
def test_many_turns_in_one_interval(stop):
    """Seven turns at once or in their ticks, a jump at θ = 0 among those met: the same state."""
    saw = Law("saw", np.array([0.0, 2.0, TURN]), LIFT * np.array([[0.0, 1.0], [1.0, 0.0]]))
    total = round(stop * NS)
    _, _, whole = run("elastic_stem", saw, ONE, [0, total])
    _, _, ticked = run("elastic_stem", saw, ONE, [*range(0, total, 60 * MS), total])
    size = SPEED * LIFT / 2.0
    assert ticked.inner == pytest.approx(whole.inner, abs=1e-9 * size)
    assert ticked.velocity == pytest.approx(whole.velocity, abs=1e-10 * size)
