"""Each cam left out in turn: the acoustic constants are fitted to the other two alone."""

from __future__ import annotations

from dataclasses import dataclass

from cam_rig.arrays import rms
from cam_rig.simulation.regression import cubic
from cam_rig.simulation.settled_turns import Acoustics
from cam_rig.studies.noise.calibration import two_constants
from cam_rig.studies.noise.setup import NoiseSetup

#: Rounds of fitting shape and constants in turn.
ROUNDS = 2


@dataclass(frozen=True)
class LeftOut:
    """A cam left out, the constants of the other two, and the fit error (dB) on each cam.

    ``numbers`` were fitted together to the ``trained`` cams. The arc cam's geometry is its own:
    it is fitted with the constants where the cam is among the trained, and to its own curve,
    after the constants, where it is the one left out.
    """

    cam: str
    trained: tuple[str, ...]
    numbers: int
    acoustics: Acoustics
    rms_db: float
    rms_regression_db: float
    rms_trained_db: dict[str, float]


def leave_one_out(study: NoiseSetup) -> list[LeftOut]:
    """All three, in the order of the scene."""
    return [_leave_out(study, cam) for cam in study.cams]


def _leave_out(study: NoiseSetup, cam: str) -> LeftOut:
    arcs = study.roles.arcs
    trained = tuple(name for name in study.cams if name != cam)
    known = [study.cams[name] for name in trained if name != arcs]
    acoustics = two_constants(known, study.start)
    for _ in range(1 if cam == arcs else ROUNDS):
        shape = study.fit_shape(acoustics)
        cams = study.cams | {arcs: study.problem.cam_of(shape)}
        acoustics = two_constants([cams[name] for name in trained], study.start)
    return LeftOut(
        cam=cam,
        trained=trained,
        numbers=2 if cam == arcs else 4,
        acoustics=acoustics,
        rms_db=cams[cam].rms(acoustics),
        rms_regression_db=rms(cubic(study.rpm) @ cams[cam].difference(acoustics)),
        rms_trained_db={name: cams[name].rms(acoustics) for name in trained},
    )
