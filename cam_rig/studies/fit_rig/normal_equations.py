"""Inverse of the normal equations of least squares, and directions without information."""

from __future__ import annotations

import numpy as np

from cam_rig.units import FloatArray

#: Change of the residuals along a direction, relative to the largest change, below which the
#: direction is not identifiable.
NULL_RTOL = 1e-6
#: Smallest component of a parameter in a unit vector for which the parameter is part of that
#: direction.
MIN_COMPONENT = 0.05


def normal_inverse(jacobian: FloatArray) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """Return (JᵀJ)⁻¹ ``(n, n)``, and groups of parameters that are not identifiable.

    ``jacobian`` is J with the shape ``(m, n)``. The parameters of a group can change together
    without a change of the residuals. A group is a tuple of indices.
    """
    sizes = np.linalg.norm(jacobian, axis=0)
    sizes[sizes == 0.0] = 1.0
    scaled = jacobian / sizes
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    identifiable = values > NULL_RTOL**2 * values.max(initial=0.0)
    inverse = (vectors[:, identifiable] / values[identifiable]) @ vectors[:, identifiable].T
    columns = (
        np.flatnonzero(np.abs(vector) > MIN_COMPONENT) for vector in vectors[:, ~identifiable].T
    )
    return inverse / np.outer(sizes, sizes), tuple(tuple(group.tolist()) for group in columns)
