"""The least force of each turn of many rigs at once is that of the model for one rig."""

import numpy as np
import pytest

from cam_rig.dynamics import TwoMassParameters
from cam_rig.dynamics.jump.search import force_run
from cam_rig.laws import build_law
from cam_rig.paper.readings.readings import Rigs, ShapeTable, turn_minima
from cam_rig.schema import load_cam
from cam_rig.schema.load import config_root
from cam_rig.units import RPM

CAMS = ("bezier15", "poly345", "cycloidal", "bezier_segments", "half_rises", "tm21")
TURNS = 6


def random_rigs(rng, count):
    """Followers from nearly undamped to stiffly damped, with ten periods a turn and more."""
    share = rng.uniform(0.1, 0.9, count)
    mass = rng.uniform(0.5, 2.0, count)
    damping = 10.0 ** rng.uniform(-2.0, 1.3, (2, count))
    stem = 10.0 ** rng.uniform(6.0, 6.8, count)
    spring = rng.uniform(2000.0, 8000.0, count)
    return Rigs(
        share * mass, (1.0 - share) * mass, stem, spring, *damping, rng.uniform(0.0, 60.0, count)
    )


@pytest.mark.parametrize("name", CAMS)
def test_of_one_rig_as_of_many(name):
    """The least force up to each turn, within the grid's 2 % of the vibration: here 1 N or 2 %."""
    rng = np.random.default_rng(CAMS.index(name))
    law = build_law(load_cam(config_root() / "cams" / f"{name}.yaml"))
    rigs, rpm = random_rigs(rng, 5), float(rng.uniform(250.0, 600.0))
    spans = np.repeat(law.spans[None], 5, axis=0)
    found = turn_minima(ShapeTable.of(law, 4000), spans, rigs, rpm * RPM, TURNS)
    lowest = np.minimum.accumulate(found.force, axis=1)
    for i, numbers in enumerate(zip(*vars_of(rigs), strict=True)):
        follower = TwoMassParameters(*map(float, numbers))
        for turn in (0, 1, TURNS - 1):
            run = force_run(law, follower, (turn + 1) * 60.0 / rpm * (1.0 - 1e-12))
            exact = run.lowest(rpm * RPM)
            assert lowest[i, turn] == pytest.approx(exact, rel=0.02, abs=1.0)


def vars_of(rigs):
    """The numbers of the rigs in the order of the follower's."""
    names = (
        "roller_mass",
        "end_mass",
        "stem_stiffness",
        "spring_stiffness",
        "stem_damping",
        "damping",
        "preload",
    )
    return [getattr(rigs, name) for name in names]


def test_each_rig_has_spans_of_its_own():
    """Rigs side by side, each with another event angle: as each alone."""
    rng = np.random.default_rng(7)
    cam = load_cam(config_root() / "cams" / "poly345.yaml")
    law, rigs = build_law(cam), random_rigs(rng, 3)
    wider = law.spans * np.array([0.8, 1.1, 0.9, 1.1, 0.8])
    spans = np.stack([law.spans, wider * 2.0 * np.pi / wider.sum(), law.spans])
    shape = ShapeTable.of(law)
    together = turn_minima(shape, spans, rigs, 400.0 * RPM, TURNS)
    for i in range(3):
        one = Rigs(*(numbers[i : i + 1] for numbers in vars_of(rigs)))
        alone = turn_minima(shape, spans[i : i + 1], one, 400.0 * RPM, TURNS)
        np.testing.assert_allclose(together.force[i], alone.force[0], rtol=1e-10, atol=1e-8)
        np.testing.assert_allclose(together.angle[i], alone.angle[0], rtol=1e-10)
