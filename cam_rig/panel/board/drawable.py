"""A cam as Bézier curves and B-splines between dwells, whose ordinates can be drawn.

A cam that is made of these alone has its own ordinates. Of any other the nearest law of a class is
taken, B-splines in each of its events: nearest in s and s'', with the events' ends as they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.laws import Law, bernstein, build_law
from cam_rig.schema import CamConfig
from cam_rig.schema.segments import Bezier, BSpline
from cam_rig.studies.cam_fit.cam_file import valid_cam
from cam_rig.studies.design.cam_file import class_cam_data
from cam_rig.studies.design.law_class import LawClass, second_derivative, to_bezier
from cam_rig.studies.design.space import Space

#: Pieces of each event of the class that other laws are written in, and how smooth it may be: the
#: smoothest that the law's own ends of events allow.
PIECES, JOINTS = 16, (3, 2, 1)
#: Gauss points of a piece, at which laws are compared, and how much a difference of s (in lifts)
#: weighs against one of s'' (in its r.m.s.). By s'' alone the law of arcs, whose s'' steps, would
#: be an eighth of the lift off; by s alone the B-spline would swing between its steps.
GAUSS, WEIGHT = 8, 10.0
#: Points of a turn at which the distance is measured.
COMPARED = 3600
#: Segments whose ordinates are drawn.
DRAWN = (Bezier, BSpline)
Drawn = Bezier | BSpline


@dataclass(frozen=True, eq=False)
class DrawableCam:
    """A cam of drawable segments and dwells alone.

    Parameters
    ----------
    cam, law : what is drawn, and its law
    law_class : of the B-splines that stand for the file's own law; None where they are its own
    distance : m, largest difference of s to the file's own law; 0 where it is that
    """

    cam: CamConfig
    law: Law
    law_class: LawClass | None
    distance: float


def with_own_ordinates(cam: CamConfig) -> DrawableCam | None:
    """The cam itself, where its segments are drawable and dwells alone.

    Raises
    ------
    LawError : it has no law
    """
    kinds = {type(segment) for segment in cam.segments if segment.law != "dwell"}
    if not kinds or not kinds <= set(DRAWN):
        return None
    return DrawableCam(cam, build_law(cam), None, 0.0)


def nearest_of_class(cam: CamConfig) -> DrawableCam:
    """The cam with the nearest law of the class.

    Raises
    ------
    ConfigError : it rests all around, or does not join itself even in C1
    LawError : it has no law
    """
    law = build_law(cam)
    space = _space(law)
    source = f"nearest in lift and acceleration to the law of {cam.name}"
    data = class_cam_data(cam, space, _nearest(space), cam.name, cam.title, source)
    drawn = valid_cam(data)
    drawn_law = build_law(drawn)
    angles = np.linspace(0.0, 2.0 * math.pi, COMPARED, endpoint=False)
    distance = float(np.abs(drawn_law(angles) - law(angles)).max())
    return DrawableCam(drawn, drawn_law, space.law_class, distance)


def _space(law: Law) -> Space:
    """The laws of the smoothest class that has the law's ends of events."""
    for joints in JOINTS[:-1]:
        try:
            return Space(law, LawClass(PIECES, joints))
        except ConfigError:  # a turn without a dwell that joins itself less smoothly
            continue
    return Space(law, LawClass(PIECES, JOINTS[-1]))


def _nearest(space: Space) -> FloatArray:
    """The unknowns whose s and s'' are nearest to the start's, in the mean square."""
    own, law = space.law_class, space.start
    nodes = 0.5 * (np.polynomial.legendre.leggauss(GAUSS)[0] + 1.0)
    lift = _at(own, nodes, 0) @ to_bezier(own)
    bend = _at(own, nodes, 2) @ to_bezier(own, 2) @ second_derivative(own)
    inside = (np.arange(own.pieces)[:, None] + nodes).ravel() / own.pieces
    free = slice(own.joints + 1, own.count - own.joints - 1)
    found = []
    for index, event in enumerate(space.events):
        angles = event.start + event.span * inside
        wanted = law(angles, 2) * event.span**2 / law.lift
        rms = math.sqrt(float(np.mean(wanted**2))) or 1.0
        wanted = np.concatenate([wanted / rms, WEIGHT * law(angles) / law.lift])
        table = sparse.vstack([bend / rms, WEIGHT * lift]).toarray()
        fixed = space.coefficients(index).constant / law.lift
        found.append(np.linalg.lstsq(table[:, free], wanted - table @ fixed)[0])
    return space.joined(np.concatenate(found))


def _at(own: LawClass, nodes: FloatArray, order: int) -> sparse.csr_array:
    """Values of a derivative at nodes of every piece, from its Bézier ordinates."""
    table = bernstein.basis(own.power - order, nodes)
    return sparse.csr_array(sparse.kron(sparse.eye(own.pieces), table, "csr"))
