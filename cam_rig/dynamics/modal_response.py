"""One mode on a turning cam at many speeds at once: forced response and free vibration.

Between two joints of the law the response is a polynomial, Σ hₖ Ωᵏ s⁽ᵏ⁾(θ) with hₖ the Taylor
coefficients of the transfer function: the same function of θ at every speed but for powers of Ω.
Where a derivative of s jumps that polynomial jumps, and free vibration makes up for it. So joints
excite the mode, and nothing else does; between joints the vibration decays freely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cam_rig.dynamics.linear.response import RESONANT, LinearResponse
from cam_rig.dynamics.linear.sampling import Outputs
from cam_rig.errors import DynamicsError
from cam_rig.laws import Law, bernstein
from cam_rig.units import TURN, ComplexArray, FloatArray, to_rpm

#: Amplitudes are summed over so many joints that they fade by e to this, at most.
FADED = 20.0


def taylor_series(top: NDArray[Any], bottom: NDArray[Any], count: int) -> NDArray[Any]:
    """Taylor coefficients of top(D)/bottom(D), by long division; complex where these are."""
    kind = np.result_type(top, bottom)
    found = np.zeros(count, kind)
    rest = np.zeros(count + bottom.size, kind)
    rest[: top.size] = top
    for k in range(count):
        found[k] = rest[k] / bottom[0]
        rest[k : k + bottom.size] -= found[k] * bottom
    return found


def carried(gains: NDArray[Any], ends: FloatArray, rates: NDArray[Any]) -> NDArray[Any]:
    """What gains ``(m, n)`` at angles ``ends`` (rad, rising from above 0) come to at each of them.

    They fade by e^{rate · angle} with ``rates`` ``(m, 1)``. Many are summed as they would be at the
    first one's angle, as long as none is thereby larger by more than e to `FADED`.
    """
    found = np.empty_like(gains)
    reach = FADED / max(float(np.abs(rates.real).max()), 1e-300)
    begin, before, angle = 0, np.zeros_like(gains[:, :1]), 0.0
    while begin < ends.size:
        end = max(begin + 1, int(np.searchsorted(ends, ends[begin] + reach)))
        fading = np.exp(rates * (ends[begin:end] - ends[begin]))
        before = before * np.exp(rates * (ends[begin] - angle))
        found[:, begin:end] = fading * (before + np.cumsum(gains[:, begin:end] / fading, axis=1))
        begin, before, angle = end, found[:, end - 1 : end], float(ends[end - 1])
    return found


#: Terms of the series after two below this fraction of the largest are rounding of a fit.
SETTLED = 1e-14
#: Rounding may take this part of the output.
LOST = 1e-4
#: Rates nearer than this fraction are moved apart: a critically damped mode is one, not two.
APART = 1e-7


@dataclass(frozen=True, eq=False)
class ModalResponse:
    """One output of a model with one mode, over one law, at any speeds.

    An amplitude is complex, ``(..., 2)``, one number for each rate λ: (η, η̇) = Σ a (1, λ) e^{λt}.
    """

    law: Law
    matrix: FloatArray  #: A of (η, η̇), ``(2, 2)``, first row (0, 1)
    drive: FloatArray  #: what s, ṡ, s̈ contribute to η̈, ``(3,)``
    state: FloatArray  #: what (η, η̇) contributes to the output, ``(2,)``
    motion: FloatArray  #: what (s, ṡ, s̈) contributes, ``(3,)``
    constant: float  #: of the output

    @classmethod
    def of(cls, response: LinearResponse, outputs: Outputs, row: int = 0) -> ModalResponse:
        """One row of a model's outputs; at which speed the response was made plays no part."""
        return cls(
            response.law,
            response.matrix,
            response.drive[1],
            outputs.state[row],
            outputs.law[row],
            float(outputs.constant[row]),
        )

    @cached_property
    def rates(self) -> ComplexArray:
        """The two rates λ, 1/s."""
        half, stiffness = 0.5 * self.matrix[1, 1], -self.matrix[1, 0]
        root = np.sqrt(complex(half**2 - stiffness))
        if abs(root) < APART * np.sqrt(stiffness):
            root = complex(APART * np.sqrt(stiffness))
        return np.array([half + root, half - root])

    @cached_property
    def conjugate(self) -> bool:
        """Whether the two rates are: of two such amplitudes one tells the other."""
        return bool(np.iscomplex(self.rates).all())

    @cached_property
    def light(self) -> bool:
        """Whether damping is so far below critical that amplitudes tell the size of their sum."""
        return self.conjugate and bool(abs(self.rates[0].imag) > 0.5 * abs(self.rates[0]))

    @cached_property
    def shown(self) -> ComplexArray:
        """What an amplitude contributes to the output, ``(2,)``."""
        return np.asarray(self.state[0] + self.state[1] * self.rates)

    @cached_property
    def shares(self) -> tuple[ComplexArray, ComplexArray]:
        """Rates and `shown` of which real parts sum up to the output; one of conjugate ones."""
        if self.conjugate:
            return self.rates[:1], 2.0 * self.shown[:1]
        return self.rates, self.shown

    @cached_property
    def bend_rate(self) -> float:
        """`bend` is no more than `envelope` times the square of this, 1/s."""
        rate = float(np.sqrt(-self.matrix[1, 0]))
        return rate if self.light else rate - float(self.matrix[1, 1])

    @cached_property
    def own(self) -> FloatArray:
        """hₖ of η, ``(p + 1,)``."""
        bottom = np.array([-self.matrix[1, 0], -self.matrix[1, 1], 1.0])
        return taylor_series(self.drive, bottom, self.law.degree + 1)

    @cached_property
    def output(self) -> FloatArray:
        """The same for the output, ``(p + 1,)``."""
        series = np.convolve(self.state, self.own)[: self.own.size]
        most = min(3, series.size)
        series[:most] += self.motion[:most]
        return series

    @cached_property
    def derivatives(self) -> FloatArray:
        """``(p + 2, p + 1, n)``: ordinates of s and of all its derivatives in θ."""
        return np.stack([self.law.derivative_ordinates(k) for k in range(self.law.degree + 2)])

    def powers(self, speeds: FloatArray) -> FloatArray:
        """Ωᵏ, ``(m, p + 1)``, zero where the series has settled."""
        powers = speeds[:, None] ** np.arange(float(self.own.size))
        sizes = self._sizes(powers)
        small = sizes <= SETTLED * np.maximum.accumulate(sizes, axis=1)
        over = np.logical_and(small[:, :-1], small[:, 1:])
        over = np.logical_or.accumulate(over[:, 2:], axis=1)
        powers[:, 3:][over] = 0.0
        return powers

    def _sizes(self, powers: FloatArray) -> FloatArray:
        """The largest value of each term of the series, ``(m, p + 1)``."""
        return np.asarray(np.abs(self.output) * powers * self._largest)

    @cached_property
    def _largest(self) -> FloatArray:
        """The largest ordinate of s and of each of its derivatives, ``(p + 1,)``."""
        return np.asarray(np.abs(self.derivatives[:-1]).max(axis=(1, 2)))

    def resolved(self, speeds: FloatArray) -> NDArray[np.bool_]:
        """Whether rounding leaves the output its digits, ``(m,)``.

        Where the mode has few periods in a short piece of high degree, the terms grow and cancel
        against the free vibration.
        """
        sizes = self._sizes(speeds[:, None] ** np.arange(float(self.own.size)))
        return np.asarray(bernstein.EPS * sizes.max(axis=1) <= LOST * sizes[:, :3].max(axis=1))

    @cached_property
    def terms(self) -> FloatArray:
        """``(p + 1, n, p + 1)``: each term of the output's series, its ordinates piece by piece."""
        ordinates = self.derivatives[:-1].transpose(0, 2, 1)
        return np.ascontiguousarray(self.output[:, None, None] * ordinates)

    def forced(self, speeds: FloatArray) -> FloatArray:
        """Ordinates of the output's polynomial part in every piece, ``(m, n, p + 1)``."""
        flat = self.powers(speeds) @ self.terms.reshape(self.own.size, -1)
        return np.asarray((flat + self.constant).reshape(-1, *self.terms.shape[1:]))

    @cached_property
    def _edges(self) -> FloatArray:
        """``(2, p + 2, n)``: jumps of s⁽ᵏ⁾ at the start of each piece, and s⁽ᵏ⁾ there."""
        start, end = self.derivatives[:, 0], self.derivatives[:, -1]
        return np.stack([start - np.roll(end, 1, axis=1), start])

    def _amplitude(self, speeds: FloatArray, edges: FloatArray) -> ComplexArray:
        """What makes up for a jump of the polynomial by s⁽ᵏ⁾ ``(p + 2, n)``: ``(m, n, 2)``."""
        weights = self.own * self.powers(speeds)
        eta = -weights @ edges[:-1]
        rate = -(weights * speeds[:, None]) @ edges[1:]
        one, two = self.rates
        first = (rate - two * eta) / (one - two)
        return self._both(first, lambda: (one * eta - rate) / (one - two))

    def _both(self, first: ComplexArray, second: Callable[[], ComplexArray]) -> ComplexArray:
        """``(..., 2)`` of both rates; what belongs to the second is asked for if it has to be."""
        other = first.conj() if self.conjugate else second()
        return np.stack([first, other], axis=-1).astype(np.complex128, copy=False)

    def state_jumps(self, speeds: FloatArray) -> ComplexArray:
        """What the joint at the start of each piece adds to the amplitude, ``(m, n, 2)``."""
        return self._amplitude(speeds, self._edges[0])

    def from_rest(self, speeds: FloatArray) -> ComplexArray:
        """Amplitude at θ = 0 of a run from rest, without vibration (η = η̇ = 0), ``(m, 2)``."""
        return self._amplitude(speeds, self._edges[1][:, :1])[:, 0]

    def fading(self, speeds: FloatArray, angle: FloatArray | float) -> ComplexArray:
        """e^{λ t} over cam angles (rad), ``(m, len(angle), 2)``."""
        return self.fading_at(np.atleast_1d(angle) / speeds[:, None])

    def fading_at(self, times: FloatArray) -> ComplexArray:
        """e^{λ t} at times in s of any shape, ``(..., 2)``."""
        one, two = self.rates
        return self._both(np.exp(times * one), lambda: np.exp(times * two))

    def envelope(self, amplitude: ComplexArray) -> FloatArray:
        """What the output of free vibration does not exceed from an amplitude ``(..., 2)`` on.

        With light damping two conjugate amplitudes fade as they are; others may grow in their sum,
        its energy does not.
        """
        if self.light:
            return np.asarray(2.0 * np.abs(self.shown[0]) * np.abs(amplitude[..., 0]))
        rate = np.sqrt(-self.matrix[1, 0])
        eta, slope = amplitude.sum(axis=-1).real, (amplitude @ self.rates).real
        reach = abs(self.state[0]) / rate + abs(self.state[1])
        return np.asarray(reach * np.hypot(rate * eta, slope))

    def bend(self, amplitude: ComplexArray) -> FloatArray:
        """The same of the output's second derivative in time."""
        return self.envelope(amplitude * self.rates**2)

    def decay(self, speeds: FloatArray, angle: FloatArray) -> FloatArray:
        """By what an `envelope` falls over cam angles (rad), ``(m, len(angle))``."""
        rate = self.rates[0].real if self.light else 0.0
        return np.asarray(np.exp(rate * angle / speeds[:, None]))

    def largest_state_jumps(self, speed: float) -> tuple[FloatArray, float]:
        """Most of `envelope` of each state jump ``(n,)`` and from rest up to a speed; if light."""
        powers = self.powers(np.array([speed]))[0] * np.abs(self.own)
        eta = np.abs(self._edges[:, :-1]).transpose(0, 2, 1) @ powers
        rate = np.abs(self._edges[:, 1:]).transpose(0, 2, 1) @ (powers * speed)
        one, two = self.rates
        amplitude = (rate + abs(two) * eta) / abs(one - two)
        jumps, start = 2.0 * np.abs(self.shown[0]) * amplitude
        return jumps, float(start[0])

    def since_turn(self, speeds: FloatArray) -> ComplexArray:
        """Amplitudes at pieces and turn's end of this turn's jumps alone, ``(m, n + 1, 2)``."""
        gains = np.roll(self.state_jumps(speeds), -1, axis=1)
        one, two = (rate / speeds[:, None] for rate in self.rates)
        ends = self.law.breaks[1:]
        found = self._both(
            carried(gains[:, :, 0], ends, one), lambda: carried(gains[:, :, 1], ends, two)
        )
        return np.concatenate([np.zeros_like(found[:, :1]), found], axis=1)

    def steady(self, speeds: FloatArray, turn: ComplexArray | None = None) -> ComplexArray:
        """Amplitude at θ = 0 that a turn brings back, ``(m, 2)``; ``turn`` is what it adds."""
        gap = 1.0 - self.fading(speeds, TURN)[:, 0]
        worst = int(np.argmin(np.abs(gap).min(axis=1)))
        if np.abs(gap[worst]).min() < RESONANT:
            raise DynamicsError(
                f"no steady state at {to_rpm(speeds[worst]):.6g} rpm: a mode without "
                "damping is at a harmonic of the speed; allowed: damping, or another speed"
            )
        turn = self.since_turn(speeds)[:, -1] if turn is None else turn
        return np.asarray(turn / gap)

    def amplitude_at(self, speeds: FloatArray, angle: float) -> FloatArray:
        """Amplitude of the steady free vibration in the output at an angle, after a jump."""
        piece = self.law.piece(angle)
        start = float(self.law.breaks[piece])
        at = self.steady(speeds) * self.fading(speeds, start)[:, 0]
        at = (at + self.since_turn(speeds)[:, piece]) * self.fading(speeds, angle - start)[:, 0]
        return np.asarray(np.abs(at * self.shown).sum(axis=1))
