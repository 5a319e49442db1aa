"""Why the arc cam is quiet: its lift, its missing high dwell or its joints, as a factorial.

The reference cam's rise and fall with two lifts, with and without the high dwell, and with two
rises: the reference's own, and one whose acceleration jumps where it joins a dwell, as a cam of
arcs has it. Rise and fall keep their angles; without the high dwell the low one is longer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from cam_rig.laws.segments import NAMED_RISES, up_and_down
from cam_rig.paper.anova import two_levels
from cam_rig.paper.noise.roles import NoiseSetup
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Dwell, Rise
from cam_rig.simulation.simulate import Acoustics, settled_turns
from cam_rig.units import FloatArray

#: The rise whose acceleration jumps at a dwell, as at the joints of arcs.
WITH_JUMPS = "simple_harmonic"
#: The factors in their order, in words.
FACTORS = ("lift", "high dwell", "joints")


class Timing(NamedTuple):
    """A cam that rises, dwells, falls by one named rise: its angles in rad, its lift in m."""

    rise: str
    event: float
    high_dwell: float
    lift: float


@dataclass(frozen=True, eq=False)
class HighDwellStudy:
    """Levels (dB) of the eight cams at the study's speeds, the first the reference itself.

    A cam is told by lift (m), high dwell (rad) and rise. ``shares`` are those of the sum of squares
    of the mean levels, by the factors that act together (indices into `FACTORS`).
    """

    levels_db: dict[tuple[float, float, str], FloatArray]
    shares: Mapping[tuple[int, ...], float]

    def change_db(self, factor: str) -> FloatArray:
        """What changing one of `FACTORS` alone does to the reference's levels, dB."""
        alone = 4 >> FACTORS.index(factor)  # the last factor turns first
        return list(self.levels_db.values())[alone] - self.reference

    @property
    def reference(self) -> FloatArray:
        """Levels (dB) of the reference cam."""
        return next(iter(self.levels_db.values()))


def timing_of(cam: CamConfig) -> Timing | None:
    """The timing of a cam that rises and falls by one named rise with a high dwell; else None."""
    rises = [segment for segment in cam.segments if isinstance(segment, Rise)]
    dwells = [segment for segment in cam.segments if isinstance(segment, Dwell)]
    shape = [isinstance(segment, Rise) for segment in cam.segments]
    if shape not in ([False, True, False, True, False], [False, True, False, True]):
        return None
    if len(rises) + len(dwells) < len(shape) or rises[0].law != rises[1].law:
        return None
    up, down = (rise.span.si for rise in rises)
    if abs(up - down) > 1e-9 or any(NAMED_RISES[rises[0].law].slopes):
        return None
    return Timing(rises[0].law, up, dwells[1].span.si, cam.lift.si)


def study_high_dwell(
    setup: NoiseSetup, acoustics: Acoustics, other_lift: float
) -> HighDwellStudy | None:
    """Run the eight cams; None where the reference cam cannot be changed in all three.

    It must have a high dwell between two equal rises, another lift than the arc cam's
    ``other_lift`` (m), and no jumps at its joints.
    """
    timing = timing_of(setup.loaded.cams[setup.roles.reference])
    if timing is None:
        return None
    choices = ((timing.lift, other_lift), (timing.high_dwell, 0.0), (timing.rise, WITH_JUMPS))
    if any(own == other for own, other in choices):
        return None
    speeds = np.asarray(setup.cams[setup.roles.reference].turns.speeds)
    levels = {}
    for lift, dwell, rise in product(*choices):
        law = up_and_down(rise, timing.event, lift, dwell)
        turns = settled_turns(law, "one_mass", setup.loaded.follower, speeds)
        levels[lift, dwell, rise] = acoustics.levels(turns)
    means = np.array([level.mean() for level in levels.values()]).reshape(2, 2, 2)
    return HighDwellStudy(levels, two_levels(means))
