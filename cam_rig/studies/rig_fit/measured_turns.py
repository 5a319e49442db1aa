"""What is compared of a measured run: its samples in each hold, on the encoder's angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cam_rig.arrays import FloatArray
from cam_rig.errors import ConfigError
from cam_rig.simulation.measured_run import MeasuredRun, Signal, pulls
from cam_rig.studies.real_run.departure import scatter
from cam_rig.studies.rig_fit.holds import Hold, steady_holds

#: Turns of a hold that are left out, for the follower to settle, where it has twice as many.
SETTLE_TURNS = 1.0
#: HoldSamples of a quantity that are fitted, at most; of more every k-th is taken.
MOST_SAMPLES = 40_000
#: HoldSamples of a hold, at least.
LEAST_SAMPLES = 20
#: A follower that presses with more than this part of its largest force is on the cam; of a hold it
#: may press with less in this part of the samples, as noise has it.
PRESSED, SELDOM = 0.05, 0.01
#: No cam pulls: a force that is below minus this part of its largest in this part of the samples is
#: its sensor's.
PULLED, RARELY = 0.1, 0.001
#: A lift that differs by more than this part of itself from turn to turn is of no steady motion.
RESTLESS = 0.02


@dataclass(frozen=True, eq=False)
class HoldSamples:
    """One quantity in one hold: times since the hold's middle (s) and values (SI), ``(n,)``."""

    since: FloatArray
    value: FloatArray

    def where(self, kept: NDArray[np.bool_]) -> HoldSamples:
        """Some of them."""
        return HoldSamples(self.since[kept], self.value[kept])


@dataclass(frozen=True, eq=False)
class MeasuredHold:
    """A hold with what was measured in it; ``angle`` (rad) is the encoder's in its middle."""

    hold: Hold
    angle: float
    lift: HoldSamples
    force: HoldSamples

    @property
    def speed(self) -> float:
        """rad/s, by the encoder."""
        return self.hold.speed

    @property
    def presses(self) -> bool:
        """Whether no sample of the force shows a loss of contact; so too where there is none."""
        force = self.force.value
        return not force.size or bool(np.quantile(force, SELDOM) > PRESSED * force.max())

    @property
    def rings(self) -> bool:
        """Whether the force pulls now and then, as that of a sensor that vibrates."""
        force = self.force.value
        return force.size > 0 and bool(np.quantile(force, RARELY) < -PULLED * force.max())


def measured_holds(run: MeasuredRun) -> tuple[MeasuredHold, ...]:
    """The holds of a run in which something was measured.

    Raises
    ------
    ConfigError : there is none, or neither lift nor force was recorded
    """
    if run.lift is None and run.force is None:
        raise ConfigError(
            f"{run.source}: has neither lift nor contact force; needed: one of them, so map its "
            "topic"
        )
    for name, signal in (("lift", run.lift), ("force", run.force)):
        if signal is not None:
            _require_alive(run, name, signal)
    holds = [
        hold.after(SETTLE_TURNS) or hold if hold.turns > 2.0 * SETTLE_TURNS else hold
        for hold in steady_holds(run)
    ]
    every = [_every(signal, holds) for signal in (run.lift, run.force)]
    found, most = [], 0
    for hold in holds:
        lift = _within(run.lift, hold, every[0])
        force = _within(run.force, hold, every[1])
        count = lift.since.size + force.since.size
        most = max(most, count)
        if count >= LEAST_SAMPLES:
            middle = 0.5 * (hold.begin + hold.end)
            found.append(MeasuredHold(hold, float(hold.angle_at(np.array(middle))), lift, force))
    if not found:
        raise ConfigError(
            f"{run.source}: {most or 'no'} samples of lift and force while the cam turns steadily "
            f"at one speed; needed: {LEAST_SAMPLES}, so sample faster, or hold a speed longer"
            f"{'' if most else ' (are their stamps of one clock?)'}"
        )
    steady = tuple(hold for hold in found if not _is_restless(hold))
    if not steady:
        raise ConfigError(
            f"{run.source}: at no speed does the lift come back from turn to turn within "
            f"{100.0 * RESTLESS:g} % of itself, as the follower bounces; needed: a speed at which "
            "it does, so one below the jump speed"
        )
    return steady


def _is_restless(hold: MeasuredHold) -> bool:
    """Whether the follower moves differently in each turn, by more than a gauge's noise."""
    lift = hold.lift
    if not lift.value.size:
        return False
    return scatter(hold.speed * lift.since, lift.value) > RESTLESS * float(np.ptp(lift.value))


def _require_alive(run: MeasuredRun, name: str, signal: Signal) -> None:
    """Refuse a channel that says nothing, or a force with the sign of a pull."""
    where = f"{run.source}: {name} ({signal.source or name})"
    if signal.value.size < LEAST_SAMPLES:
        raise ConfigError(
            f"{where} has {signal.value.size} samples; needed: {LEAST_SAMPLES} or more"
        )
    low, high = float(signal.value.min()), float(signal.value.max())
    if high - low <= 1e-12 * max(abs(low), abs(high)):
        raise ConfigError(
            f"{where} is {low:g} all the time; needed: one that changes, so look at its cable, or "
            "leave it out"
        )
    if name == "force" and pulls(signal.value):
        raise ConfigError(
            f"{where} is from {low:.4g} to {high:.4g} N; allowed: a contact force that presses, so "
            "turn its sign: force=-/TOPIC"
        )


def _inside(signal: Signal, hold: Hold) -> slice:
    return slice(*np.searchsorted(signal.time, [hold.begin, hold.end]).tolist())


def _every(signal: Signal | None, holds: list[Hold]) -> int:
    if signal is None:
        return 1
    count = sum(signal.time[_inside(signal, hold)].size for hold in holds)
    return -(-count // MOST_SAMPLES) or 1


def _within(signal: Signal | None, hold: Hold, every: int) -> HoldSamples:
    if signal is None:
        return HoldSamples(np.empty(0), np.empty(0))
    inside = _inside(signal, hold)
    middle = 0.5 * (hold.begin + hold.end)
    return HoldSamples(signal.time[inside][::every] - middle, signal.value[inside][::every])
