"""Maximum likelihood search: least squares of lift and force residuals of periodic turns.

The motion at a steady speed is computed as a turn that repeats. With the noise of `noise_model`,
the sum of squared residuals in standard deviations is twice the negative logarithm of the
likelihood, up to a constant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from cam_rig.errors import ConfigError
from cam_rig.studies.fit_rig.parameters import search_limits
from cam_rig.studies.fit_rig.run.instruments import RATIO
from cam_rig.studies.fit_rig.run.likelihood import Likelihood, PredictedSegment
from cam_rig.studies.fit_rig.run.noise_model import update_noise
from cam_rig.studies.fit_rig.run.turns import MeasuredSegment
from cam_rig.units import FloatArray

#: Largest number of least-squares searches in one fit. Before each of them the noise and the set of
#: samples next to landings are updated.
MAX_ROUNDS = 8
#: Distance (rad) from a landing within which force samples are left out in the first search of a
#: fit. The force jumps at a landing.
FIRST_GUARD = 0.05
#: Distance (rad) from a landing within which force samples are left out in the later searches of a
#: fit.
GUARD = 0.01
#: Largest number of evaluations of the residuals in each of the first two least-squares searches of
#: a fit, in which the noise is not known yet.
MAX_FIRST_STEPS = 6
#: Largest number of evaluations of the residuals in each later least-squares search of a fit.
MAX_STEPS = 40
#: Relative decrease of the sum of squares below which a least-squares search stops.
SSE_RTOL = 3e-7
#: Smallest and largest damping ratio of the force sensor's resonance in the search.
DAMPING_RATIO_LIMITS = (1e-4, 2.0)


@dataclass(frozen=True, eq=False)
class Candidate:
    """Start of a search: the likelihood of a measured run, and search variables.

    ``x`` ``(n,)`` are the values of the search variables: follower parameters and instrument
    errors.
    """

    likelihood: Likelihood
    x: FloatArray

    @property
    def segments(self) -> tuple[MeasuredSegment, ...]:
        """Steady-speed segments of the run to which the follower is fitted."""
        return self.likelihood.segments

    @property
    def values(self) -> dict[str, float]:
        """All parameters of the follower (SI) by name, free and fixed."""
        return self.likelihood.values(self.x)

    @property
    def smooth(self) -> tuple[str, ...]:
        """Names of the free parameters on which the residuals depend smoothly.

        They are all free parameters except the restitution.
        """
        return tuple(name for name in self.likelihood.free if name != "restitution")

    @cached_property
    def predicted(self) -> tuple[PredictedSegment | None, ...]:
        """Computed lift and force of each steady-speed segment.

        An entry is None if the follower has no periodic turn at the speed of the segment.
        """
        return tuple(self.likelihood.predicted(self.x, i) for i in range(len(self.segments)))

    @property
    def steady(self) -> list[int]:
        """Indices of the steady-speed segments at which the follower has a periodic turn."""
        return [i for i, predicted in enumerate(self.predicted) if predicted is not None]

    @property
    def landings(self) -> list[int]:
        """Number of landings per turn, for each steady-speed segment.

        It is given as 1 for a segment without a periodic turn, because such a follower bounces.
        """
        return [
            1
            if predicted is None
            else sum(event.kind == "landing" for event in predicted.turn.events)
            for predicted in self.predicted
        ]


@dataclass(frozen=True, eq=False)
class FitSolution(Candidate):
    """Result of a search: search variables, Jacobian and residuals.

    ``jacobian`` ``(m, n)`` and ``residuals`` ``(m,)`` are in standard deviations of the samples.
    ``bounce`` is a restitution with its standard error that was estimated separately from the
    search, or None. ``zero`` (N) is the force that the sensor shows in flights that were left out
    of the search, or None if it is not significant.
    """

    jacobian: FloatArray
    residuals: FloatArray
    bounce: tuple[float, float] | None = None
    zero: float | None = None


def search(start: Candidate) -> FitSolution:
    """Fit the free parameters by maximum likelihood, starting from ``start``.

    Several least-squares searches are run. Before each, the noise is estimated again from the
    residuals, and the force samples next to landings are excluded again.
    """
    likelihood, x = start.likelihood, start.x
    bounds = _limits(likelihood, x.size)
    margin = np.where(np.isfinite(bounds), 1e-9 * np.maximum(1.0, np.abs(bounds)), 0.0)
    limits_inside = bounds[0] + margin[0], bounds[1] - margin[1]
    x = np.clip(x, *limits_inside)
    for i in range(MAX_ROUNDS):
        masks_changed = likelihood.exclude_landings(x, FIRST_GUARD if i == 0 else GUARD)
        noise_changed = update_noise(likelihood, likelihood.residuals(x))
        if i > 1 and not masks_changed and not noise_changed:
            break
        result = least_squares(
            likelihood.residuals,
            x,
            likelihood.jacobian,
            bounds=tuple(bounds),
            x_scale="jac",
            ftol=SSE_RTOL,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=MAX_FIRST_STEPS if i < 2 else MAX_STEPS,
        )
        x = np.clip(result.x, *limits_inside)
    return FitSolution(likelihood, result.x, np.asarray(result.jac), result.fun)


def _limits(likelihood: Likelihood, size: int) -> FloatArray:
    """Return the lower and upper limits of the search variables, ``(2, size)``.

    The instrument errors, which follow after the follower's parameters, are unlimited, except the
    damping ratio of the force sensor. ``size`` is the number of all variables.
    """
    unbounded = np.array([[-np.inf], [np.inf]]) * np.ones(size - len(likelihood.free))
    bounds = np.hstack([search_limits(likelihood.free), unbounded])
    if (index := likelihood.instruments.index.get(RATIO)) is not None:
        bounds[:, index] = DAMPING_RATIO_LIMITS
    return bounds


def continue_from(
    candidate: Candidate,
    free: tuple[str, ...],
    values: dict[str, float],
    indices: Sequence[int] | None = None,
    **changes: Any,
) -> Candidate:
    """Return a new start for a search, with other free parameters and values.

    ``free`` are the names of the free parameters, ``values`` all parameters in SI. ``indices`` are
    those of the steady-speed segments to use (default: all). ``changes`` are changed fields of the
    `Likelihood`, such as ``backlash``. Segments without a periodic turn are left out. Instrument
    errors are taken from ``candidate``.
    """
    old = candidate.likelihood
    steady = [i for i in candidate.steady if indices is None or i in indices]
    if not steady:
        raise ConfigError(
            "at no speed does the motion of the follower repeat from turn to turn; needed: a speed "
            "below the jump speed"
        )
    new = replace(
        old,
        segments=tuple(old.segments[i] for i in steady),
        free=free,
        fixed={name: value for name, value in values.items() if name not in free},
        force_masks=[],
        pressing=[],
        **changes,
    )
    instruments, old_instruments = new.instruments, old.instruments
    x = new.start(values, 0.0, 0.0)
    x[instruments.phases] = candidate.x[old_instruments.phases][steady]
    x[instruments.speeds] = candidate.x[old_instruments.speeds][steady]
    for name, index in instruments.index.items():
        x[index] = old.single(candidate.x, name)
    return Candidate(new, x)


def phase_line_matrix(fit: Candidate) -> FloatArray:
    """Return the design matrix of a straight line through the phases, ``(n, 2)``.

    There is one phase per steady-speed segment. The columns are 1 and ω t at the middle of each
    segment. The coefficients are the negative encoder offset and clock error.
    """
    return np.array([[1.0, h.speed * h.line.middle] for h in fit.segments])
