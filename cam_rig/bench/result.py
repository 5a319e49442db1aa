"""What a study finds: points of error against time, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass, field

from cam_rig.bench.cases.campaign import CampaignRate
from cam_rig.bench.cases.case import Case
from cam_rig.bench.peers.peers import Peer


@dataclass(frozen=True)
class WorkPrecisionPoint:
    """One setting of one solver: median wall time of ``repeats`` runs, and error."""

    time_s: float
    error: float
    event_error_s: float | None
    repeats: int
    rtol: float | None = None


@dataclass
class Sweep:
    """One peer over its tolerances; ``notes`` say what was left out and why."""

    peer: Peer
    points: list[WorkPrecisionPoint] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


@dataclass
class CaseResult:
    """One case: the rig's point, or why there is none, and the peers' sweeps."""

    case: Case
    rig: WorkPrecisionPoint | None = None
    missing: str | None = None
    sweeps: list[Sweep] = field(default_factory=list)

    def best(self, peer: str) -> tuple[Sweep, WorkPrecisionPoint] | None:
        """The peer's cheapest point that is no worse than the rig, else its most accurate."""
        all_points = [(s, p) for s in self.sweeps if s.peer.name == peer for p in s.points]
        if not all_points:
            return None
        good = [pair for pair in all_points if self.as_good(pair[1])]
        if good:
            return min(good, key=lambda pair: pair[1].time_s)
        return min(all_points, key=lambda pair: (pair[1].error, pair[1].time_s))

    def as_good(self, point: WorkPrecisionPoint) -> bool:
        """Whether a point's error is no larger than the rig's."""
        return self.rig is not None and point.error <= self.rig.error

    def ratio(self, point: WorkPrecisionPoint) -> float | None:
        """How many times longer than the rig it took."""
        return None if self.rig is None else point.time_s / self.rig.time_s

    @property
    def peers(self) -> list[str]:
        """Names of the peers in order, each once."""
        return list(dict.fromkeys(sweep.peer.name for sweep in self.sweeps))


@dataclass(frozen=True)
class WorkPrecisionStudy:
    """All cases in order, the sampling rates (1/s) by model, a campaign, and the conditions."""

    cases: dict[str, CaseResult]
    rates: dict[str, float]
    quick: bool
    cores: int
    took_s: float
    campaign: CampaignRate
