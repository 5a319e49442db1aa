"""How large cam and follower are drawn: each fills its view, whatever its size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cam_rig.arrays import FloatArray
from cam_rig.drawing.dial import NUMBER, ring_numbers
from cam_rig.drawing.follower import FollowerShape, Translating, follower_shape
from cam_rig.drawing.force_scale import max_contact_force
from cam_rig.drawing.outlines import MM, distances, turned
from cam_rig.profile import contours
from cam_rig.simulation.loaded_scene import LoadedScene

#: The ring of degrees around a cam, over the cam's greatest radius; what its numbers need.
RING, AROUND = 1.04, 1.09
#: A stem's end over its bearing, as a share of the follower's reach.
STEM_END = 0.04
#: Room below the ring for a line of words and the bar of a force, over its radius.
WORDS = 0.36
#: Room for a follower in flight above the law's greatest lift: a share of that, and of the
#: follower's reach, where that is more.
FLIGHT, FLIGHT_OF_REACH = 0.3, 0.05
#: Room at the lower edge and at either side of the view, over its height.
MARGIN, SIDE = 0.03, 0.01
#: Lifts at which the follower is looked at for what it covers, and its distance from a number
#: that it leaves free, over the ring's radius.
PLACES, CLEAR = 13, 0.14
#: The arrow of the greatest force, as a share of the picture's height.
ARROW = 0.22


@dataclass(frozen=True)
class Framing:
    """A cam with its follower in its view; lengths in mm, as the cam is.

    Parameters
    ----------
    shape : the follower
    ring : radius of the ring of degrees
    low, high : ``(2,)`` corners of all that is drawn
    """

    shape: FollowerShape
    ring: float
    low: FloatArray
    high: FloatArray

    @property
    def max_lift(self) -> float:
        """The lift (m) at which a follower in flight has reached the edge of its view."""
        shape = self.shape
        return shape.max_lift + max(FLIGHT * shape.max_lift, FLIGHT_OF_REACH * shape.reach)

    @property
    def height(self) -> float:
        """Of all that is drawn."""
        return float(self.high[1] - self.low[1])

    def numbers(self) -> tuple[FloatArray, list[str]]:
        """``(n, 2)`` places of the ring's numbers, and the numbers that no follower runs over."""
        places, numbers = ring_numbers(self.ring)
        covered = np.zeros(len(numbers), dtype=bool)
        for lift in np.linspace(0.0, self.shape.max_lift, PLACES)[:, None]:
            tilt, origin = float(self.shape.turn(lift)[0]), self.shape.origin(lift)[0] * MM
            for strip in self.follower():
                covered |= distances(places, turned(strip, tilt) + origin) < CLEAR * self.ring
        return places[~covered], [
            one for one, hidden in zip(numbers, covered, strict=True) if not hidden
        ]

    def follower(self) -> list[FloatArray]:
        """Strips of the follower, whose stem ends over its bearing."""
        strips = [strip * MM for strip in self.shape.outline()]
        if not isinstance(self.shape, Translating):
            return strips
        over = max(float(strip[:, 1].max()) for strip in self.shape.support())
        start = float(self.shape.origin(np.zeros(1))[0, 1])
        end = (over + STEM_END * self.shape.reach - start) * MM
        return [np.column_stack([x, np.minimum(y, end)]) for x, y in (s.T for s in strips)]


def framings(loaded: LoadedScene) -> dict[str, Framing]:
    """The framing of each cam of a scene."""
    return {name: _framing(loaded, name) for name in loaded.cams}


def force_scale(loaded: LoadedScene, speed: float) -> float:
    """The force (N) of the longest arrow: over all cams in contact at a speed (rad/s)."""
    return max(max_contact_force(loaded, cam, speed) for cam in loaded.cams)


def bounds(framed: dict[str, Framing]) -> tuple[list[float], list[float]]:
    """Range of x and y (mm, y down) of a view in which every cam is as high as the highest."""
    highest = max(one.height for one in framed.values())
    corners = [np.stack([one.low, one.high]) * highest / one.height for one in framed.values()]
    side = max(float(np.abs(two[:, 0]).max()) for two in corners)
    low, high = min(float(c[0, 1]) for c in corners), max(float(c[1, 1]) for c in corners)
    side += SIDE * highest
    return [-side, side], [-high, -low + MARGIN * highest]


def _framing(loaded: LoadedScene, name: str) -> Framing:
    cam, law = loaded.cams[name], loaded.laws[name]
    shape = follower_shape(cam, law)
    ring = RING * float(np.hypot(*contours(cam.follower, law, 360)[0].points).max()) * MM
    draft = Framing(shape, ring, np.zeros(2), np.zeros(2))
    points = [np.array([[-1.0, -1.0], [1.0, 1.0]]) * NUMBER * AROUND * ring]
    points += [strip * MM for strip in shape.support()]
    for lift in (np.zeros(1), np.array([draft.max_lift])):
        tilt, place = float(shape.turn(lift)[0]), shape.origin(lift)[0] * MM
        points += [turned(strip, tilt) + place for strip in draft.follower()]
    every = np.concatenate(points)
    low = every.min(axis=0) - np.array([0.0, WORDS * ring])
    return Framing(shape, ring, low, every.max(axis=0))
