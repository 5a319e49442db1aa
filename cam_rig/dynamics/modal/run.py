"""One mode's run on a law at any speeds: its least output, and where that first is zero."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from cam_rig.dynamics.events.search import call
from cam_rig.dynamics.linear.response import (
    RESONANT,
    LinearResponse,
    Outputs,
    no_steady_state,
)
from cam_rig.dynamics.modal.first_zero import PAUSED, Climb, climb, least_at
from cam_rig.dynamics.modal.least import free_at
from cam_rig.dynamics.modal.motion import (
    LawSeries,
    Oscillator,
    flow_over,
    motion_at,
    moved,
    on_law,
    resolved,
)
from cam_rig.dynamics.modal.sags import RATIO
from cam_rig.laws import Law, bernstein
from cam_rig.laws.rows import index_at, zeros
from cam_rig.units import TURN, FloatArray

#: Looks after which a search can be interrupted: some 20 ms of compiled code, a second of plain.
AT_ONCE = 5e5


#: Long pieces are cut, so many a turn at least.
PARTS = 8
#: Short pieces make groups, so many a turn at least; spans that differ by less than this part are
#: the same.
GROUPS, SAME = 64, 1e-12


def _cut(law: Law, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ordinates ``(p + 1, p + 2, m)``, jumps ``(p + 2, m)`` and breaks, long pieces cut."""
    joints = rows[0].copy()
    joints[:, 1:] -= rows[-1, :, :-1]
    joints[:, 0] -= rows[-1, :, -1]
    counts = np.ceil(law.spans * (PARTS / TURN) * (1.0 - SAME)).astype(int)
    if counts.max() == 1:
        return rows, joints, law.breaks.copy()  # compiled code is for arrays that may change
    found, breaks = bernstein.cut(rows, law.breaks, counts)
    jumps = np.zeros((rows.shape[1], counts.sum()))
    jumps[:, np.cumsum(counts) - counts] = joints
    return found, jumps, breaks


#: Harmonics that are bounded one by one, of twice as many samples: of few pieces, and of more;
#: beyond them, how many times `RATIO` further.
FEW, HARMONICS, FURTHER = 600, (256, 512), 100
#: What folds onto a harmonic k of N samples: Σ |c| over N − k, N + k, 2N − k, … over that at N − k.
FOLDED = math.pi**2 / 3.0
#: Rounding of a sample, of the lift.
EPS = 2.0**-50


@lru_cache(maxsize=64)
def _powers(degree: int, count: int) -> FloatArray:
    """1/kʳ⁺¹ for 1 ≤ r ≤ degree: of k, of N − k, and of those further on, ``(degree, m)``."""
    k, further = np.arange(1.0, count + 1.0), (count + 1.0) * RATIO ** np.arange(FURTHER)
    inverse = 1.0 / np.concatenate([k, 2.0 * count - k, further])
    return np.asarray(inverse ** (1.0 + np.arange(1.0, degree + 1.0)[:, None]))


def _harmonics(law: Law, jumps: FloatArray, ways: FloatArray) -> list[FloatArray]:
    """The last three of `LawSeries`, from Σ|jumps| and ∫|s⁽ᵏ⁾| dθ of a turn, ``(p + 2,)`` each.

    By parts, q + 1 times: 2π |cₖ| ≤ Σ J⁽ʳ⁾/kʳ⁺¹ + ∫|s⁽ᵠ⁺¹⁾| dθ/kᵠ⁺¹, J⁽ʳ⁾ the sum of the jumps of
    s⁽ʳ⁾ for 1 ≤ r ≤ q: the lift has none. Lower ones come from samples, to what folds.
    """
    count = HARMONICS[law.spans.size > FEW]
    parts = np.tril(np.broadcast_to(jumps[1:-1], (law.degree, law.degree))) + np.diag(ways[2:])
    most = (parts / TURN @ _powers(law.degree, count)).min(axis=0, initial=np.inf)
    angles = np.arange(2 * count) * (0.5 * TURN / count)
    at = np.searchsorted(law.breaks[1:-1], angles, side="right")
    weights = bernstein.basis(law.degree, (angles - law.breaks[at]) / law.spans[at])
    samples = (weights.T * law.ordinates[:, at]).sum(axis=0)
    sampled = np.abs(np.fft.rfft(samples)[1:]) / (2 * count) + FOLDED * most[count : 2 * count]
    harmonics = np.minimum(sampled + EPS * np.abs(samples).max(), most[:count])
    over, beyond = harmonics / np.arange(1.0, count + 1.0), most[2 * count :]
    rest = over[::-1].cumsum()[::-1] + beyond[0]
    return [harmonics, rest, beyond]


