"""Inverse of the normal equations of least squares, and groups of unidentifiable parameters."""

from __future__ import annotations

import numpy as np

from cam_rig.units import FloatArray

#: Norm of the residuals' change along a direction in parameter space, relative to the largest such
#: change, below which the data do not identify that direction.
NULL_RTOL = 1e-6
#: Absolute component of a parameter in the unit vector of an unidentifiable direction, above which
#: the parameter belongs to the group that cannot be identified.
MIN_COMPONENT = 0.05


def normal_inverse(jacobian: FloatArray) -> tuple[FloatArray, tuple[tuple[int, ...], ...]]:
    """Return (JᵀJ)⁻¹ ``(n, n)``, and groups of parameters that are not identifiable.

    ``jacobian`` is J with the shape ``(m, n)``. The parameters of a group can change together
    without a change of the residuals. A group is a tuple of column indices of J. The inverse is
    restricted to the identifiable directions.
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
