"""The follower around a standing cam, as the graphical method draws it (profile thesis §2.2.1)."""

from __future__ import annotations

import numpy as np

from cam_rig.arrays import ComplexArray, FloatArray
from cam_rig.drawing.outlines import MM, circle
from cam_rig.laws import Law
from cam_rig.profile.contact import Element
from cam_rig.profile.flat_face import GuidedFace, SwungFace
from cam_rig.profile.motion import Motion, turn_angles
from cam_rig.profile.roller import SwungCentre

#: A face is drawn this much longer than the contact needs it, and a stem so long: of the reach.
SPARE, STEM = 0.08, 0.22
#: Height of an L-shaped arm over its point, of the arm.
SHANK = 0.25


def reach_of(element: Element, law: Law) -> float:
    """Largest distance of a contact from the cam's axis, m."""
    return float(np.abs(element.touch(Motion.uniform(law, 720)).contact).max())


def positions(element: Element, law: Law, angle: FloatArray) -> list[list[FloatArray]]:
    """For each cam angle (rad) the follower's outline as strips, ``(n, 2)`` mm, in the cam's frame.

    A roller or a face, with its stem or its arm.
    """
    strips = _outline(element, law, Motion.at(law, angle))
    turn = np.exp(-1j * angle)[:, None]
    turned = [strip * turn * MM for strip in strips]
    return [
        [np.column_stack([strip[i].real, strip[i].imag]) for strip in turned]
        for i in range(angle.size)
    ]


def _outline(element: Element, law: Law, motion: Motion) -> list[ComplexArray]:
    """Strips ``(angles, points)`` in the guide's frame, m."""
    stand = element.stand(motion.s)[:, None]
    if isinstance(element, SwungFace):
        return _swung_face(element, law, motion)
    if isinstance(element, GuidedFace):
        return [_face(element, law, motion), _stem(element, law, stand)]
    rim = element.roller * circle(1.0).view(np.complex128)[:, 0]
    if isinstance(element, SwungCentre):
        pivot = np.full_like(stand, element.pivot)
        if element.roller > 0.0:
            return [stand + rim, np.hstack([stand, pivot])]
        elbow = stand + 1j * SHANK * (pivot - stand)  # L-shaped, to clear the cam
        return [np.hstack([stand, elbow, pivot])]
    return [stand + rim, _stem(element, law, stand)]


def _stem(element: Element, law: Law, stand: ComplexArray) -> ComplexArray:
    out = 1j * getattr(element, "side", 1) * (element.roller + STEM * reach_of(element, law))
    return np.hstack([stand, stand + out])


def _face(element: GuidedFace, law: Law, motion: Motion) -> ComplexArray:
    """The part of the face that the contact passes over, and the foot of the stem."""
    every = Motion.uniform(law, 720)
    along = element.side * np.exp(1j * element.inclination)
    way = ((element.touch(every).contact - element.stand(every.s)) / along).real
    low, high = min(0.0, float(way.min())), max(0.0, float(way.max()))
    spare = SPARE * reach_of(element, law)
    ends = along * np.array([low - spare, high + spare])
    return np.asarray(element.stand(motion.s)[:, None] + ends)


def _swung_face(element: SwungFace, law: Law, motion: Motion) -> list[ComplexArray]:
    every = element.touch(Motion.uniform(law, 720))
    longest = float(np.abs(every.contact - element.pivot).max()) + SPARE * reach_of(element, law)
    along = np.exp(-1j * element.arm_angle(motion.s))[:, None]
    foot = element.pivot + 1j * element.offset * along
    pivot = np.full_like(foot, element.pivot)
    return [np.hstack([foot, foot - longest * along]), np.hstack([pivot, foot])]


def pivots(element: Element, count: int) -> FloatArray | None:
    """``(count, 2)`` places of the pivot around the cam, mm; None for a guide."""
    if not isinstance(element, SwungCentre | SwungFace):
        return None
    places = element.pivot * MM * np.exp(-1j * turn_angles(count))
    return np.column_stack([places.real, places.imag])