@lru_cache(maxsize=64)
def law_series(law: Law) -> LawSeries:
    """A law's derivatives."""
    own, rows = law.ordinates, np.empty((law.degree + 1, law.degree + 2, law.spans.size))
    for order in range(law.degree + 2):
        rows[:, order] = bernstein.elevate(own, law.degree)
        own = bernstein.derivative(own) / law.spans
    rows, jumps, breaks = _cut(law, rows)
    spans, absolute, jumped = np.diff(breaks), np.abs(rows), np.abs(jumps)
    largest, ways = absolute.max(axis=0), absolute.mean(axis=0) @ spans
    groups, ends = [0], np.searchsorted(breaks, breaks[:-1] + TURN / GROUPS, "right").tolist()
    while groups[-1] < spans.size:
        groups.append(max(groups[-1] + 1, ends[groups[-1]] - 1))
    begins = groups[:-1]
    first = jumped[:, begins]
    inner = np.maximum(np.add.reduceat(jumped, begins, axis=1) - first, 0.0)
    sizes = [np.maximum.reduceat(largest, begins, axis=1), first, inner]
    rising = np.argsort(spans, kind="stable")
    new = np.append(True, np.diff(spans[rising]) > SAME * spans[rising][1:])
    alike = np.empty_like(rising)
    alike[rising] = np.cumsum(new) - 1
    steepest = np.zeros((spans.size, 5))
    steepest[:, : len(largest)] = largest[:5].T
    tables: list[Any] = [rows, jumps, breaks, spans[rising][new], alike, np.array(groups)]
    tables += [largest.max(axis=1), np.stack(sizes), steepest]
    tables += _harmonics(law, jumped.sum(axis=1), ways)
    return LawSeries(*[np.ascontiguousarray(table) for table in tables])


@dataclass(frozen=True)
class ModalRun:
    """A mode on a law, from rest or in steady state."""

    law: Law
    mode: Oscillator

    @classmethod
    def of(
        cls, response: LinearResponse, outputs: Outputs, duration: float | None, row: int = 0
    ) -> ModalRun:
        """One row of a model's outputs, ``duration`` s from rest at θ = 0 or settled for ever.

        At which speed the response was made plays no part.
        """
        first, second, third = response.drive[1].tolist()
        s, slope, bend = outputs.law[row].tolist()
        mode = Oscillator(
            stiffness=-float(response.matrix[1, 0]),
            damping=-float(response.matrix[1, 1]),
            drive=(first, second, third),
            place=float(outputs.state[row, 0]),
            velocity=float(outputs.state[row, 1]),
            motion=(s, slope, bend),
            constant=float(outputs.constant[row]),
            duration=math.inf if duration is None else duration,
        )
        return cls(response.law, mode)

    def least(self, speeds: FloatArray) -> FloatArray:
        """Least output of the run at each speed (rad/s), ``(m,)``, to rounding."""
        return np.array([self.lowest(speed) for speed in speeds.tolist()])

    def lowest(self, speed: float) -> float:
        """Least output at one speed (rad/s)."""
        return float(call(least_at, law_series(self.law), self.mode, float(speed)))

    def resolved(self, speed: float) -> bool:
        """Whether rounding leaves the output its digits at a speed (rad/s)."""
        return resolved(on_law(law_series(self.law), self.mode), speed)

    def steady(self, speed: float, angle: float) -> FloatArray:
        """Free (η, η̇) in steady state at a speed (rad/s) and a cam angle (rad), ``(2,)``."""
        mode, law = self.mode, law_series(self.law)
        half, period = 0.5 * mode.damping, TURN / speed
        root = cmath.sqrt(half**2 - mode.stiffness)
        if min(abs(1.0 - cmath.exp((x - half) * period)) for x in (root, -root)) < RESONANT:
            raise no_steady_state(speed)
        motion = motion_at(on_law(law, mode), speed)
        piece = min(index_at(law.breaks, angle), len(law.alike) - 1)
        flow = zeros(4)
        flow_over(mode, (angle - law.breaks[piece]) / speed, flow)
        return np.array(moved(flow, free_at(motion, piece, 0)))

    def climb(self, low: float, last: float, most: float) -> Climb:
        """Up from a speed (rad/s) to where the output is zero, as `first_zero.climb`."""
        step, looks, table = 1.0, 0.0, law_series(self.law)
        while looks < most:
            at_once = min(AT_ONCE, most - looks)
            found = Climb(*call(climb, table, self.mode, low, step, last, at_once))
            if found.outcome != PAUSED:
                return found
            low, step, looks = found.low, found.step, looks + at_once
        return Climb(PAUSED, low, step, low, 0.0, 0.0)
