"""Random laws and rigs over all that a rig file allows: for searches that must miss nothing."""

import math

import numpy as np
from scipy.interpolate import BPoly

from cam_rig.dynamics import TwoMassParameters
from cam_rig.laws import Law
from cam_rig.units import TURN

#: Runs from rest (s), and the steady state.
DURATIONS = (1.7, 0.4, None)
#: How far the lift and its derivatives at joints are from those of an eccentric.
SCATTER = 0.1


def random_law(rng):
    """1 to 60 pieces of degree 3 to 15, C1 to C7 at joints, some with one of 0.03°."""
    count = int(rng.choice([1, 2, 3, 5, 8, 12, 30, 60]))
    order = int(rng.integers(1, 8))
    widths = rng.uniform(0.3, 1.0, count)
    if count > 1 and rng.random() < 0.4:
        widths[rng.integers(count)] = 10.0 ** rng.uniform(-3.0, -1.0)
    knots = np.append(0.0, np.cumsum(widths)) * (TURN / widths.sum())
    knots[-1] = TURN
    phases = knots[:, None] + 0.5 * math.pi * np.arange(order + 1)
    values = 0.02 * (np.arange(order + 1) == 0) - 0.02 * np.cos(phases)
    values *= 1.0 + SCATTER * rng.standard_normal(values.shape)
    if count == 1:
        values[:, 1] = 1e-3 * rng.standard_normal()
    values[-1] = values[0]
    ends = zip(knots[:-1], knots[1:], values[:-1], values[1:], strict=True)
    columns = [BPoly.from_derivatives([a, b], [left, right]).c[:, 0] for a, b, left, right in ends]
    return Law("random", knots, np.stack(columns, axis=1))


def random_rig(rng):
    """Stems of 1e3 to 1e10 N/m, damping none to three times critical, shares of 0.02 to 0.98."""
    mass, share = 10.0 ** rng.uniform(-1.0, 1.0), rng.uniform(0.02, 0.98)
    stem, spring = 10.0 ** rng.uniform(3.0, 10.0), 10.0 ** rng.uniform(2.0, 5.0)
    ratio = rng.choice([0.0, 10.0 ** rng.uniform(-4.0, -1.0), 10.0 ** rng.uniform(-2.0, 0.5)])
    damping = 2.0 * ratio * math.sqrt((stem + spring) * (1.0 - share) * mass)
    part, preload = rng.uniform(0.0, 1.0), 10.0 ** rng.uniform(0.0, 3.0)
    ends, dampers = (share * mass, (1.0 - share) * mass), (part * damping, damping - part * damping)
    return TwoMassParameters(*ends, stem, spring, *dampers, preload)


def case(seed):
    """A law, a rig and how long it runs."""
    rng = np.random.default_rng(seed)
    law, rig = random_law(rng), random_rig(rng)
    duration = DURATIONS[int(rng.integers(3))]
    still = rig.stem_damping + rig.damping == 0.0
    return law, rig, DURATIONS[0] if still and duration is None else duration
