"""Rises whose acceleration is a sequence of constants and parts of sine waves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cam_rig.laws.sampling import Curve, Section
from cam_rig.units import FloatArray


def wave(constant: float, slope: float, size: float, frequency: float, phase: float) -> Curve:
    """Return the function constant + slope·u − size·sin(frequency·u + phase).

    The function also returns its derivatives.
    """

    def curve(u: FloatArray, order: int) -> FloatArray:
        sine = size * frequency**order * np.sin(frequency * u + phase + 0.5 * np.pi * order)
        line = (constant + slope * u, np.full_like(u, slope))
        return np.asarray((line[order] if order < 2 else 0.0) - sine)

    return curve


@dataclass(frozen=True)
class WavePart:
    """Part of a rise with the acceleration size·sin(frequency·v + phase).

    v runs from 0 to `width`. A constant acceleration has the frequency 0 and the phase π/2.
    """

    width: float
    size: float
    frequency: float = 0.0
    phase: float = 0.5 * math.pi

    def curve(self, start: float, level: float, slope: float) -> Curve:
        """Return the motion that starts at u = ``start`` with a level and a slope."""
        f, phase, size = self.frequency, self.phase, self.size

        def curve(u: FloatArray, order: int) -> FloatArray:
            v = u - start
            if f == 0.0:
                terms = (level + slope * v + 0.5 * size * v**2, slope + size * v, size + 0.0 * v)
                return np.asarray(terms[order] if order < 3 else 0.0 * v)
            added = size / f * math.cos(phase)
            line = wave(level + size / f**2 * math.sin(phase), slope + added, size / f**2, f, phase)
            return line(v, order)

        return curve


def wave_sections(parts: Sequence[WavePart]) -> list[Section]:
    """Return the rise from rest at 0 to the level 1 with a sequence of accelerations.

    The widths add up to 1. The accelerations are scaled so that the rise ends at 1.
    """
    edges = [0.0]
    for part in parts:
        edges.append(edges[-1] + part.width)
    edges[-1] = 1.0

    def motion(scale: float) -> tuple[list[Curve], float]:
        level, slope, curves = 0.0, 0.0, []
        for part, start, stop in zip(parts, edges[:-1], edges[1:], strict=True):
            scaled = WavePart(part.width, scale * part.size, part.frequency, part.phase)
            curves.append(scaled.curve(start, level, slope))
            level, slope = (float(curves[-1](np.array([stop]), order)[0]) for order in (0, 1))
        return curves, level

    curves, _ = motion(1.0 / motion(1.0)[1])
    return list(zip(edges[:-1], edges[1:], curves, strict=True))
